"""Fit the base model and its effects: start values, affected residual models, and restarts."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.errors import InputError
from pneucli.identify.estimation.blocks import copy_nonzero, residual_counts, residual_slices
from pneucli.identify.estimation.fit import (
    FULL_CONVERGENCE,
    NO_ITERATION,
    Fit,
    Start,
    StoppingRule,
    fit,
    merge_partial_fit,
)
from pneucli.identify.estimation.parameters import (
    DIFFERENCE_STEP,
    FreeParameter,
    base_parameters,
    effect_parameters,
)
from pneucli.identify.estimation.score_test import (
    ScoreTest,
    direct_base_friction,
    direct_guesses,
    residual_changes,
    scaled_initial_guess,
    score_tests,
)
from pneucli.identify.guesses.valve_areas import guess_overlap
from pneucli.identify.residuals import ResidualModel
from pneucli.physics.declaration import Effect, Parameter, consists_of_times
from pneucli.physics.scales import RigQuantities
from pneucli.simulate.model import Model, parameter_value, with_effect, with_parameters, without_effect
from pneucli.simulate.rig_quantities import rig_quantities
from pneucli.simulate.valve_forms import ValveArea

TIME_SCAN_POINTS = 33  # values of a time constant or delay, from its smallest typical value to its bound
SCAN_STRIDE = 2  # every second value is tried, then those beside the best one: minima are far wider than a step


def lower_profile_minimum(
    fitted: Fit, residual_models: Sequence[ResidualModel], effect: Effect, quantities: RigQuantities
) -> dict[str, float] | None:
    """Search the profile of a delay or time constant for a lower minimum.

    The residual over a shift in time behaves like a correlation: it has several minima, and a fit ends in the
    nearest one. The profile is the cost over that time, all other parameters adjusting to first order.

    Args:
        fitted: The fit with the effect.
        residual_models: The residual models it was fitted to.
        effect: The effect; only one with a single time of null 0 s is searched.
        quantities: The quantities that scale the effect's range.

    Returns:
        The value of the parameter with a lower cost than the fit's; None where there is none.

    """
    if len(effect.main_parameters) != 1 or not consists_of_times(effect):
        return None
    (time,) = effect.main_parameters
    name, size = f"{effect.name}.{time.name}", time.range_on(quantities)
    times = np.geomspace(min(size.typical), size.upper, TIME_SCAN_POINTS)
    inverse = fitted.inverse_hessian_holding(np.array([f.name == name for f in fitted.free], dtype=bool))
    gradient = fitted.jacobian.T @ fitted.residual

    def adjusted_cost(change: Array) -> float:
        """Return the squares that remain of changed residuals where the other parameters adjust; of a diverging model
        infinitely many.
        """
        residual, slope = fitted.residual + change, gradient + fitted.transposed_product(change)
        cost = float(residual @ residual - slope @ inverse @ slope)
        return cost if math.isfinite(cost) else math.inf

    def scan(places: Sequence[int]) -> dict[int, float]:
        values = [{name: float(times[i])} for i in places]
        changes = residual_changes(effect, fitted, residual_models, values)
        return {i: adjusted_cost(change) for i, change in zip(places, changes, strict=True)}

    profile = scan(range(0, TIME_SCAN_POINTS, SCAN_STRIDE))
    best = min(profile, key=profile.__getitem__)
    profile |= scan([i for i in (best - 1, best + 1) if 0 <= i < TIME_SCAN_POINTS])
    best = min(profile, key=profile.__getitem__)
    lower = profile[best] < adjusted_cost(np.zeros_like(fitted.residual))
    return {name: float(times[best])} if lower else None


@dataclass(frozen=True)
class Similar:
    """A fit of a similar model to more residual models, whose derivatives a fit may start from."""

    fitted: Fit
    residual_models: Sequence[ResidualModel]

    def start(
        self, free: Sequence[FreeParameter], residual_models: Sequence[ResidualModel], own: Collection[str] = ()
    ) -> Start:
        """Return the derivatives in the coordinates of free parameters; those by others, and by ``own``, are missing.

        The coordinate of a parameter is its distance from the null at the start, which a fit changes.
        """
        places = {id(one): i for i, one in enumerate(self.residual_models)}
        chosen = [places[id(one)] for one in residual_models]
        all_rows, rows = residual_slices(self.residual_models), residual_slices(residual_models)
        columns = {f.name: j for j, f in enumerate(self.fitted.free)}

        def write(out: Array) -> None:
            for target, f in zip(out.T, free, strict=True):
                if f.name in columns and f.name not in own:
                    j, value = columns[f.name], parameter_value(self.fitted.model, f.name)
                    factor = f.derivative(value) / self.fitted.free[j].derivative(value)
                    copy_nonzero(self.fitted.jacobian[:, j], [all_rows[i] for i in chosen], target, rows, factor)

        missing = tuple(j for j, f in enumerate(free) if f.name not in columns or f.name in own)
        return Start(write, [self.fitted.initial_state_sensitivities[i] for i in chosen], is_exact=False, own=missing)


MAX_EDGE_STARTS = 4  # best starts of an effect with an edge: its residual is not smooth, so a fit ends near its start
DRAFT_TOLERANCE = 5e-3  # of the cost: as exactly as starts are compared
REFINEMENT_SIGMA = 4.0  # standard errors from its null, beyond which a parameter that refines an effect is fitted
MIN_REFINEMENT_SHARE = 0.02  # of the cost that it must take: as much as matters where little more than noise is left


def fit_model(
    model: Model,
    residual_models: Sequence[ResidualModel],
    effects: Sequence[Effect],
    *,
    stopping: StoppingRule = FULL_CONVERGENCE,
) -> Fit:
    """Fit the base model, then add each effect from its best start and refit all parameters.

    Args:
        model: The model to start from, see :func:`pneucli.identify.guesses.base_model.guess_base_model`.
        residual_models: The residual models whose squares are summed.
        effects: The effects to add, in this order.
        stopping: When each fit stops.

    Returns:
        The fit.

    Raises:
        InputError: The recordings do not contain the part of an effect, or the model has no finite output for them.

    """
    for effect in effects:
        if not any(one.is_sensitive_to(effect) for one in residual_models):
            raise _cannot_show(effect, residual_models)
    require_finite(replace(model, effects=()), residual_models)
    experiments = [one.experiment for one in residual_models]
    loops = [effect for effect in effects if effect.part == "pressure valve"]
    first = NO_ITERATION if loops else stopping  # without its loop such a valve would be fitted as hardly open
    fitted = fit(replace(model, effects=()), residual_models, base_parameters(model, experiments), stopping=first)
    fitted = _with_overlap_reestimated(fitted, residual_models, stopping=first)
    fitted = _with_friction_reestimated(fitted, residual_models, stopping=first)
    for effect in [*loops, *(one for one in effects if one not in loops)]:
        fitted = fit_with_effect(fitted, residual_models, effect, stopping=stopping)
    require_finite(fitted.model, residual_models)
    return fitted


def _cannot_show(effect: Effect, residual_models: Sequence[ResidualModel]) -> InputError:
    """Return what to say of an effect that no training recording can show."""
    wanted, stands = "effects that can show", any(effect.part in one.experiment.parts for one in residual_models)
    if effect.needs and stands:
        fault = f'"{effect.name}" needs {", ".join(sorted(effect.needs))}, which no training recording has'
        return InputError("key model.effects", fault, wanted, "remove it, or record what it needs", code="E064")
    if stands:
        fault = f'"{effect.name}" changes nothing that can be told from the readings of the training recordings'
        return InputError("key model.effects", fault, wanted, "remove it, or record the pressures", code="E064")
    fault = f'"{effect.name}" acts on a part that no training recording has ({effect.part})'
    return InputError("key model.effects", fault, wanted, "remove it, or record its part", code="E064")


def require_finite(model: Model, residual_models: Sequence[ResidualModel]) -> None:
    """Check that a model gives finite residuals.

    Args:
        model: The model.
        residual_models: The residual models to evaluate.

    Raises:
        InputError: A residual is not finite.

    """
    for residual_model in residual_models:
        name = residual_model.experiment.recording.name
        for channel, residual in residual_model.residual(model).items():
            if not np.isfinite(residual).all():
                fault = f"with the rig as stated the model has no finite {channel} for {name}"
                wanted = "volumes, areas, pressures and commands that belong to one rig"
                raise InputError(
                    "[rig] and [signals]", fault, wanted, "see what pneucli ingest finds implausible", code="E065"
                )


def fit_with_effect(
    fitted: Fit,
    residual_models: Sequence[ResidualModel],
    effect: Effect,
    *,
    stopping: StoppingRule = FULL_CONVERGENCE,
    ranked: Sequence[ScoreTest] | None = None,
) -> Fit:
    """Add one effect to a fitted model, from its best starts, and refit the parameters that it can change.

    Args:
        fitted: The fit without the effect.
        residual_models: The residual models it was fitted to.
        effect: The effect to add.
        stopping: When the fit stops.
        ranked: The effect's score tests, best first, where they were computed before.

    Returns:
        The fit with the effect, over all residual models.

    Raises:
        InputError: The effect has no typical size on this rig.

    """
    model, quantities = fitted.model, rig_quantities(fitted.model, [one.experiment for one in residual_models])
    ranked = score_tests(effect, fitted, residual_models) if ranked is None else ranked
    if not ranked:
        raise effect.missing_scale_error(quantities)

    chosen, names = _affected_residual_models(fitted, residual_models, effect)
    affected = [one for one, is_affected in zip(residual_models, chosen, strict=True) if is_affected]
    # else derivatives are cheap, and friction is not smooth; an effect of the valve gives every area another opening
    has_similar = any(one.is_simulated for one in affected) and effect.part != "valve"
    similar = Similar(fitted, residual_models) if has_similar else None
    has_edge = any(p.step for p in effect.parameters)  # a fit of an edge ends near its start
    drafting = stopping if has_edge or not has_similar else _draft_of(stopping)

    free_in = partial(_free_parameters_of, effect, names, residual_models)

    def draft_from(start: Model) -> Fit:
        free = free_in(start)
        part = _fit_coarse_to_fine(start, affected, free, stopping=drafting, similar=similar, is_draft=has_similar)
        return _with_overlap_reestimated(part, affected, stopping=drafting, is_draft=has_similar)

    def draft_from_test(test: ScoreTest, share: float = 1.0) -> Fit:
        return draft_from(with_effect(model, effect, scaled_initial_guess(effect, test, model, quantities, share)))

    def completed(part: Fit) -> Fit:
        if has_similar:
            start, free = part.model, _with_current_values(part.model, part.free)
            del part  # its derivatives, before there are others
            part = fit(start, affected, free, stopping=stopping)
        return merge_partial_fit(fitted, part, residual_models, chosen)

    if has_edge:
        return completed(_cheapest(map(draft_from_test, ranked[:MAX_EDGE_STARTS])))
    draft = _cheapest(draft_from_test(t) for t in ranked if t is ranked[0] or (t.direct and t.gain > 0.0))
    first = completed(_cheapest([draft, *map(draft_from, _with_direct_friction(draft.model, effect, affected))]))
    if first.cost > fitted.cost:  # the predicted step was too long: start close to the null
        first = completed(draft_from_test(ranked[0], 0.05))
    for narrower in _with_narrower_overlaps(first.model, effect):  # by the play that was found
        first = _cheapest([first, completed(draft_from(narrower))])
    profile_minimum = lower_profile_minimum(first, residual_models, effect, quantities)
    if profile_minimum is not None:
        first = _cheapest([first, completed(draft_from(first.model.with_values(profile_minimum)))])
    refined = _refined_drafts(
        first, residual_models, chosen, effect, lambda start: fit(start, affected, free_in(start), stopping=drafting)
    )
    return _cheapest([first, *map(completed, refined)])


def _cheapest(fits: Iterable[Fit]) -> Fit:
    return min(fits, key=lambda f: f.cost)


def _free_parameters_of(
    effect: Effect, names: Collection[str], residual_models: Sequence[ResidualModel], start: Model
) -> list[FreeParameter]:
    """Return the free parameters of an effect and those of other ``names``."""
    free = free_parameters(start, residual_models)
    return [f for f in free if f.name in names or f.name.startswith(f"{effect.name}.")]


def _draft_of(stopping: StoppingRule) -> StoppingRule:
    return StoppingRule(stopping.max_iterations, max(stopping.tolerance, DRAFT_TOLERANCE))


def _with_direct_friction(model: Model, effect: Effect, residual_models: Sequence[ResidualModel]) -> Iterator[Model]:
    """Yield starts with the friction of the balance of forces where a law of the model ended beside its usual values.

    Without bristles a break-away looks different: the law of the sliding piston may then describe another part of the
    curve, with a velocity at its bound, and a fit that adds them does not return by itself.
    """
    facts = rig_quantities(model, [one.experiment for one in residual_models])
    unusual = (law for law in model.effects if law.name != effect.name and _is_unusual(model, law, facts))
    for law in islice(unusual, 1):  # the direct values are those of all laws
        yield from (with_parameters(model, v) for v in direct_guesses(law, model, residual_models))


def _is_unusual(model: Model, law: Effect, facts: RigQuantities) -> bool:
    """Whether a law of friction that samples give directly has a parameter without a null beside its typical values."""
    direct = [p for p in law.parameters if p.direct and p.null is None] if law.part == "cylinder" else []
    usual = {p.name: p.range_on(facts).typical for p in direct}
    values = {name: parameter_value(model, f"{law.name}.{name}") for name in usual}
    return any(own and not min(own) <= values[name] <= max(own) for name, own in usual.items())


def _with_narrower_overlaps(start: Model, effect: Effect) -> Iterator[Model]:
    """Yield a start whose overlaps do not contain a play of the effect, which the model without it took for overlap.

    With both, a small command opens nothing, whatever the overlap, and a fit stays there.
    """
    play = sum(start.values[f"{effect.name}.{p.name}"] for p in effect.parameters if p.widens_overlap)
    overlaps = {n: v for valve in start.valves for n, (v, unit) in valve.parameters().items() if unit == "V"}
    if play and overlaps:
        yield with_parameters(start, {name: max(value - play, 0.0) for name, value in overlaps.items()})


def _refined_drafts(
    fitted: Fit,
    residual_models: Sequence[ResidualModel],
    chosen: NDArray[np.bool_],
    effect: Effect,
    fit_from: Callable[[Model], Fit],
) -> Iterator[Fit]:
    """Yield fits with one more of the effect's parameters that refine it, where it shows.

    One shows that is far from the value that it has otherwise, and takes a share of the cost that matters. ``chosen``
    are the residual models whose residuals ``fit_from`` fits.
    """
    counts = np.array(residual_counts(residual_models))
    quantities = rig_quantities(fitted.model, [one.experiment for one in residual_models])
    recorded = [m.experiment.recording.signals.keys() for m, one in zip(residual_models, chosen, strict=True) if one]
    for p in (p for p in effect.parameters if any(p.needs <= signals for signals in recorded)):
        if not (starts := _refined_starts(fitted, effect, p, quantities)):
            continue
        limit = (1.0 - MIN_REFINEMENT_SHARE) * float(np.sum(fitted.residual[np.repeat(chosen, counts)] ** 2))
        if limit < counts[chosen].sum():  # hardly more than noise is left
            continue
        draft = _cheapest(map(fit_from, starts))
        estimate, unrefined = draft[f"{effect.name}.{p.name}"], p.value_unrefined or 0.0
        differs = abs(estimate.value - unrefined) > REFINEMENT_SIGMA * estimate.error and not estimate.at_bound
        if differs and draft.cost < limit:
            yield draft


def _refined_starts(fitted: Fit, effect: Effect, parameter: Parameter, quantities: RigQuantities) -> list[Model]:
    """Return where the search for a parameter that refines an effect starts; nowhere where it is fitted or stated.

    It starts at the value that the parameter has otherwise. Where that is no value of the search, the effect is another
    law with the parameter, in which its size may be larger: it starts at no less than the smallest typical one.
    """
    name, model, unrefined = f"{effect.name}.{parameter.name}", fitted.model, parameter.value_unrefined
    if unrefined is None or parameter.stated or name in {*model.values, *model.rig.priors}:
        return []
    size = parameter.range_on(quantities)
    if size.lower <= unrefined:
        return [model.with_values({name: unrefined})]
    main = {f"{effect.name}.{p.name}": p.range_on(quantities).typical for p in effect.main_parameters}
    least = {n: max(model.values[n], min(typical)) for n, typical in main.items() if typical}
    return [model.with_values({**least, name: typical}) for typical in size.typical]


def _affected_residual_models(
    fitted: Fit, residual_models: Sequence[ResidualModel], effect: Effect
) -> tuple[NDArray[np.bool_], set[str]]:
    """Return which residual models a fit with the effect can change, and the names of their shared parameters."""
    parts = np.split(fitted.jacobian, np.cumsum(residual_counts(residual_models))[:-1])
    affects = np.array([part.any(axis=0) for part in parts]).T  # (parameters, views)
    chosen = np.array([residual_model.is_sensitive_to(effect) for residual_model in residual_models])
    while True:
        is_shared: NDArray[np.bool_] = np.any(affects[:, chosen], axis=1)
        wider = chosen | affects[is_shared].any(axis=0)
        if np.array_equal(wider, chosen):
            return chosen, {f.name for f, is_affected in zip(fitted.free, is_shared, strict=True) if is_affected}
        chosen = wider


def _fit_coarse_to_fine(
    model: Model,
    residual_models: Sequence[ResidualModel],
    free: Sequence[FreeParameter],
    *,
    stopping: StoppingRule,
    similar: Similar | None = None,
    own: Collection[str] = (),
    is_draft: bool = False,
) -> Fit:
    """Fit; where a parameter has an edge, at which a residual is not smooth, with decreasing difference steps.

    The derivatives at the start are those of a ``similar`` fit, but for parameters that it lacks and the ``own`` ones.
    """
    edges = [f.name for f in free if f.step > DIFFERENCE_STEP]
    for factor in (12.0, 4.0) if edges else ():
        coarse = [replace(f, step=factor * f.step) if f.step > DIFFERENCE_STEP else f for f in free]
        start = similar.start(coarse, residual_models, own) if similar else None
        found = fit(model, residual_models, coarse, stopping=stopping, start=start, is_draft=similar is not None)
        model, own = found.model, edges
        similar = Similar(found, residual_models) if similar else None
        free = _with_current_values(model, free)
    start = similar.start(free, residual_models, own) if similar else None
    return fit(model, residual_models, free, stopping=stopping, start=start, is_draft=is_draft)


def _with_current_values(model: Model, free: Sequence[FreeParameter]) -> list[FreeParameter]:
    return [replace(f, start=parameter_value(model, f.name)) for f in free]


def _with_overlap_reestimated(
    fitted: Fit, residual_models: Sequence[ResidualModel], *, stopping: StoppingRule, is_draft: bool = False
) -> Fit:
    """Return the fit, or a better one with new overlaps where an overlap ended at its upper bound.

    At that bound the valve opens completely at its smallest knot, and the fit does not return by itself. The overlap of
    the other direction, which shares the null command, is guessed again with it.
    """
    at_bound = [e.name for e in fitted.estimates if ".overlap_" in e.name and e.at_bound and e.value > 0.0]
    valves = {name.partition(".")[0] for name in at_bound}
    overlaps = {}
    for valve in (one for one in fitted.model.valves if isinstance(one, ValveArea) and one.label in valves):
        for sign, name in ((1.0, f"{valve.label}.overlap_fill"), (-1.0, f"{valve.label}.overlap_vent")):
            side = sorted((sign * c, a) for c, a in zip(valve.commands, valve.areas, strict=True) if sign * c > 0.0)
            if side:
                overlaps[name] = guess_overlap(*np.array(side).T)
    if not overlaps:
        return fitted
    model = with_parameters(fitted.model, overlaps)
    free, similar = _with_current_values(model, fitted.free), Similar(fitted, residual_models)
    refitted = _fit_coarse_to_fine(
        model, residual_models, free, stopping=stopping, similar=similar, own=overlaps, is_draft=is_draft
    )
    return _cheapest([fitted, refitted])


def _with_friction_reestimated(fitted: Fit, residual_models: Sequence[ResidualModel], *, stopping: StoppingRule) -> Fit:
    """Return the fit, or a better one from the balance of forces where it ended without Coulomb friction."""
    if not any(e.name == "friction.coulomb" and e.at_bound and e.value == 0.0 for e in fitted.estimates):
        return fitted
    starts = [with_parameters(fitted.model, v) for v in direct_base_friction(fitted.model, residual_models)]
    again = [fit(one, residual_models, _with_current_values(one, fitted.free), stopping=stopping) for one in starts]
    return _cheapest([fitted, *again])


def free_parameters(model: Model, residual_models: Sequence[ResidualModel]) -> list[FreeParameter]:
    """List all free parameters of a model, of its base and of its effects, with the model's values as start values.

    Args:
        model: The model.
        residual_models: The residual models of the fit; an effect that affects none of them has no free parameter.

    Returns:
        The free parameters.

    """
    experiments = [one.experiment for one in residual_models]
    free, quantities = base_parameters(model, experiments), rig_quantities(model, experiments)
    for effect in model.effects:
        if any(one.is_sensitive_to(effect) for one in residual_models):
            free += effect_parameters(effect, model, quantities)
    return free


def refit(fitted: Fit, residual_models: Sequence[ResidualModel], *, stopping: StoppingRule = FULL_CONVERGENCE) -> Fit:
    """Continue a fit from its end.

    Args:
        fitted: The fit.
        residual_models: The residual models it was fitted to.
        stopping: When the fit stops.

    Returns:
        The continued fit.

    """
    free = free_parameters(fitted.model, residual_models)
    start = Similar(fitted, residual_models).start(free, residual_models)
    is_same = not start.own and len(free) == len(fitted.free)
    return fit(
        fitted.model, residual_models, free, stopping=stopping, start=replace(start, is_exact=True) if is_same else None
    )


def fit_without(
    fitted: Fit, residual_models: Sequence[ResidualModel], effect: Effect, *, stopping: StoppingRule = FULL_CONVERGENCE
) -> Fit:
    """Remove one effect from a fitted model and refit.

    Args:
        fitted: The fit.
        residual_models: The residual models it was fitted to.
        effect: The effect to remove.
        stopping: When the fit stops.

    Returns:
        The fit without the effect.

    """
    model = without_effect(fitted.model, effect.name)
    free = free_parameters(model, residual_models)
    similar = Similar(fitted, residual_models) if any(one.is_simulated for one in residual_models) else None
    return _fit_coarse_to_fine(model, residual_models, free, stopping=stopping, similar=similar)
