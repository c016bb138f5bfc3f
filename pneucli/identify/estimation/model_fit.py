"""Where to start fitting an effect: a cheap score of its typical values, base parameters projected out, no refit."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from pneucli.errors import InputError
from pneucli.identify.estimation.fit import FULL_CONVERGENCE, Fit, StoppingRule, fit, merge_partial_fit
from pneucli.identify.estimation.parameters import (
    DIFFERENCE_STEP,
    FreeParameter,
    base_parameters,
    effect_parameters,
    null_value,
    parameter_value,
    with_parameters,
)
from pneucli.identify.estimation.problem import LeastSquaresProblem
from pneucli.identify.guesses.friction_and_valve import guess_overlap
from pneucli.identify.residuals import ResidualModel
from pneucli.physics.declaration import Effect
from pneucli.physics.scales import RigQuantities
from pneucli.recording import ParameterPrior
from pneucli.simulate.model import Model
from pneucli.simulate.rig_quantities import rig_quantities
from pneucli.simulate.valve_forms.area import ValveArea

Array = NDArray[np.float64]

MAX_EDGE_STARTS = 4
TIME_SCAN_POINTS = 32  # values of a time, from the least typical one to its bound


@dataclass(frozen=True)
class ScoreTest:
    """What switching an effect on at some values promises.

    ``gain`` is the fall of the cost (squared) by a linear ``step`` along what it changes in the residuals, base
    parameters adjusting; ``step_error`` is the step's standard error, from the scores of blocks.
    """

    values: dict[str, float]
    gain: float
    step: float
    step_error: float


def initial_guesses(
    effect: Effect, facts: RigQuantities, priors: Mapping[str, ParameterPrior] = MappingProxyType({})
) -> list[dict[str, float]]:
    """Return every combination of typical values by EFFECT.PARAMETER, from and to in order; none where not known.

    What the pipeline file says of a parameter takes the place of its typical values.
    """
    names = [f"{effect.name}.{p.name}" for p in effect.parameters]
    lists = [
        _typical_values(p.range_on(facts).typical, priors.get(name))
        for p, name in zip(effect.parameters, names, strict=True)
    ]
    combinations = [dict(zip(names, values, strict=True)) for values in itertools.product(*lists)]
    stretch = (f"{effect.name}.from", f"{effect.name}.to")
    return [c for c in combinations if stretch[0] not in c or c[stretch[0]] < c[stretch[1]]]


def _typical_values(typical: tuple[float, ...], known: ParameterPrior | None) -> tuple[float, ...]:
    if known is None:
        return typical
    stated = known.start if known.fixed is None else known.fixed
    values = typical if stated is None else (stated,)
    return tuple(dict.fromkeys(float(np.clip(value, known.lower, known.upper)) for value in values))


def with_effect(model: Model, effect: Effect, values: dict[str, float]) -> Model:
    """Return the model with the effect switched on at values."""
    others = tuple(e for e in model.effects if e.name != effect.name)
    return replace(model.with_values(values), effects=(*others, effect))


def residual_changes(
    effect: Effect, found: Fit, views: Sequence[ResidualModel], starts: Sequence[dict[str, float]]
) -> Iterator[Array]:
    """Yield what each set of the effect's values changes in the residuals (N,); only the views that feel it are run."""
    felt = [i for i, view in enumerate(views) if view.is_sensitive_to(effect)]
    sizes = [view.experiment.time.size * len(view.channels) for view in views]
    nominal = np.split(found.residual, np.cumsum(sizes)[:-1])
    problem = LeastSquaresProblem(
        found.model, [views[i] for i in felt], (), [found.initial_state_sensitivities[i] for i in felt]
    )
    for values in starts if felt else ():
        part = problem.data_residuals(with_effect(found.model, effect, values))
        parts = [np.zeros(n) for n in sizes]
        for i, residual in zip(felt, part, strict=True):
            parts[i] = residual - nominal[i]
        yield np.concatenate(parts)


def score_tests(effect: Effect, found: Fit, views: Sequence[ResidualModel]) -> list[ScoreTest]:
    """Return the effect's signatures at its typical values, best first."""
    typical = initial_guesses(
        effect, rig_quantities(found.model, [v.experiment for v in views]), found.model.rig.priors
    )
    out = [
        _score_test(values, change, found, nested=effect.nested)
        for values, change in zip(typical, residual_changes(effect, found, views, typical), strict=False)
    ]
    return sorted(out, key=lambda s: -s.gain)


def _score_test(values: dict[str, float], change: Array, found: Fit, *, nested: bool) -> ScoreTest:
    target, new = found.projected_residual, found.project_out_nuisance(change)
    power = float(new @ new)
    if not np.isfinite(power) or power < 1e-12 * max(float(change @ change), 1e-30):
        return ScoreTest(values, 0.0, 0.0, np.inf)
    error = float(np.linalg.norm(np.bincount(found.blocks, weights=new * target))) / power
    if not nested:  # it cannot be switched on by degrees
        return ScoreTest(values, float(target @ target - (target + new) @ (target + new)), 1.0, error)
    step = -float(new @ target) / power
    return ScoreTest(values, step * step * power, step, error)


def scaled_initial_guess(
    effect: Effect, test: ScoreTest, model: Model, facts: RigQuantities, step_share: float = 1.0
) -> dict[str, float]:
    """Return the signature's values, those with a null moved by a share of the promised step (within 0.05 to 5)."""
    step = step_share * float(np.clip(test.step, 0.05, 5.0))
    values = dict(test.values)
    for p in effect.parameters:
        name = f"{effect.name}.{p.name}"
        if (null := null_value(p, model)) is not None:  # steps between the typical values, no further
            size = p.range_on(facts)
            values[name] = float(np.clip(null + step * (values[name] - null), size.lower, size.upper))
    return values


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
    found = _with_overlap_reestimated(found, views, effort=stopping)
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
        part = _fit_coarse_to_fine(started, felt, free, effort=stopping)
        return merge_partial_fit(found, _with_overlap_reestimated(part, felt, effort=stopping), views, chosen)

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
    model: Model, views: Sequence[ResidualModel], free: Sequence[FreeParameter], *, effort: StoppingRule
) -> Fit:
    """Fit; where there are edges, in which a residual is not smooth, with ever smaller differences."""
    edged = any(f.step > DIFFERENCE_STEP for f in free)
    for coarse in (12.0, 4.0) if edged else ():
        wide = [replace(f, step=coarse * f.step) if f.step > DIFFERENCE_STEP else f for f in free]
        model = fit(model, views, wide, stopping=effort).model
        free = _with_current_values(model, free)
    return fit(model, views, free, stopping=effort)


def _with_current_values(model: Model, free: Sequence[FreeParameter]) -> list[FreeParameter]:
    return [replace(f, start=parameter_value(model, f.name)) for f in free]


def _with_overlap_reestimated(found: Fit, views: Sequence[ResidualModel], *, effort: StoppingRule) -> Fit:
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
    again = _fit_coarse_to_fine(model, views, _with_current_values(model, found.free), effort=effort)
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
    return _fit_coarse_to_fine(model, views, free_parameters(model, views), effort=stopping)
