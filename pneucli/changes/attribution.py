"""The changes between two sets of recordings, named: found by linear tests, told apart by refits.

That something changed is found by :class:`pneucli.changes.comparison.Comparison`, whose chances are for all hypotheses
together. What it is is asked of the few that stand out: each is fitted to the new recordings in full, everything else
is held to what it was, and the one with the least cost is named. Those that cost no more, within what chance does, are
its twins.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneucli.changes.baseline import Baseline
from pneucli.changes.comparison import ALARM_RATE, UNEXPLAINED, Comparison, HypothesisTest
from pneucli.changes.repeatability import NO_DRIFT, Repeatability
from pneucli.changes.selection import ChangeSelection, Hypotheses
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.parameters import null_value
from pneucli.identify.residuals import ResidualModel
from pneucli.physics.declaration import Effect
from pneucli.quantities import Z95
from pneucli.simulate.model import Model

Array = NDArray[np.float64]

CANDIDATES = 6  # hypotheses of different names that are refitted
MIN_EQUIVALENT_SHARE = 0.05  # of the likelihood of all that were refitted: one with less can be told from the first
AKAIKE = 2.0  # what a further parameter must take off the cost


@dataclass(frozen=True)
class Change:
    """One thing that changed, by the name of its parameter; ``effect`` where it belongs to one.

    ``ci95`` is of ``after``. ``confidence``: one less the chance that a healthy repeat seems so changed in anything;
    ``confidence_alone``: of this one, where it has ``equivalents``, other names that explain the change as well.
    """

    name: str
    effect: str | None
    before: float | None
    after: float | None
    unit: str
    ci95: tuple[float, float] | None
    confidence: float
    confidence_alone: float
    equivalents: tuple[str, ...] = ()


@dataclass(frozen=True)
class DetectableChange:
    """The size of a change of a parameter from which it would have been named; ``plausible``: within a typical one."""

    name: str
    size: float
    unit: str
    plausible: bool


@dataclass(frozen=True)
class Changes:
    """What changed, the strongest first, and what could not have been seen; ``p_value`` that nothing did."""

    changes: tuple[Change, ...]
    limits: tuple[DetectableChange, ...]
    p_value: float


def attribute_changes(
    old: Baseline,
    new: Baseline,
    fitted: Fit,
    views: Sequence[ResidualModel],
    effects: Mapping[str, Effect],
    alarm_rate: float = ALARM_RATE,
    repeatability: Repeatability = NO_DRIFT,
    names: Sequence[str] = (),
) -> Changes:
    """Return what differs between ``old`` and the fit ``fitted`` of new recordings, whose reference is ``new``.

    ``alarm_rate`` is the chance that anything is named where nothing changed; ``repeatability`` is what the rig varies by from
    date to date, of the quantities called by ``names``.
    """
    comparison = Comparison(old, new, repeatability=repeatability, names=tuple(names))
    tested = comparison.test_all()
    level, family = comparison.residual_level_test(), len(tested) + 1
    p_value = min(1.0, family * min(t.p_value for t in [*tested, level]))
    limits = tuple(_detectable_changes(tested, new, effects, fitted.model, alarm_rate / family))
    if p_value > alarm_rate:
        return Changes((), limits, p_value)
    naming = ChangeSelection(comparison, fitted, views, effects, alarm_rate / family)
    chosen = naming.select()
    if not chosen:
        return Changes((_unexplained(level, 1.0 - p_value),), limits, p_value)
    return Changes(tuple(_change(naming, chosen, i, p_value, family) for i in range(len(chosen))), limits, p_value)


def _unexplained(level: HypothesisTest, confidence: float) -> Change:
    """Return that the residual has changed, in units of noise, and nothing that is known accounts for it."""
    edge = Z95 * level.error
    after, low, high = (float(np.exp(0.5 * (level.size + e))) for e in (0.0, -edge, edge))
    return Change(UNEXPLAINED, None, 1.0, after, "1", (low, high), confidence, confidence)


def _change(naming: ChangeSelection, chosen: Hypotheses, place: int, p_value: float, family: int) -> Change:
    """Return one of the things that changed, the first as sure as that anything did, the others by their own tests."""
    mine = chosen[place]
    tested = naming.test(naming.without(chosen, place), mine)
    chance = p_value if place == 0 or tested is None else min(1.0, family * tested.p_value)
    shares = naming.likelihood_shares(chosen, place)
    share = shares.pop(mine.name)
    twins = tuple(name for name, other in shares.items() if other >= MIN_EQUIVALENT_SHARE)
    confidence, alone = 1.0 - chance, share * (1.0 - chance)
    if mine.direction is not None:
        assert tested is not None
        return _parameter_change(naming.comparison.old, tested, confidence, alone, twins)
    effect, fitted = naming.effects[mine.name], naming.refit_cost(chosen).fit
    leading = next((p for p in effect.parameters if p.null is not None), effect.parameters[0])
    estimate, before = fitted[f"{effect.name}.{leading.name}"], null_value(leading, fitted.model)
    known = (estimate.name, effect.name, before, estimate.value, estimate.unit, estimate.ci95)
    return Change(*known, confidence, alone, twins)


def _parameter_change(
    old: Baseline, tested: HypothesisTest, confidence: float, alone: float, twins: tuple[str, ...]
) -> Change:
    """Return the change of a parameter, or of all areas of a valve by one factor, all else being as it was."""
    hypothesis = tested.hypothesis
    assert hypothesis.direction is not None
    (places,) = np.nonzero(hypothesis.direction)
    one = old.coordinates[places[0]]
    place, before, unit = (one.place, one.value, one.unit) if places.size == 1 else (0.0, 1.0, "1")
    edge = Z95 * tested.error
    ends = [place + tested.size + e for e in (0.0, -edge, edge)]
    after, low, high = (float(np.exp(e)) if one.logarithmic else float(e) for e in ends)
    known, _, _ = hypothesis.name.partition(".")
    effect = None if known in {"friction", "rig", "valve", "valve_2"} else known
    return Change(hypothesis.name, effect, before, after, unit, (low, high), confidence, alone, twins)


def _detectable_changes(
    tested: Sequence[HypothesisTest], new: Baseline, effects: Mapping[str, Effect], model: Model, p_value: float
) -> list[DetectableChange]:
    """Return for each name the least size that would have been named, those first that could not have been seen."""
    found: dict[str, DetectableChange] = {}
    for one in sorted(tested, key=lambda t: t.error):
        hypothesis, least = one.hypothesis, one.minimum_detectable_size(p_value)
        if hypothesis.name in found:
            continue
        if hypothesis.direction is not None:
            coordinate = new.coordinates[int(np.flatnonzero(hypothesis.direction)[0])]
            single = np.count_nonzero(hypothesis.direction) == 1
            size = coordinate.value * np.expm1(least) if coordinate.logarithmic and single else least
            unit = coordinate.unit if single else "1"
            found[hypothesis.name] = DetectableChange(
                hypothesis.name, float(size), unit, bool(size < abs(coordinate.value))
            )
        elif hypothesis.effect_index is not None:
            found[hypothesis.name] = _detectable_effect_change(
                effects[hypothesis.name], new, hypothesis.effect_index, model, least
            )
    return sorted(found.values(), key=lambda limit: limit.plausible)


def _detectable_effect_change(
    effect: Effect, new: Baseline, start: int, model: Model, least: float
) -> DetectableChange:
    leading = next((p for p in effect.parameters if p.null is not None), effect.parameters[0])
    name = f"{effect.name}.{leading.name}"
    value, null = new.typical_effects[start].values[name], null_value(leading, model)
    size = abs(value - null) * least if null is not None else value
    return DetectableChange(name, float(size), leading.unit, bool(least < 1.0))
