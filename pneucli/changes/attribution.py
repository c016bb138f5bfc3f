"""Attribution of the changes between two sets of recordings: detected by linear tests, attributed by refits.

:class:`pneucli.changes.comparison.Comparison` detects that something changed, with a p value for all hypotheses
together. The most significant hypotheses are then fitted to the new recordings in full, with everything else held at
its old value. The one with the lowest cost is named; those with about the same cost are its equivalents.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pneucli.changes.baseline import Baseline
from pneucli.changes.comparison import ALARM_RATE, UNEXPLAINED, Comparison, HypothesisTest
from pneucli.changes.repeatability import NO_DRIFT, Repeatability
from pneucli.changes.selection import ChangeSelection, Hypotheses
from pneucli.figure import Figure
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.parameters import null_value
from pneucli.identify.residuals import ResidualModel
from pneucli.messages.diagnose import Change, DetectableChange
from pneucli.physics.declaration import Effect
from pneucli.quantities import Z95
from pneucli.simulate.model import Model

MIN_EQUIVALENT_SHARE = 0.05  # of the likelihood of all refits; one with less is distinguishable from the first


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
    leading = next((p for p in effect.parameters if p.null is not None), effect.parameters[0])
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
    leading = next((p for p in effect.parameters if p.null is not None), effect.parameters[0])
    name = f"{effect.name}.{leading.name}"
    value, null = new.typical_effects[start].values[name], null_value(leading, model)
    size = abs(value - null) * min_size if null is not None else value
    return DetectableChange(name, float(size), leading.unit, bool(min_size < 1.0))
