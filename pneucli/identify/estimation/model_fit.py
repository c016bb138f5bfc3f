"""Fit the base model and its effects to recordings: from where to start, which residuals to run, when to start again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pneucli.errors import InputError
from pneucli.identify.estimation.fit import FULL_CONVERGENCE, Fit, StoppingRule, fit, merge_partial_fit
from pneucli.identify.estimation.parameters import (
    DIFFERENCE_STEP,
    FreeParameter,
    base_parameters,
    effect_parameters,
)
from pneucli.identify.estimation.score_test import ScoreTest, residual_changes, scaled_initial_guess, score_tests
from pneucli.identify.guesses.friction_and_valve import guess_overlap
from pneucli.identify.residuals import ResidualModel
from pneucli.physics.declaration import Effect
from pneucli.physics.scales import RigQuantities
from pneucli.simulate.model import Model, parameter_value, with_effect, with_parameters
from pneucli.simulate.rig_quantities import rig_quantities
from pneucli.simulate.valve_forms.area import ValveArea

Array = NDArray[np.float64]

MAX_EDGE_STARTS = 4
TIME_SCAN_POINTS = 32  # values of a time, from the least typical one to its bound


def fit_model(
    model: Model,
    views: Sequence[ResidualModel],
    effects: Sequence[Effect],
    *,
    stopping: StoppingRule = FULL_CONVERGENCE,
) -> Fit:
    """Fit the base model, then with each effect in turn from its best start, all parameters together.

    Raises InputError where the recordings lack the part of an effect, or the model has no finite numbers for them.
    """
    for effect in effects:
        if not any(view.is_sensitive_to(effect) for view in views):
            lacking = f'"{effect.name}" acts on a part that no training recording has ({effect.part})'
            raise InputError("key model.effects", lacking, "effects that can show", "remove it, or record its part")
    require_finite(model, views)
    experiments = [v.experiment for v in views]
    found = fit(replace(model, effects=()), views, base_parameters(model, experiments), stopping=stopping)
    found = _with_overlap_reestimated(found, views, stopping=stopping)
    for effect in effects:
        found = fit_with_effect(found, views, effect, stopping=stopping)
    return found


def require_finite(model: Model, views: Sequence[ResidualModel]) -> None:
    """Raise InputError where a first guess of the model cannot be held against a recording at all."""
    for view in views:
        for channel, residual in view.residual(replace(model, effects=())).items():
            if not np.isfinite(residual).all():
                found = f"with the rig as stated the model has no finite {channel} for {view.experiment.recording.name}"
                wanted = "volumes, areas, pressures and commands that belong to one rig"
                raise InputError("[rig] and [signals]", found, wanted, "see what pneucli ingest finds implausible")


def fit_with_effect(
    found: Fit,
    views: Sequence[ResidualModel],
    effect: Effect,
    *,
    stopping: StoppingRule = FULL_CONVERGENCE,
    ranked: Sequence[ScoreTest] | None = None,
) -> Fit:
    """Refit with one more effect, from its best signatures (``score_tests``, where they are known already)."""
    model, facts = found.model, rig_quantities(found.model, [v.experiment for v in views])
    ranked = score_tests(effect, found, views) if ranked is None else ranked
    if not ranked:
        raise effect.missing_scale_error(facts)

    chosen, names = _affected_residual_models(found, views, effect)
    felt = [view for view, mine in zip(views, chosen, strict=True) if mine]

    def ended(started: Model) -> Fit:
        free = free_parameters(started, views)
        free = [f for f in free if f.name in names or f.name.startswith(f"{effect.name}.")]
        part = _fit_coarse_to_fine(started, felt, free, stopping=stopping)
        return merge_partial_fit(found, _with_overlap_reestimated(part, felt, stopping=stopping), views, chosen)

    def refitted(signature: ScoreTest, share: float) -> Fit:
        return ended(with_effect(model, effect, scaled_initial_guess(effect, signature, model, facts, share)))

    if any(p.step for p in effect.parameters):  # an edge sees no further than its neighbourhood
        return min((refitted(s, 1.0) for s in ranked[:MAX_EDGE_STARTS]), key=lambda f: f.cost)
    first = refitted(ranked[0], 1.0)
    if first.cost > found.cost:  # the promised step led astray: from nearly nothing
        first = refitted(ranked[0], 0.05)
    other = lower_profile_minimum(first, views, effect, facts)
    return first if other is None else min(first, ended(first.model.with_values(other)), key=lambda f: f.cost)


def lower_profile_minimum(
    found: Fit, views: Sequence[ResidualModel], effect: Effect, facts: RigQuantities
) -> dict[str, float] | None:
    """Return the value of an effect that is one time at which its profile is lowest, None where that is where it is.

    A residual over a shift in time is like a correlation: it has more minima than one, and a fit ends in the nearest.
    The profile is the cost over that time, all other parameters adjusting as their derivatives tell.
    """
    if [(p.unit, p.null) for p in effect.parameters] != [("s", 0.0)]:
        return None
    (time,) = effect.parameters
    name, size = f"{effect.name}.{time.name}", time.range_on(facts)
    values = [{name: float(t)} for t in np.geomspace(min(size.typical), size.upper, TIME_SCAN_POINTS)]
    others = replace(found, jacobian=found.jacobian[:, [f.name != name for f in found.free]])
    profile = [
        _sum_of_squares(others.project_out_nuisance(found.residual + change))
        for change in residual_changes(effect, found, views, values)
    ]
    lowest = int(np.argmin(profile))
    return values[lowest] if profile[lowest] < _sum_of_squares(others.projected_residual) else None


def _sum_of_squares(residual: Array) -> float:
    return float(residual @ residual)


def _affected_residual_models(
    found: Fit, views: Sequence[ResidualModel], effect: Effect
) -> tuple[NDArray[np.bool_], set[str]]:
    """Return which views a fit with the effect can change (views,), and the names of the parameters they share."""
    sizes = [view.experiment.time.size * len(view.channels) for view in views]
    parts = np.split(found.jacobian, np.cumsum(sizes)[:-1])
    reach = np.array([part.any(axis=0) for part in parts]).T  # (parameters, views)
    chosen = np.array([view.is_sensitive_to(effect) for view in views])
    while True:
        sharing: NDArray[np.bool_] = np.any(reach[:, chosen], axis=1)
        wider = chosen | reach[sharing].any(axis=0)
        if np.array_equal(wider, chosen):
            return chosen, {f.name for f, mine in zip(found.free, sharing, strict=True) if mine}
        chosen = wider


def _fit_coarse_to_fine(
    model: Model, views: Sequence[ResidualModel], free: Sequence[FreeParameter], *, stopping: StoppingRule
) -> Fit:
    """Fit; where there are edges, in which a residual is not smooth, with ever smaller differences."""
    edged = any(f.step > DIFFERENCE_STEP for f in free)
    for coarse in (12.0, 4.0) if edged else ():
        wide = [replace(f, step=coarse * f.step) if f.step > DIFFERENCE_STEP else f for f in free]
        model = fit(model, views, wide, stopping=stopping).model
        free = _with_current_values(model, free)
    return fit(model, views, free, stopping=stopping)


def _with_current_values(model: Model, free: Sequence[FreeParameter]) -> list[FreeParameter]:
    return [replace(f, start=parameter_value(model, f.name)) for f in free]


def _with_overlap_reestimated(found: Fit, views: Sequence[ResidualModel], *, stopping: StoppingRule) -> Fit:
    """Return the fit, or a better one from overlaps guessed anew where one ended at its upper bound.

    There the valve opens all at once at its smallest knot, and the fit does not come back by itself. The overlap of the
    other direction, which shares the null command, is guessed anew with it.
    """
    at_bound = [e.name for e in found.estimates if ".overlap_" in e.name and e.at_bound and e.value > 0.0]
    stuck = {name.partition(".")[0] for name in at_bound}
    guessed = {}
    for valve in (v for v in found.model.valves if isinstance(v, ValveArea) and v.label in stuck):
        for sign, name in ((1.0, f"{valve.label}.overlap_fill"), (-1.0, f"{valve.label}.overlap_vent")):
            side = sorted((sign * c, a) for c, a in zip(valve.commands, valve.areas, strict=True) if sign * c > 0.0)
            if side:
                guessed[name] = guess_overlap(*np.array(side).T)
    if not guessed:
        return found
    model = with_parameters(found.model, guessed)
    again = _fit_coarse_to_fine(model, views, _with_current_values(model, found.free), stopping=stopping)
    return min(found, again, key=lambda f: f.cost)


def free_parameters(model: Model, views: Sequence[ResidualModel]) -> list[FreeParameter]:
    """Return all free parameters of a model, base and effects, starting from its values."""
    experiments = [v.experiment for v in views]
    free, facts = base_parameters(model, experiments), rig_quantities(model, experiments)
    for effect in model.effects:
        if any(view.is_sensitive_to(effect) for view in views):
            free += effect_parameters(effect, model, facts)
    return free


def refit(found: Fit, views: Sequence[ResidualModel], *, stopping: StoppingRule = FULL_CONVERGENCE) -> Fit:
    """Fit on from where a fit ended."""
    free = free_parameters(found.model, views)
    return fit(found.model, views, free, stopping=stopping, initial_jacobian=_rescaled_jacobian(found, free))


def _rescaled_jacobian(found: Fit, free: Sequence[FreeParameter]) -> Array | None:
    """Return a fit's derivatives (N, k) in the coordinates of free parameters, None where these are others.

    The coordinate of a parameter is counted in its distance from its null at the start, which a fit moves.
    """
    if [f.name for f in free] != [f.name for f in found.free]:
        return None
    values = [parameter_value(found.model, f.name) for f in free]
    scale = [new.derivative(v) / old.derivative(v) for new, old, v in zip(free, found.free, values, strict=True)]
    return np.asarray(found.jacobian * scale)


def fit_without(
    found: Fit, views: Sequence[ResidualModel], effect: Effect, *, stopping: StoppingRule = FULL_CONVERGENCE
) -> Fit:
    """Refit without one of the model's effects."""
    model = replace(found.model, effects=tuple(e for e in found.model.effects if e.name != effect.name))
    return _fit_coarse_to_fine(model, views, free_parameters(model, views), stopping=stopping)
