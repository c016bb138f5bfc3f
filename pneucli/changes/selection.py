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

from pneucli.changes.baseline import reference_at
from pneucli.changes.comparison import Comparison, Hypothesis, Tested
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.least_squares import inverse
from pneucli.identify.estimation.model_fit import fit_added, signatures
from pneucli.identify.residuals import View
from pneucli.physics.declaration import Effect

Array = NDArray[np.float64]
Taken = tuple[Hypothesis, ...]

CANDIDATES = 6  # hypotheses of different names that are refitted in one round
AKAIKE = 2.0  # what a further parameter must take off the cost
MOST = 3  # changes at once
SWAPS = 2  # rounds in which each is held against others in its place


@dataclass(frozen=True)
class Explained:
    """Things that changed, fitted in full: what they cost with all else as it was, and how many parameters are free."""

    cost: float
    count: int
    fit: Fit


@dataclass
class Naming:
    """What may have changed in a ``comparison``, and the ``found`` fit of the old model to the new recordings.

    ``p_value``: the chance below which one test of the family tells.
    """

    comparison: Comparison
    found: Fit
    views: Sequence[View]
    effects: Mapping[str, Effect]
    p_value: float
    _fits: dict[tuple[str, ...], Fit | None] = field(default_factory=dict)
    _beside: dict[tuple[str, ...], Comparison] = field(default_factory=dict)

    def chosen(self) -> Taken:
        """Return what changed, what explains most first; nothing where nothing known is worth its parameters."""
        taken: Taken = ()
        while len(taken) < MOST and (more := self._further(taken)):
            taken = more
        for _ in range(SWAPS if len(taken) > 1 else 0):
            swapped = self._swapped(taken)
            if swapped == taken:
                break
            taken = swapped
        return self._needed(taken)

    def _further(self, taken: Taken) -> Taken:
        """Return one thing more, where the data call for it and it is worth its parameters; else nothing."""
        tested = self.beside(taken).tested()
        if taken and (not tested or tested[0].p_value > self.p_value):
            return ()
        options = [(*taken, one) for one in self._candidates(taken)]
        best = self._best(options) if options else ()
        return best if best and self._worth(taken, best) else ()

    def _best(self, options: Sequence[Taken]) -> Taken:
        """Return what costs least, with what each parameter must take off, by what the residuals then vary by."""
        spread = self.spread(min(options, key=lambda one: self.explained(one).cost))
        return min(options, key=lambda one: self._judged(one, spread))

    def _worth(self, less: Taken, more: Taken) -> bool:
        before, after = self.explained(less), self.explained(more)
        gain = (before.cost - after.cost) / self.spread(more)
        return bool(np.isfinite(gain) and gain > chi2.isf(self.p_value, max(after.count - before.count, 1)))

    def _candidates(self, taken: Taken) -> list[Hypothesis]:
        """Return the hypotheses that stand out beside those taken, one of each name."""
        names = {one.name for one in taken}
        first = {t.hypothesis.name: t for t in reversed(self.beside(taken).tested())}
        ranked = sorted(first.values(), key=lambda t: -abs(t.ratio))
        found = [t.hypothesis for t in ranked if t.hypothesis.name not in names][:CANDIDATES]
        here, first_of = self.beside(taken).old.starts, self.comparison.old.starts
        return [h if h.start is None else replace(h, start=first_of.index(here[h.start])) for h in found]

    def test(self, taken: Taken, one: Hypothesis) -> Tested | None:
        """Return what the data say of one hypothesis beside things that are known to have changed."""
        beside = self.beside(taken)
        if one.start is None:
            return beside.test(one)
        start = self.comparison.old.starts[one.start]
        known = start in beside.old.starts
        return beside.test(replace(one, start=beside.old.starts.index(start))) if known else None

    def beside(self, taken: Taken) -> Comparison:
        """Return the comparison in which things are known to have changed; their effects are in the fitted model."""
        effects = {one.name: one for one in taken if one.start is not None}
        key = tuple(sorted(effects))
        if key not in self._beside:
            self._beside[key] = self._with(tuple(effects.values()))
        return self._beside[key].because(*(one for one in taken if one.start is None))

    def _with(self, effects: Taken) -> Comparison:
        fitted = self._fitted(tuple(one.name for one in effects))
        if not effects or fitted is None:
            return self.comparison
        old, names = self.comparison.old, {one.name for one in effects}
        for one in effects:
            assert one.start is not None
            old = old.beside(one.start)
        lacking = [e for name, e in self.effects.items() if name not in names]
        new = reference_at(fitted, self.views, lacking, old.starts)
        kept = [s for s in old.starts if s.effect not in names]
        coordinates = [c.name for c in old.coordinates]
        first, k = self.comparison.old.starts, len(coordinates)
        called = self.comparison.names
        called = (*called[:k], *(called[k + first.index(s)] for s in kept)) if called else ()
        return replace(self.comparison, old=old.only(coordinates, kept), new=new.only(coordinates, kept), names=called)

    def _swapped(self, taken: Taken) -> Taken:
        """Return the things with each replaced by what explains more in its place, the others staying."""
        for i in range(len(taken)):
            taken = self._best(self._in_place(taken, i))
        return taken

    def _in_place(self, taken: Taken, place: int) -> list[Taken]:
        """Return what was taken, first as it is, then with others in one place."""
        rest = self.without(taken, place)
        others = [one for one in self._candidates(rest) if one.name != taken[place].name]
        return [taken, *((*taken[:place], one, *taken[place + 1 :]) for one in others)]

    def _needed(self, taken: Taken) -> Taken:
        """Return the things without those that the others make needless."""
        while len(taken) > 1:
            needless = [i for i in range(len(taken)) if not self._worth(self.without(taken, i), taken)]
            if not needless:
                break
            taken = self._best([self.without(taken, i) for i in needless])
        return taken

    @staticmethod
    def without(taken: Taken, place: int) -> Taken:
        """Return all but one."""
        return (*taken[:place], *taken[place + 1 :])

    def shares(self, taken: Taken, place: int) -> dict[str, float]:
        """Return how likely each is in one place, by name: what was taken, and what stands out beside the others."""
        options = self._in_place(taken, place)
        spread = self.spread(taken)
        costs = np.array([self._judged(one, spread) for one in options])
        likely = np.exp(-0.5 * (costs - costs.min()) / spread)
        return {one[place].name: float(p) for one, p in zip(options, likely / likely.sum(), strict=True)}

    def explained(self, taken: Taken) -> Explained:
        """Return what things that changed together cost."""
        fitted = self._fitted(tuple(one.name for one in taken if one.start is not None))
        if fitted is None:
            return Explained(np.inf, len(taken), self.found)
        directions = [one.direction for one in taken if one.direction is not None]
        extra = sum(f.name.partition(".")[0] in {o.name for o in taken if o.start is not None} for f in fitted.free)
        return Explained(self._cost(fitted, directions), len(directions) + extra, fitted)

    def _judged(self, taken: Taken, spread: float) -> float:
        one = self.explained(taken)
        return one.cost + AKAIKE * spread * one.count

    def _fitted(self, names: tuple[str, ...]) -> Fit | None:
        """Return the fit with these effects more, in whatever order they come; None where one has no size there."""
        key = tuple(sorted(names))
        if not names:
            return self.found
        if key not in self._fits:
            before, effect = self._fitted(names[:-1]), self.effects[names[-1]]
            ranked = signatures(effect, before, self.views) if before is not None else []
            fitted = fit_added(before, self.views, effect, ranked=ranked) if before is not None and ranked else None
            self._fits[key] = fitted
        return self._fits[key]

    def _cost(self, fitted: Fit, directions: Sequence[Array]) -> float:
        """Return the cost of a fit, its estimates held to what they were, but for directions in which they may move."""
        old = self.comparison.old
        bread = inverse(fitted.jacobian.T @ fitted.jacobian)
        mine = [[f.name for f in fitted.free].index(c.name) for c in old.coordinates]
        scale = np.array([1.0 if f.logarithmic else f.scale for f in (fitted.free[i] for i in mine)])
        values = [fitted[c.name].value for c in old.coordinates]
        places = [np.log(v) if c.logarithmic else v for v, c in zip(values, old.coordinates, strict=True)]
        moved = np.array(places) - old.places
        varies, _ = self.comparison.varies()
        weight = inverse(bread[np.ix_(mine, mine)] * np.outer(scale, scale) + old.working + np.diag(varies))
        if directions:
            free = np.array(directions).T
            moved = moved - free @ (inverse(free.T @ weight @ free) @ (free.T @ weight @ moved))
        return float(fitted.residual @ fitted.residual) + float(moved @ weight @ moved)

    def spread(self, taken: Taken) -> float:
        """Return by how much more than white residuals would the estimates vary, things being known to have changed.

        The median over the parameters; a change that is not in the model makes residuals vary more than they do.
        """
        beside = self.beside(taken)
        varies, _ = beside.varies()
        weight, ratios = inverse(beside.old.working + beside.new.working + np.diag(varies)), []
        for one in beside.tested():
            if (direction := one.hypothesis.direction) is not None:
                ratios.append(one.error**2 * float(direction @ weight @ direction))
        return max(float(np.median(ratios)), 1.0) if ratios else 1.0
