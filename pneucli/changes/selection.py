"""Name the changes between two sets of recordings: significant hypotheses are fitted to the new ones in full.

Everything else is held at its old value. Changes are added one after another while the data require more. Then each is
compared with alternatives in its place, and those that the others make needless are dropped, as in the selection of
missing effects. What costs about as much is named as an equivalent.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pneucli.arrays import Array
from pneucli.changes.baseline import Baseline, baseline_at_fit
from pneucli.changes.comparison import (
    ALARM_RATE,
    NO_DRIFT,
    UNEXPLAINED,
    Comparison,
    Hypothesis,
    HypothesisTest,
    Repeatability,
)
from pneucli.distributions import chi_square_upper_quantile
from pneucli.figure import Figure
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.least_squares import pseudo_inverse
from pneucli.identify.estimation.model_fit import fit_with_effect
from pneucli.identify.estimation.parameters import null_value
from pneucli.identify.estimation.score_test import score_tests
from pneucli.identify.residuals import ResidualModel
from pneucli.messages.changes import Change, DetectableChange
from pneucli.physics.declaration import Effect
from pneucli.quantities import Z95
from pneucli.simulate.model import Model

MIN_EQUIVALENT_SHARE = 0.05  # of the likelihood of all refits; one with less is distinguishable from the first
Hypotheses = tuple[Hypothesis, ...]

MAX_CANDIDATES = 6  # hypotheses in one round
AKAIKE_PENALTY = 2.0  # on the cost, for each parameter
MAX_CHANGES = 3  # in one comparison
MAX_SWAP_ROUNDS = 2  # rounds of alternatives


@dataclass(frozen=True)
class RefitCost:
    """The cost of changes fitted in full, everything else held constant, and the number of free parameters."""

    cost: float
    parameter_count: int
    fit: Fit


@dataclass
class ChangeSelection:
    """The selection in a ``comparison``, with the ``fitted`` fit of the old model to the new recordings.

    ``significance_level``: that of a single test of the family.
    """

    comparison: Comparison
    fitted: Fit
    residual_models: Sequence[ResidualModel]
    effects: Mapping[str, Effect]
    significance_level: float
    _fits: dict[tuple[str, ...], Fit | None] = field(default_factory=dict)
    _comparisons: dict[tuple[str, ...], Comparison] = field(default_factory=dict)

    def select(self) -> Hypotheses:
        """Return the changes, the largest first; nothing where no hypothesis is worth its parameters."""
        selected: Hypotheses = ()
        while len(selected) < MAX_CHANGES and (extended := self._add_one(selected)):
            selected = extended
        for _ in range(MAX_SWAP_ROUNDS if len(selected) > 1 else 0):
            swapped = self._swap_each(selected)
            if swapped == selected:
                break
            selected = swapped
        return self._drop_needless(selected)

    def _add_one(self, selected: Hypotheses) -> Hypotheses:
        """Return the changes with one more, where the data require it and it is worth its parameters; else nothing."""
        tested = self.comparison_given(selected).test_all()
        if selected and (not tested or tested[0].p_value > self.significance_level):
            return ()
        options = [(*selected, one) for one in self._candidates(selected)]
        best = self._best(options) if options else ()
        return best if best and self._gain_is_significant(selected, best) else ()

    def _best(self, options: Sequence[Hypotheses]) -> Hypotheses:
        """Return the option with the lowest cost, penalised by its number of parameters times the overdispersion."""
        dispersion = self.overdispersion(min(options, key=lambda one: self.refit_cost(one).cost))
        return min(options, key=lambda one: self._penalised_cost(one, dispersion))

    def _gain_is_significant(self, reduced: Hypotheses, extended: Hypotheses) -> bool:
        before, after = self.refit_cost(reduced), self.refit_cost(extended)
        gain = (before.cost - after.cost) / self.overdispersion(extended)
        added = max(after.parameter_count - before.parameter_count, 1)
        return bool(np.isfinite(gain) and gain > chi_square_upper_quantile(self.significance_level, added))

    def _candidates(self, selected: Hypotheses) -> list[Hypothesis]:
        """Return the most significant hypotheses given the selected ones, one of each name."""
        names = {one.name for one in selected}
        first = {t.hypothesis.name: t for t in reversed(self.comparison_given(selected).test_all())}
        ranked = sorted(first.values(), key=lambda t: -abs(t.t_statistic))
        hypotheses = [t.hypothesis for t in ranked if t.hypothesis.name not in names][:MAX_CANDIDATES]
        current, original = self.comparison_given(selected).old.typical_effects, self.comparison.old.typical_effects
        return [
            h if h.effect_index is None else replace(h, effect_index=original.index(current[h.effect_index]))
            for h in hypotheses
        ]

    def test(self, selected: Hypotheses, one: Hypothesis) -> HypothesisTest | None:
        """Return the test of one hypothesis given accepted changes."""
        comparison = self.comparison_given(selected)
        if one.effect_index is None:
            return comparison.test(one)
        typical = self.comparison.old.typical_effects[one.effect_index]
        is_tested = typical in comparison.old.typical_effects
        return (
            comparison.test(replace(one, effect_index=comparison.old.typical_effects.index(typical)))
            if is_tested
            else None
        )

    def comparison_given(self, selected: Hypotheses) -> Comparison:
        """Return the comparison with accepted changes; their effects are in the fitted model."""
        effects = {one.name: one for one in selected if one.effect_index is not None}
        key = tuple(sorted(effects))
        if key not in self._comparisons:
            self._comparisons[key] = self._comparison_with_effects(tuple(effects.values()))
        return self._comparisons[key].with_accepted(*(one for one in selected if one.effect_index is None))

    def _comparison_with_effects(self, effects: Hypotheses) -> Comparison:
        fitted = self._fitted(tuple(one.name for one in effects))
        if not effects or fitted is None:
            return self.comparison
        old, names = self.comparison.old, {one.name for one in effects}
        for one in effects:
            assert one.effect_index is not None
            old = old.with_effect_free(one.effect_index)
        absent = [e for name, e in self.effects.items() if name not in names]
        new = baseline_at_fit(fitted, self.residual_models, absent, old.typical_effects)
        remaining = [s for s in old.typical_effects if s.effect not in names]
        coordinates = [c.name for c in old.coordinates]
        first, k = self.comparison.old.typical_effects, len(coordinates)
        quantity_names = self.comparison.names
        quantity_names = (
            (*quantity_names[:k], *(quantity_names[k + first.index(s)] for s in remaining)) if quantity_names else ()
        )
        return replace(
            self.comparison,
            old=old.restricted_to(coordinates, remaining),
            new=new.restricted_to(coordinates, remaining),
            names=quantity_names,
        )

    def _swap_each(self, selected: Hypotheses) -> Hypotheses:
        """Return the changes, each replaced by the best alternative in its place."""
        for i in range(len(selected)):
            selected = self._best(self._alternatives(selected, i))
        return selected

    def _alternatives(self, selected: Hypotheses, position: int) -> list[Hypotheses]:
        """Return the selected changes, first as they are, then with alternatives in one position."""
        rest = self.without(selected, position)
        others = [one for one in self._candidates(rest) if one.name != selected[position].name]
        return [selected, *((*selected[:position], one, *selected[position + 1 :]) for one in others)]

    def _drop_needless(self, selected: Hypotheses) -> Hypotheses:
        """Return the changes without those that the others make needless."""
        while len(selected) > 1:
            needless = [
                i for i in range(len(selected)) if not self._gain_is_significant(self.without(selected, i), selected)
            ]
            if not needless:
                break
            selected = self._best([self.without(selected, i) for i in needless])
        return selected

    @staticmethod
    def without(selected: Hypotheses, position: int) -> Hypotheses:
        """Return all changes but one."""
        return (*selected[:position], *selected[position + 1 :])

    def likelihood_shares(self, selected: Hypotheses, position: int) -> dict[str, float]:
        """Return by name the likelihood share of the selected change and its alternatives in one position."""
        options = self._alternatives(selected, position)
        dispersion = self.overdispersion(selected)
        costs = np.array([self._penalised_cost(one, dispersion) for one in options])
        likelihood = np.exp(-0.5 * (costs - costs.min()) / dispersion)
        return {one[position].name: float(p) for one, p in zip(options, likelihood / likelihood.sum(), strict=True)}

    def refit_cost(self, selected: Hypotheses) -> RefitCost:
        """Return the cost of changes together."""
        fitted = self._fitted(tuple(one.name for one in selected if one.effect_index is not None))
        if fitted is None:
            return RefitCost(np.inf, len(selected), self.fitted)
        directions = [one.direction for one in selected if one.direction is not None]
        extra = sum(
            f.name.partition(".")[0] in {o.name for o in selected if o.effect_index is not None} for f in fitted.free
        )
        return RefitCost(self._cost(fitted, directions), len(directions) + extra, fitted)

    def _penalised_cost(self, selected: Hypotheses, dispersion: float) -> float:
        one = self.refit_cost(selected)
        return one.cost + AKAIKE_PENALTY * dispersion * one.parameter_count

    def _fitted(self, names: tuple[str, ...]) -> Fit | None:
        """Return the fit with these effects, in any order; None where one has no initial guess."""
        key = tuple(sorted(names))
        if not names:
            return self.fitted
        if key not in self._fits:
            before, effect = self._fitted(names[:-1]), self.effects[names[-1]]
            ranked = score_tests(effect, before, self.residual_models) if before is not None else []
            fitted = (
                fit_with_effect(before, self.residual_models, effect, ranked=ranked)
                if before is not None and ranked
                else None
            )
            self._fits[key] = fitted
        return self._fits[key]

    def _cost(self, fitted: Fit, directions: Sequence[Array]) -> float:
        """Return the cost of a fit whose estimates are held at their old values, except in free directions."""
        old = self.comparison.old
        inverse_hessian = fitted.inverse_hessian
        columns = [[f.name for f in fitted.free].index(c.name) for c in old.coordinates]
        scale = np.array([1.0 if f.logarithmic else f.scale for f in (fitted.free[i] for i in columns)])
        values = [fitted[c.name].value for c in old.coordinates]
        transformed = [np.log(v) if c.logarithmic else v for v, c in zip(values, old.coordinates, strict=True)]
        difference = np.array(transformed) - old.estimates
        drift_variance, _ = self.comparison.repeat_variance()
        weight = pseudo_inverse(
            inverse_hessian[np.ix_(columns, columns)] * np.outer(scale, scale)
            + old.white_noise_covariance
            + np.diag(drift_variance)
        )
        if directions:
            free = np.array(directions).T
            difference = difference - free @ (pseudo_inverse(free.T @ weight @ free) @ (free.T @ weight @ difference))
        return float(fitted.residual @ fitted.residual) + float(difference @ weight @ difference)

    def overdispersion(self, selected: Hypotheses) -> float:
        """Return the variance of the estimates over that for white residuals, given accepted changes.

        It is the median over the parameters. A change that is not modelled increases the variance of the residuals.
        """
        comparison = self.comparison_given(selected)
        drift_variance, _ = comparison.repeat_variance()
        weight, ratios = (
            pseudo_inverse(
                comparison.old.white_noise_covariance + comparison.new.white_noise_covariance + np.diag(drift_variance)
            ),
            [],
        )
        for one in comparison.test_all():
            if (direction := one.hypothesis.direction) is not None:
                ratios.append(one.error**2 * float(direction @ weight @ direction))
        return max(float(np.median(ratios)), 1.0) if ratios else 1.0


@dataclass(frozen=True)
class Changes:
    """The changes, the most significant first, and the detection limits; ``p_value`` is that of no change."""

    changes: tuple[Change, ...]
    limits: tuple[DetectableChange, ...]
    p_value: float


def attribute_changes(
    old: Baseline,
    new: Baseline,
    fitted: Fit,
    residual_models: Sequence[ResidualModel],
    effects: Mapping[str, Effect],
    alarm_rate: float = ALARM_RATE,
    repeatability: Repeatability = NO_DRIFT,
    names: Sequence[str] = (),
) -> Changes:
    """Return the changes from ``old`` to the fit ``fitted`` of new recordings, whose baseline is ``new``.

    ``alarm_rate`` is the probability of naming anything where nothing changed; ``repeatability`` is the rig's variation
    from date to date of the quantities called ``names``.
    """
    comparison = Comparison(old, new, repeatability=repeatability, names=tuple(names))
    tested = comparison.test_all()
    level, family = comparison.residual_level_test(), len(tested) + 1
    p_value = min(1.0, family * min(t.p_value for t in [*tested, level]))
    limits = tuple(_detectable_changes(tested, new, effects, fitted.model, alarm_rate / family))
    if p_value > alarm_rate:
        return Changes((), limits, p_value)
    selection = ChangeSelection(comparison, fitted, residual_models, effects, alarm_rate / family)
    selected = selection.select()
    if not selected:
        return Changes((_unexplained(level, 1.0 - p_value),), limits, p_value)
    return Changes(
        tuple(_change(selection, selected, i, p_value, family) for i in range(len(selected))), limits, p_value
    )


def _unexplained(level: HypothesisTest, confidence: float) -> Change:
    """Return a change of the residual in units of noise that no hypothesis explains."""
    half_width = Z95 * level.error
    after, low, high = (float(np.exp(0.5 * (level.size + e))) for e in (0.0, -half_width, half_width))
    return Change(UNEXPLAINED, None, 1.0, Figure(after, low, high, "1"), confidence, confidence)


def _change(selection: ChangeSelection, selected: Hypotheses, position: int, p_value: float, family: int) -> Change:
    """Return a selected change; the first is as certain as that anything changed, the others by their own tests."""
    hypothesis = selected[position]
    tested = selection.test(selection.without(selected, position), hypothesis)
    chance = p_value if position == 0 or tested is None else min(1.0, family * tested.p_value)
    shares = selection.likelihood_shares(selected, position)
    share = shares.pop(hypothesis.name)
    equivalents = tuple(name for name, other in shares.items() if other >= MIN_EQUIVALENT_SHARE)
    confidence, confidence_alone = 1.0 - chance, share * (1.0 - chance)
    if hypothesis.direction is not None:
        assert tested is not None
        return _parameter_change(selection.comparison.old, tested, confidence, confidence_alone, equivalents)
    fitted = selection.refit_cost(selected).fit
    effect = selection.effects[hypothesis.name].in_model_with(fitted.model.effects)
    leading = effect.leading_parameter
    estimate, before = fitted[f"{effect.name}.{leading.name}"], null_value(leading, fitted.model)
    return Change(estimate.name, effect.name, before, estimate.figure, confidence, confidence_alone, equivalents)


def _parameter_change(
    old: Baseline, tested: HypothesisTest, confidence: float, confidence_alone: float, equivalents: tuple[str, ...]
) -> Change:
    """Return the change of a parameter, or of all areas of a valve by one factor."""
    hypothesis = tested.hypothesis
    assert hypothesis.direction is not None
    (indices,) = np.nonzero(hypothesis.direction)
    one = old.coordinates[indices[0]]
    position, before, unit = (one.transformed, one.value, one.unit) if indices.size == 1 else (0.0, 1.0, "1")
    half_width = Z95 * tested.error
    ends = [position + tested.size + e for e in (0.0, -half_width, half_width)]
    after, low, high = (float(np.exp(e)) if one.logarithmic else float(e) for e in ends)
    group, _, _ = hypothesis.name.partition(".")
    effect = None if group in {"friction", "rig", "valve", "valve_2"} else group
    found = Figure(after, low, high, unit)
    return Change(hypothesis.name, effect, before, found, confidence, confidence_alone, equivalents)


def _detectable_changes(
    tested: Sequence[HypothesisTest], new: Baseline, effects: Mapping[str, Effect], model: Model, p_value: float
) -> list[DetectableChange]:
    """Return the minimum detectable change by name, the implausible ones first."""
    limits: dict[str, DetectableChange] = {}
    for one in sorted(tested, key=lambda t: t.error):
        hypothesis, min_size = one.hypothesis, one.minimum_detectable_size(p_value)
        if hypothesis.name in limits:
            continue
        if hypothesis.direction is not None:
            coordinate = new.coordinates[int(np.flatnonzero(hypothesis.direction)[0])]
            single = np.count_nonzero(hypothesis.direction) == 1
            size = coordinate.value * np.expm1(min_size) if coordinate.logarithmic and single else min_size
            unit = coordinate.unit if single else "1"
            limits[hypothesis.name] = DetectableChange(
                hypothesis.name, float(size), unit, bool(size < abs(coordinate.value))
            )
        elif hypothesis.effect_index is not None:
            limits[hypothesis.name] = _detectable_effect_change(
                effects[hypothesis.name], new, hypothesis.effect_index, model, min_size
            )
    return sorted(limits.values(), key=lambda limit: limit.plausible)


def _detectable_effect_change(
    effect: Effect, new: Baseline, start: int, model: Model, min_size: float
) -> DetectableChange:
    effect = effect.in_model_with(model.effects)
    leading = effect.leading_parameter
    name = f"{effect.name}.{leading.name}"
    value, null = new.typical_effects[start].values[name], null_value(leading, model)
    size = abs(value - null) * min_size if null is not None else value
    return DetectableChange(name, float(size), leading.unit, bool(min_size < 1.0))
