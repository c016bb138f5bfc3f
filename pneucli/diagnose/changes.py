"""The changes between two sets of recordings, named: found by linear tests, told apart by refits.

That something changed is found by :class:`pneucli.diagnose.change.Comparison`, whose chances are for all hypotheses
together. What it is is asked of the few that stand out: each is fitted to the new recordings in full, everything else
is held to what it was, and the one with the least cost is named. Those that cost no more, within what chance does, are
its twins.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, norm

from pneucli.diagnose.change import ALARM_RATE, UNEXPLAINED, Comparison, Hypothesis, Tested
from pneucli.diagnose.reference import Reference
from pneucli.identify.effects import fit_added
from pneucli.identify.fit import Fit
from pneucli.identify.least_squares import inverse
from pneucli.identify.parameters import null_value
from pneucli.identify.views import View
from pneucli.physics.declaration import Effect
from pneucli.simulate.model import Model

Array = NDArray[np.float64]

CANDIDATES = 6  # hypotheses of different names that are refitted
TWIN = 0.05  # of the likelihood of all that were refitted: one with less can be told from the first
AKAIKE = 2.0  # what a further parameter must take off the cost


@dataclass(frozen=True)
class Change:
    """One thing that changed, by the name of its parameter; ``effect`` where it belongs to one.

    ``ci95`` is of ``after``. ``confidence``: one less the chance that a healthy repeat seems so changed in anything;
    ``alone``: of this one, where it has ``twins``, other names that explain the change as well.
    """

    name: str
    effect: str | None
    before: float | None
    after: float | None
    unit: str
    ci95: tuple[float, float] | None
    confidence: float
    alone: float
    twins: tuple[str, ...] = ()


@dataclass(frozen=True)
class Limit:
    """The size of a change of a parameter from which it would have been named; ``plausible``: within a typical one."""

    name: str
    size: float
    unit: str
    plausible: bool


@dataclass(frozen=True)
class Changes:
    """What changed, the strongest first, and what could not have been seen; ``p_value`` that nothing did."""

    changes: tuple[Change, ...]
    limits: tuple[Limit, ...]
    p_value: float


@dataclass(frozen=True)
class Explained:
    """One hypothesis fitted in full: what it costs with all else as it was, and its parameters' estimates."""

    hypothesis: Hypothesis
    cost: float
    fit: Fit | None = None


def named_changes(
    old: Reference,
    new: Reference,
    found: Fit,
    views: Sequence[View],
    effects: Mapping[str, Effect],
    alarm_rate: float = ALARM_RATE,
) -> Changes:
    """Return what differs between ``old`` and the fit ``found`` of new recordings, whose reference is ``new``.

    ``alarm_rate`` is the chance that anything is named where nothing changed.
    """
    comparison = Comparison(old, new)
    tested = comparison.tested()
    level, family = comparison.level(), len(tested) + 1
    p_value = min(1.0, family * min(t.p_value for t in [*tested, level]))
    limits = tuple(_limits(tested, new, effects, found.model, alarm_rate / family))
    if p_value > alarm_rate:
        return Changes((), limits, p_value)
    explained = _explained(comparison, tested, found, views, effects)
    spread = _spread(comparison, tested)
    best = min(explained, key=lambda e: _judged(e, spread))
    nothing = _cost(found, old, None)
    worth = (nothing - best.cost) / spread
    if worth < chi2.isf(alarm_rate / family, _count(best)) or not np.isfinite(worth):
        return Changes((_unexplained(level, 1.0 - p_value),), limits, p_value)
    first = _change(comparison, best, explained, effects, spread, 1.0 - p_value)
    further = _further(comparison, best, alarm_rate / family, family) if best.fit is None else []
    return Changes((first, *further), limits, p_value)


def _explained(
    comparison: Comparison,
    tested: Sequence[Tested],
    found: Fit,
    views: Sequence[View],
    effects: Mapping[str, Effect],
) -> list[Explained]:
    """Return the hypotheses that stand out, one of each name, with what they cost."""
    first = {t.hypothesis.name: t for t in reversed(tested)}
    out = []
    for one in sorted(first.values(), key=lambda t: -abs(t.ratio))[:CANDIDATES]:
        hypothesis = one.hypothesis
        if hypothesis.start is None:
            out.append(Explained(hypothesis, _cost(found, comparison.old, hypothesis.direction)))
        else:
            refitted = fit_added(found, views, effects[hypothesis.name])
            out.append(Explained(hypothesis, _cost(refitted, comparison.old, None), refitted))
    return out


def _cost(fitted: Fit, old: Reference, direction: Array | None) -> float:
    """Return the cost of a fit, its estimates held to what they were, but for a direction in which they may move."""
    bread = inverse(fitted.jacobian.T @ fitted.jacobian)
    mine = [[f.name for f in fitted.free].index(c.name) for c in old.coordinates]
    scale = np.array([1.0 if f.logarithmic else f.scale for f in (fitted.free[i] for i in mine)])
    values = [fitted[c.name].value for c in old.coordinates]
    places = [np.log(v) if c.logarithmic else v for v, c in zip(values, old.coordinates, strict=True)]
    moved = np.array(places) - old.places
    weight = inverse(bread[np.ix_(mine, mine)] * np.outer(scale, scale) + old.working)
    if direction is not None:
        size = float(direction @ weight @ moved) / float(direction @ weight @ direction)
        moved = moved - size * direction
    return float(fitted.residual @ fitted.residual) + float(moved @ weight @ moved)


def _count(one: Explained) -> int:
    """Return how many parameters a hypothesis lets free."""
    return 1 if one.fit is None else sum(f.name.startswith(f"{one.hypothesis.name}.") for f in one.fit.free)


def _judged(one: Explained, spread: float) -> float:
    return one.cost + AKAIKE * spread * _count(one)


def _spread(comparison: Comparison, tested: Sequence[Tested]) -> float:
    """Return by how much more than white residuals would the estimates vary: the median over the parameters."""
    ratios = []
    for one in tested:
        if (direction := one.hypothesis.direction) is not None:
            weight = inverse(comparison.old.working + comparison.new.working)
            ratios.append(one.error**2 * float(direction @ weight @ direction))
    return max(float(np.median(ratios)), 1.0) if ratios else 1.0


def _unexplained(level: Tested, confidence: float) -> Change:
    """Return that the residual has changed, in units of noise, and nothing that is known accounts for it."""
    edge = norm.ppf(0.975) * level.error
    after, low, high = (float(np.exp(0.5 * (level.size + e))) for e in (0.0, -edge, edge))
    return Change(UNEXPLAINED, None, 1.0, after, "1", (low, high), confidence, confidence)


def _change(
    comparison: Comparison,
    best: Explained,
    explained: Sequence[Explained],
    effects: Mapping[str, Effect],
    spread: float,
    confidence: float,
) -> Change:
    likely = np.array([np.exp(-0.5 * (_judged(e, spread) - _judged(best, spread)) / spread) for e in explained])
    shares = likely / likely.sum()
    twins = tuple(e.hypothesis.name for e, s in zip(explained, shares, strict=True) if e is not best and s >= TWIN)
    share = float(shares[explained.index(best)])
    if best.fit is None:
        return _moved(comparison, best.hypothesis, confidence, share * confidence, twins)
    effect = effects[best.hypothesis.name]
    leading = next((p for p in effect.parameters if p.null is not None), effect.parameters[0])
    estimate = best.fit[f"{effect.name}.{leading.name}"]
    before = null_value(leading, best.fit.model)
    return Change(
        estimate.name,
        effect.name,
        before,
        estimate.value,
        estimate.unit,
        estimate.ci95,
        confidence,
        share * confidence,
        twins,
    )


def _moved(
    comparison: Comparison, hypothesis: Hypothesis, confidence: float, alone: float, twins: tuple[str, ...] = ()
) -> Change:
    """Return the change of a parameter, or of all areas of a valve by one factor, all else being as it was."""
    tested = comparison.test(hypothesis)
    assert tested is not None
    assert hypothesis.direction is not None
    (places,) = np.nonzero(hypothesis.direction)
    one = comparison.old.coordinates[places[0]]
    place, before, unit = (one.place, one.value, one.unit) if places.size == 1 else (0.0, 1.0, "1")
    edge = norm.ppf(0.975) * tested.error
    ends = [place + tested.size + e for e in (0.0, -edge, edge)]
    after, low, high = (float(np.exp(e)) if one.logarithmic else float(e) for e in ends)
    known, _, _ = hypothesis.name.partition(".")
    effect = None if known in {"friction", "rig", "valve", "valve_2"} else known
    return Change(hypothesis.name, effect, before, after, unit, (low, high), confidence, alone, twins)


def _further(comparison: Comparison, best: Explained, p_value: float, family: int) -> list[Change]:
    """Return what else of the model's parameters changed, the first one being let free."""
    beside = comparison.because(best.hypothesis)
    tested = [t for t in beside.tested() if t.hypothesis.start is None and t.hypothesis.name != best.hypothesis.name]
    if not tested or tested[0].p_value > p_value:
        return []
    sure = 1.0 - family * tested[0].p_value
    return [_moved(beside, tested[0].hypothesis, sure, sure)]


def _limits(
    tested: Sequence[Tested], new: Reference, effects: Mapping[str, Effect], model: Model, p_value: float
) -> list[Limit]:
    """Return for each name the least size that would have been named, those first that could not have been seen."""
    found: dict[str, Limit] = {}
    for one in sorted(tested, key=lambda t: t.error):
        hypothesis, least = one.hypothesis, one.least(p_value)
        if hypothesis.name in found:
            continue
        if hypothesis.direction is not None:
            coordinate = new.coordinates[int(np.flatnonzero(hypothesis.direction)[0])]
            single = np.count_nonzero(hypothesis.direction) == 1
            size = coordinate.value * np.expm1(least) if coordinate.logarithmic and single else least
            unit = coordinate.unit if single else "1"
            found[hypothesis.name] = Limit(hypothesis.name, float(size), unit, bool(size < abs(coordinate.value)))
        elif hypothesis.start is not None:
            found[hypothesis.name] = _limit(effects[hypothesis.name], new, hypothesis.start, model, least)
    return sorted(found.values(), key=lambda limit: limit.plausible)


def _limit(effect: Effect, new: Reference, start: int, model: Model, least: float) -> Limit:
    leading = next((p for p in effect.parameters if p.null is not None), effect.parameters[0])
    name = f"{effect.name}.{leading.name}"
    value, null = new.starts[start].values[name], null_value(leading, model)
    size = abs(value - null) * least if null is not None else value
    return Limit(name, float(size), leading.unit, bool(least < 1.0))
