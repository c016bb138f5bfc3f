"""The rival models of a diagnosis: the best model, and what a likely but undecided effect would make of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.diagnose.data import RANKING_EFFORT
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.model_fit import fit_with_effect, fit_without
from pneucli.identify.estimation.parameters import null_value
from pneucli.identify.estimation.score_test import initial_guesses
from pneucli.identify.residuals import ResidualModel
from pneucli.physics.declaration import Effect
from pneucli.plan.power import leading_parameter
from pneucli.simulate.model import Model, with_effect
from pneucli.simulate.rig_quantities import rig_quantities

Array = NDArray[np.float64]

MAX_RIVALS = 8  # beside the best model
DECIDED_PROBABILITY = 0.97  # a named effect that is more probable is no longer in question
MIN_PRIOR_ODDS = 0.05  # of a fitted but refused effect: the pooled rate of refused ones is no evidence about one
NEGLIGIBLE_SHARE = 0.01  # of the size that the recordings do not exclude: a smaller fitted size is none
TYPICAL_SIZE_ERROR = 0.5  # of a size that was not fitted but taken as typical
LATE_PARTS = ("valve", "line")  # whose dynamics no rig lacks
DECIDED = ("at-bound", "below-resolution", "contradicted-by-reading")  # reasons that better recordings do not lift


@dataclass(frozen=True)
class Rival:
    """One hypothesis about the rig.

    Attributes:
        effect: The effect in question; None: the best model itself.
        present: Whether the hypothesis says that the effect is there.
        model: Its model.
        prior_odds: Its probability over that of the best model, before the plan.
        probability: The effect's probability by the diagnosis; None where it states none.
        size_error: Relative standard error of the effect's size.
        instead_of: The named effect that it replaces.
        fitted: Whether the size follows from the recordings; else it is the typical one.
    """

    effect: Effect | None
    present: bool
    model: Model
    prior_odds: float = 1.0
    probability: float | None = None
    size_error: float = TYPICAL_SIZE_ERROR
    instead_of: str | None = None
    fitted: bool = True

    @property
    def name(self) -> str:
        """Name of the hypothesis."""
        if self.effect is None:
            return "best model"
        if not self.present:
            return f"without {self.effect.name}"
        return self.effect.name if self.instead_of is None else f"{self.effect.name} in place of {self.instead_of}"


def rivals_of_diagnosis(
    best: Fit,
    train: Sequence[ResidualModel],
    answer: Mapping[str, Any],
    available: Mapping[str, Effect],
    wanted: Sequence[str] = (),
) -> list[Rival]:
    """Fit the rivals of the last diagnosis.

    Args:
        best: The fit of the model with all named effects.
        train: The residual models that it was fitted to.
        answer: The answer of ``diagnose``.
        available: The effects of the catalogue and of plugins.
        wanted: Effects in question; none: those that the diagnosis leaves undecided.

    Returns:
        The best model, then up to MAX_RIVALS others, the most probable first.
    """
    named, entries = list(answer["missing"]), {c["effect"]: c for c in answer["candidates"]}
    found: list[tuple[float, str, str, str | None]] = []  # odds, kind, effect, instead of
    for name in named:
        entry = entries[name]
        confidence = entry["confidence"]
        if confidence is not None and confidence < DECIDED_PROBABILITY:
            found.append(((1.0 - confidence) / max(confidence, 0.01), "without", name, None))
        for other in entry["indistinguishable_from"]:
            share = _odds_of_equivalent(entry, entries.get(other))
            found.append((share, "instead", other, name))
    taken = {name for _, _, name, _ in found} | set(named)
    for odds, name in refused_effects(answer["candidates"]):
        if name not in taken and name in available:
            found.append((odds, "with", name, None))
    if wanted:
        found = [(1.0, kind, name, instead) for _, kind, name, instead in found if name in wanted]
        listed = {name for _, _, name, _ in found}
        model_effects = {e.name for e in best.model.effects}
        found += [(1.0, "without" if n in model_effects else "with", n, None) for n in wanted if n not in listed]
    found = sorted(found, key=lambda one: -one[0])[:MAX_RIVALS]
    rivals = [Rival(None, True, best.model)]
    for odds, kind, name, instead in found:
        probability = entries[name]["confidence_alone"] if name in entries else None
        rivals += _rival(best, train, available[name], kind, instead, odds, probability)
    return rivals


def refused_effects(candidates: Sequence[Mapping[str, Any]]) -> list[tuple[float, str]]:
    """Return the effects that a diagnosis fitted and refused, but that better recordings may show.

    An effect that raises the error of the free run may do so beside an unknown one, and one whose fit returned nothing
    may need another motion. Those come last among effects as probable.

    Args:
        candidates: The entries ``candidates`` of the answer of ``diagnose``.

    Returns:
        Prior odds and name of each, the most probable first.
    """
    open_entries = [c for c in candidates if c["parameters"] and not c["supported"] and c["reason"] not in DECIDED]
    rows = []
    for entry in open_entries:
        probability = entry["confidence_alone"] or 0.0
        odds = max(probability / max(1.0 - probability, 0.01), MIN_PRIOR_ODDS)
        rows.append((odds, entry["reason"] == "vanishes", entry["effect"]))
    return [(odds, name) for odds, _, name in sorted(rows, key=lambda row: (-row[0], row[1]))]


def _odds_of_equivalent(entry: Mapping[str, Any], other: Mapping[str, Any] | None) -> float:
    mine, its = entry["confidence_alone"], None if other is None else other["confidence_alone"]
    return 1.0 if not mine or not its else float(np.clip(its / mine, MIN_PRIOR_ODDS, 1.0 / MIN_PRIOR_ODDS))


def _rival(
    best: Fit,
    train: Sequence[ResidualModel],
    effect: Effect,
    kind: str,
    instead: str | None,
    odds: float,
    probability: float | None,
) -> list[Rival]:
    if kind == "without":
        return [Rival(effect, False, fit_without(best, train, effect).model, odds, probability)]
    start = best
    if instead is not None:
        replaced = next(e for e in best.model.effects if e.name == instead)
        start = fit_without(best, train, replaced)
    if not any(one.is_sensitive_to(effect) for one in train):
        model = with_typical_effect(start.model, effect, train)
        return (
            [] if model is None else [Rival(effect, True, model, odds, probability, instead_of=instead, fitted=False)]
        )
    fitted = fit_with_effect(start, train, effect, stopping=RANKING_EFFORT)
    model, error = at_plausible_size(fitted, effect, typical_values(start.model, effect, train))
    known = size_is_known(fitted, effect, model)
    return [Rival(effect, True, model, odds, probability, error, instead, known)]


def size_is_known(fitted: Fit, effect: Effect, model: Model) -> bool:
    """Return whether the recordings limit the size of an effect: twice its standard error is within that of a rival.

    Args:
        fitted: The fit with the effect.
        effect: The effect.
        model: The rival, see :func:`at_plausible_size`.
    """
    for p in effect.parameters:
        null, name = null_value(p, model), f"{effect.name}.{p.name}"
        error = next((e.error for e in fitted.estimates if e.name == name), np.nan)
        if null is not None and np.isfinite(error):
            return bool(error <= TYPICAL_SIZE_ERROR * abs(model.values[name] - null) * (1.0 + 1e-9))
    return False


def at_plausible_size(fitted: Fit, effect: Effect, typical: Mapping[str, float]) -> tuple[Model, float]:
    """Return the model of a fitted effect at a size that the recordings do not exclude, and the size's relative error.

    An effect that is smaller than two standard errors may be that large: the plan has to find it then. It is not
    enlarged beyond its typical size. Where the fit returns none of it, its other parameters are typical too.

    Args:
        fitted: The fit with the effect.
        effect: The effect.
        typical: Typical values of its parameters by EFFECT.PARAMETER; empty where the rig gives it no scale.

    Returns:
        The model, and the relative standard error of the effect's size in it.
    """
    for p in effect.parameters:
        null, name = null_value(p, fitted.model), f"{effect.name}.{p.name}"
        estimate = next((e for e in fitted.estimates if e.name == name), None)
        if null is None or estimate is None:
            continue
        distance = estimate.value - null
        if distance != 0.0 and estimate.error <= TYPICAL_SIZE_ERROR * abs(distance):
            return fitted.model, float(estimate.error / abs(distance))
        usual = typical.get(name, null) - null
        size = _undetected_size(abs(distance), estimate.error, abs(usual))
        if size == 0.0:
            return fitted.model, TYPICAL_SIZE_ERROR
        vanishes = abs(distance) < NEGLIGIBLE_SHARE * size
        others = {n: v for n, v in typical.items() if n != name} if vanishes else {}
        larger = null + np.copysign(size, usual if vanishes and usual else distance)
        bounds = next(f for f in fitted.free if f.name == name)
        return fitted.model.with_values(others | {name: float(np.clip(larger, bounds.lower, bounds.upper))}), (
            TYPICAL_SIZE_ERROR
        )
    return fitted.model, TYPICAL_SIZE_ERROR


def _undetected_size(distance: float, error: float, usual: float) -> float:
    """Return the size of an effect that is within its error: two standard errors, at most the typical size."""
    larger = error / TYPICAL_SIZE_ERROR if np.isfinite(error) and error > 0.0 else np.inf
    larger = min(larger, usual) if usual > 0.0 else larger
    return max(distance, larger) if np.isfinite(larger) else distance


def with_typical_effect(model: Model, effect: Effect, train: Sequence[ResidualModel]) -> Model | None:
    """Return a model with an effect at its typical size; None where the rig gives it no scale."""
    values = typical_values(model, effect, train)
    return with_effect(model, effect, values) if values else None


def lagged_models(model: Model, effects: Iterable[Effect], train: Sequence[ResidualModel]) -> list[Model]:
    """Return a model with each lag of the flow that it lacks, at its typical size.

    These are effects of the valve and of lines whose size is a time: every spool and every hose is late.

    Args:
        model: The model.
        effects: The effects to choose from; of those with sides, the one for both.
        train: The recordings, which have to show the lag.
    """
    absent = [e for e in effects if e.side is None and e.name not in {own.name for own in model.effects}]
    late = [e for e in absent if e.part in LATE_PARTS]
    lags = [e for e in late if leading_parameter(e.in_model_with(model.effects)).unit == "s"]
    shown = [e for e in lags if e.part not in model.valve.covers and any(m.is_sensitive_to(e) for m in train)]
    return [m for e in shown if (m := with_typical_effect(model, e, train)) is not None]


def typical_values(model: Model, effect: Effect, train: Sequence[ResidualModel]) -> dict[str, float]:
    """Return typical values of an effect by EFFECT.PARAMETER; none where the rig gives it no scale."""
    quantities = rig_quantities(model, [one.experiment for one in train])
    starts = initial_guesses(effect, quantities, model.rig.priors)
    return starts[len(starts) // 2] if starts else {}
