"""Which things changed: hypotheses that stand out are fitted to the new recordings in full, all else as it was.

One is taken after another, as long as the data call for more; then each is held against others in its place, and what
the others make needless goes, as in the diagnosis of what is missing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from pneucli.changes.baseline import baseline_at_fit
from pneucli.changes.comparison import Comparison, Hypothesis, HypothesisTest
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.least_squares import pseudo_inverse
from pneucli.identify.estimation.model_fit import fit_with_effect
from pneucli.identify.estimation.score_test import score_tests
from pneucli.identify.residuals import ResidualModel
from pneucli.physics.declaration import Effect

Array = NDArray[np.float64]
Hypotheses = tuple[Hypothesis, ...]

MAX_CANDIDATES = 6  # hypotheses of different names that are refitted in one round
AKAIKE_PENALTY = 2.0  # what a further parameter must take off the cost
MAX_CHANGES = 3  # changes at once
MAX_SWAP_ROUNDS = 2  # rounds in which each is held against others in its place


@dataclass(frozen=True)
class RefitCost:
    """Things that changed, fitted in full: what they cost with all else as it was, and how many parameters are free."""

    cost: float
    parameter_count: int
    fit: Fit


@dataclass
class ChangeSelection:
    """What may have changed in a ``comparison``, and the ``fitted`` fit of the old model to the new recordings.

    ``significance_level``: the chance below which one test of the family tells.
    """

    comparison: Comparison
    fitted: Fit
    views: Sequence[ResidualModel]
    effects: Mapping[str, Effect]
    significance_level: float
    _fits: dict[tuple[str, ...], Fit | None] = field(default_factory=dict)
    _comparisons: dict[tuple[str, ...], Comparison] = field(default_factory=dict)

    def select(self) -> Hypotheses:
        """Return what changed, what explains most first; nothing where nothing known is worth its parameters."""
        taken: Hypotheses = ()
        while len(taken) < MAX_CHANGES and (more := self._add_one(taken)):
            taken = more
        for _ in range(MAX_SWAP_ROUNDS if len(taken) > 1 else 0):
            swapped = self._swap_each(taken)
            if swapped == taken:
                break
            taken = swapped
        return self._drop_needless(taken)

    def _add_one(self, taken: Hypotheses) -> Hypotheses:
        """Return one thing more, where the data call for it and it is worth its parameters; else nothing."""
        tested = self.comparison_given(taken).test_all()
        if taken and (not tested or tested[0].p_value > self.significance_level):
            return ()
        options = [(*taken, one) for one in self._candidates(taken)]
        best = self._best(options) if options else ()
        return best if best and self._gain_is_significant(taken, best) else ()

    def _best(self, options: Sequence[Hypotheses]) -> Hypotheses:
        """Return what costs least, with what each parameter must take off, by what the residuals then vary by."""
        spread = self.overdispersion(min(options, key=lambda one: self.refit_cost(one).cost))
        return min(options, key=lambda one: self._penalised_cost(one, spread))

    def _gain_is_significant(self, less: Hypotheses, more: Hypotheses) -> bool:
        before, after = self.refit_cost(less), self.refit_cost(more)
        gain = (before.cost - after.cost) / self.overdispersion(more)
        return bool(
            np.isfinite(gain)
            and gain > chi2.isf(self.significance_level, max(after.parameter_count - before.parameter_count, 1))
        )

    def _candidates(self, taken: Hypotheses) -> list[Hypothesis]:
        """Return the hypotheses that stand out beside those taken, one of each name."""
        names = {one.name for one in taken}
        first = {t.hypothesis.name: t for t in reversed(self.comparison_given(taken).test_all())}
        ranked = sorted(first.values(), key=lambda t: -abs(t.t_statistic))
        found = [t.hypothesis for t in ranked if t.hypothesis.name not in names][:MAX_CANDIDATES]
        here, first_of = self.comparison_given(taken).old.typical_effects, self.comparison.old.typical_effects
        return [
            h if h.effect_index is None else replace(h, effect_index=first_of.index(here[h.effect_index]))
            for h in found
        ]

    def test(self, taken: Hypotheses, one: Hypothesis) -> HypothesisTest | None:
        """Return what the data say of one hypothesis beside things that are known to have changed."""
        beside = self.comparison_given(taken)
        if one.effect_index is None:
            return beside.test(one)
        start = self.comparison.old.typical_effects[one.effect_index]
        known = start in beside.old.typical_effects
        return beside.test(replace(one, effect_index=beside.old.typical_effects.index(start))) if known else None

    def comparison_given(self, taken: Hypotheses) -> Comparison:
        """Return the comparison in which things are known to have changed; their effects are in the fitted model."""
        effects = {one.name: one for one in taken if one.effect_index is not None}
        key = tuple(sorted(effects))
        if key not in self._comparisons:
            self._comparisons[key] = self._comparison_with_effects(tuple(effects.values()))
        return self._comparisons[key].with_accepted(*(one for one in taken if one.effect_index is None))

    def _comparison_with_effects(self, effects: Hypotheses) -> Comparison:
        fitted = self._fitted(tuple(one.name for one in effects))
        if not effects or fitted is None:
            return self.comparison
        old, names = self.comparison.old, {one.name for one in effects}
        for one in effects:
            assert one.effect_index is not None
            old = old.with_effect_free(one.effect_index)
        lacking = [e for name, e in self.effects.items() if name not in names]
        new = baseline_at_fit(fitted, self.views, lacking, old.typical_effects)
        kept = [s for s in old.typical_effects if s.effect not in names]
        coordinates = [c.name for c in old.coordinates]
        first, k = self.comparison.old.typical_effects, len(coordinates)
        called = self.comparison.names
        called = (*called[:k], *(called[k + first.index(s)] for s in kept)) if called else ()
        return replace(
            self.comparison,
            old=old.restricted_to(coordinates, kept),
            new=new.restricted_to(coordinates, kept),
            names=called,
        )

    def _swap_each(self, taken: Hypotheses) -> Hypotheses:
        """Return the things with each replaced by what explains more in its place, the others staying."""
        for i in range(len(taken)):
            taken = self._best(self._alternatives(taken, i))
        return taken

    def _alternatives(self, taken: Hypotheses, place: int) -> list[Hypotheses]:
        """Return what was taken, first as it is, then with others in one place."""
        rest = self.without(taken, place)
        others = [one for one in self._candidates(rest) if one.name != taken[place].name]
        return [taken, *((*taken[:place], one, *taken[place + 1 :]) for one in others)]

    def _drop_needless(self, taken: Hypotheses) -> Hypotheses:
        """Return the things without those that the others make needless."""
        while len(taken) > 1:
            needless = [i for i in range(len(taken)) if not self._gain_is_significant(self.without(taken, i), taken)]
            if not needless:
                break
            taken = self._best([self.without(taken, i) for i in needless])
        return taken

    @staticmethod
    def without(taken: Hypotheses, place: int) -> Hypotheses:
        """Return all but one."""
        return (*taken[:place], *taken[place + 1 :])

    def likelihood_shares(self, taken: Hypotheses, place: int) -> dict[str, float]:
        """Return how likely each is in one place, by name: what was taken, and what stands out beside the others."""
        options = self._alternatives(taken, place)
        spread = self.overdispersion(taken)
        costs = np.array([self._penalised_cost(one, spread) for one in options])
        likely = np.exp(-0.5 * (costs - costs.min()) / spread)
        return {one[place].name: float(p) for one, p in zip(options, likely / likely.sum(), strict=True)}

    def refit_cost(self, taken: Hypotheses) -> RefitCost:
        """Return what things that changed together cost."""
        fitted = self._fitted(tuple(one.name for one in taken if one.effect_index is not None))
        if fitted is None:
            return RefitCost(np.inf, len(taken), self.fitted)
        directions = [one.direction for one in taken if one.direction is not None]
        extra = sum(
            f.name.partition(".")[0] in {o.name for o in taken if o.effect_index is not None} for f in fitted.free
        )
        return RefitCost(self._cost(fitted, directions), len(directions) + extra, fitted)

    def _penalised_cost(self, taken: Hypotheses, spread: float) -> float:
        one = self.refit_cost(taken)
        return one.cost + AKAIKE_PENALTY * spread * one.parameter_count

    def _fitted(self, names: tuple[str, ...]) -> Fit | None:
        """Return the fit with these effects more, in whatever order they come; None where one has no size there."""
        key = tuple(sorted(names))
        if not names:
            return self.fitted
        if key not in self._fits:
            before, effect = self._fitted(names[:-1]), self.effects[names[-1]]
            ranked = score_tests(effect, before, self.views) if before is not None else []
            fitted = (
                fit_with_effect(before, self.views, effect, ranked=ranked) if before is not None and ranked else None
            )
            self._fits[key] = fitted
        return self._fits[key]

    def _cost(self, fitted: Fit, directions: Sequence[Array]) -> float:
        """Return the cost of a fit, its estimates held to what they were, but for directions in which they may move."""
        old = self.comparison.old
        bread = pseudo_inverse(fitted.jacobian.T @ fitted.jacobian)
        mine = [[f.name for f in fitted.free].index(c.name) for c in old.coordinates]
        scale = np.array([1.0 if f.logarithmic else f.scale for f in (fitted.free[i] for i in mine)])
        values = [fitted[c.name].value for c in old.coordinates]
        places = [np.log(v) if c.logarithmic else v for v, c in zip(values, old.coordinates, strict=True)]
        moved = np.array(places) - old.estimates
        varies, _ = self.comparison.repeat_variance()
        weight = pseudo_inverse(
            bread[np.ix_(mine, mine)] * np.outer(scale, scale) + old.white_noise_covariance + np.diag(varies)
        )
        if directions:
            free = np.array(directions).T
            moved = moved - free @ (pseudo_inverse(free.T @ weight @ free) @ (free.T @ weight @ moved))
        return float(fitted.residual @ fitted.residual) + float(moved @ weight @ moved)

    def overdispersion(self, taken: Hypotheses) -> float:
        """Return by how much more than white residuals would the estimates vary, things being known to have changed.

        The median over the parameters; a change that is not in the model makes residuals vary more than they do.
        """
        beside = self.comparison_given(taken)
        varies, _ = beside.repeat_variance()
        weight, ratios = (
            pseudo_inverse(beside.old.white_noise_covariance + beside.new.white_noise_covariance + np.diag(varies)),
            [],
        )
        for one in beside.test_all():
            if (direction := one.hypothesis.direction) is not None:
                ratios.append(one.error**2 * float(direction @ weight @ direction))
        return max(float(np.median(ratios)), 1.0) if ratios else 1.0
