"""The score test of an effect, its gain at typical values without a refit, and where its fit starts.

A fit starts from typical values, or from what the balance of forces or the flow into the chambers gives directly. How
late that flow follows the command is such a start, of a lag or a delay: a model without it opens its valve at the wrong
time, and the areas that are fitted to it leave nothing of the valve, so that no derivative leads back from there.

References:
    Rao, C. R., Proc. Cambridge Phil. Soc. 44 (1948) 50.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from pneucli.arrays import Array
from pneucli.caches import compiled
from pneucli.identify.estimation.blocks import residual_counts
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.objective import LeastSquaresProblem
from pneucli.identify.estimation.parameters import null_value
from pneucli.identify.guesses.base_model import PLACEHOLDER_VOLUME
from pneucli.identify.guesses.direct_friction import direct_friction, force_samples
from pneucli.identify.guesses.flow_paths import PRESSURE_SIGNALS, Chamber, FlowPathData, flow_path_data, mass_flux
from pneucli.identify.guesses.valve_areas import guess_map
from pneucli.identify.residuals import ForceBalance, ResidualModel
from pneucli.physics.declaration import Effect
from pneucli.physics.scales import RigQuantities
from pneucli.recording import ParameterPrior, Rig
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model, with_effect
from pneucli.simulate.rig_quantities import rig_quantities
from pneucli.simulate.valve_forms import MAX_OVERLAP_RATIO, ValveArea

TIMES = 24  # of the search, in equal ratios: a fit goes on from the nearest
BINS = 40  # of the opening, at equal quantiles, each with an area of its own
MAX_SAMPLES = 20_000  # of all recordings: more do not move a start
MIN_KNOTS = 3  # of each direction, fewer tell no overlap


class LateValve(NamedTuple):
    """The time in s by which a valve is late, and its areas with that time."""

    time: float
    valves: tuple[ValveArea, ...]


def after_a_lag(opening: Array, period: float, time: float) -> Array:
    """Return the opening (n,), sampled every ``period`` s, behind a first-order lag of ``time`` s.

    >>> after_a_lag(np.array([0.0, 1.0, 1.0]), 1.0, 1.0).round(3).tolist()
    [0.0, 0.632, 0.865]
    """
    return lagged(np.ascontiguousarray(opening, dtype=np.float64), math.exp(-period / time))


@compiled()
def lagged(opening: Array, remains: float) -> Array:
    """Return the opening (n,) behind a lag of which the share ``remains`` is left after a sample."""
    out = np.empty(opening.size)
    reached = opening[0]
    for k in range(opening.size):
        reached = opening[k] + remains * (reached - opening[k])
        out[k] = reached
    return out


def after_a_delay(opening: Array, period: float, time: float) -> Array:
    """Return the opening (n,), sampled every ``period`` s, ``time`` s late, to the nearest sample.

    >>> after_a_delay(np.array([0.0, 1.0, 2.0]), 1.0, 1.0).tolist()
    [0.0, 0.0, 1.0]
    """
    late = min(round(time / period), opening.size)
    return np.concatenate([np.full(late, opening[0]), opening[: opening.size - late]])


LATENESS: dict[str, Callable[[Array, float, float], Array]] = {"lag": after_a_lag, "delay": after_a_delay}


def late_valve(
    experiments: Sequence[Experiment], rig: Rig, vessel_volume: float, how: str, longest: float
) -> LateValve | None:
    """Find the time by which a valve is late: with it, areas over the opening explain the flow best.

    Args:
        experiments: The experiments.
        rig: The rig with its volumes and areas.
        vessel_volume: Volume of the vessel in m^3, for a valve test.
        how: Key of ``LATENESS``.
        longest: The longest time in s that is tried.

    Returns:
        The time, with a valve a chamber whose flow was recorded; None where no time explains more than none.
    """
    chambers: tuple[Chamber, ...] = (1, 2)
    found = {c: own for c in chambers if (own := list(flow_path_data(experiments, rig, c, vessel_volume)))}
    every = -(-sum(one.flow.size for own in found.values() for one in own) // MAX_SAMPLES)
    paths = {c: [_Path.of(one, rig, c, every) for one in own] for c, own in found.items()}
    shortest = min((one.period for own in paths.values() for one in own), default=longest)
    if longest <= shortest:
        return None

    def late(time: float) -> dict[Chamber, list[FlowPathData]]:
        return {c: [one.late(how, time) for one in own] for c, own in paths.items()}

    def unexplained(time: float) -> float:
        return sum(map(_unexplained_power, late(time).values()))

    times = np.geomspace(shortest, longest, TIMES)
    powers = [unexplained(time) for time in times]
    best = int(np.argmin(powers))
    if not powers[best] < unexplained(0.0):
        return None
    valves = [guess_map(own, "valve" if c == 1 else "valve_2") for c, own in late(times[best]).items()]
    is_known = all(min(np.sum(np.array(v.commands) * sign > 0.0) for sign in (1.0, -1.0)) >= MIN_KNOTS for v in valves)
    return LateValve(float(times[best]), tuple(valves)) if is_known else None


class _Path(NamedTuple):
    """One recording of a chamber's paths: the whole opening (n,) in V, and every so manyth sample of the rest, (k,).

    ``filling`` and ``venting`` are the mass flux in kg/(s m^2) of an opening of that sign.
    """

    data: FlowPathData
    every: int
    filling: Array
    venting: Array

    @classmethod
    def of(cls, data: FlowPathData, rig: Rig, chamber: Chamber, every: int) -> _Path:
        inputs = data.experiment.inputs[::every]
        supply, p = inputs[:, at.IN_SUPPLY], inputs[:, PRESSURE_SIGNALS[1 if data.experiment.vessel else chamber][1]]
        signs = np.ones(p.size), -np.ones(p.size)
        return cls(data, every, *(mass_flux(rig, sign, supply, p) for sign in signs))

    @property
    def period(self) -> float:
        return self.data.experiment.recording.period

    def late(self, how: str, time: float) -> FlowPathData:
        """Return the paths where the opening is late."""
        opening = self.data.opening
        opening = (LATENESS[how](opening, self.period, time) if time else opening)[:: self.every]
        flux = np.where(opening > 0.0, self.filling, self.venting)
        return replace(self.data, opening=opening, flow=self.data.flow[:: self.every], mass_flux=flux)


def _unexplained_power(paths: Sequence[FlowPathData]) -> float:
    """Return the sum of squares of the flow that an area for each bin of the opening and its sign leaves, kg^2/s^2."""
    opening, flow, flux = (
        np.concatenate([getattr(one, name) for one in paths]) for name in ("opening", "flow", "mass_flux")
    )
    edges = np.quantile(opening, np.linspace(0.0, 1.0, BINS + 1)[1:-1])
    places = 2 * np.searchsorted(edges, opening) + (opening > 0.0)
    products, powers = (np.bincount(places, flux * other, 2 * BINS) for other in (flow, flux))
    explained = np.divide(products**2, powers, out=np.zeros(2 * BINS), where=powers > 0.0)
    return float(flow @ flow - explained.sum())


def direct_guesses(effect: Effect, model: Model, views: Sequence[ResidualModel]) -> list[dict[str, float]]:
    """Return values (SI) of an effect and of all other friction, or of the valve's areas, by name.

    None where the effect declares no such parameter. What the pipeline file says of a parameter takes its place.
    """
    if not any(p.direct for p in effect.parameters):
        return []
    effects = (*(e for e in model.effects if e.name != effect.name), effect)
    facts = rig_quantities(model, [view.experiment for view in views])
    if any(p.direct in LATENESS for p in effect.parameters):
        return [_with_priors(values, model.rig.priors) for values in _late_valve(effect, model, views, facts)]
    known = _direct_friction(model, views, two_branches=any(e.is_set_valued for e in effects))
    return [_with_priors(_named(direct, effects, effect, facts), model.rig.priors) for direct in known]


def _late_valve(
    effect: Effect, model: Model, views: Sequence[ResidualModel], facts: RigQuantities
) -> list[dict[str, float]]:
    """Return a lag or delay of all valves with the areas that it leaves them; none of a single side's."""
    if effect.side is not None or not all(isinstance(valve, ValveArea) for valve in model.valves):
        return []
    (name, how, size), *_ = [(p.name, p.direct, p.range_on(facts)) for p in effect.parameters if p.direct in LATENESS]
    base = model.base_values()
    rig = replace(model.rig, dead_volume_1=base["rig.dead_volume_1"], dead_volume_2=base["rig.dead_volume_2"])
    experiments = list({id(view.experiment): view.experiment for view in views if view.is_simulated}.values())
    found = late_valve(
        experiments, rig, model.values.get("rig.vessel_volume", PLACEHOLDER_VOLUME), str(how), size.upper
    )
    if found is None:
        return []
    values = {f"{effect.name}.{name}": max(found.time, size.lower)}
    own = {valve.label: valve for valve in model.valves if isinstance(valve, ValveArea)}
    for guessed in (one for one in found.valves if one.label in own):
        values |= {name: value for name, (value, _) in _with_knots_of(own[guessed.label], guessed).parameters().items()}
    return [values]


def _with_knots_of(own: ValveArea, guessed: ValveArea) -> ValveArea:
    """Return a guessed valve with the knots of another one."""
    commands, bounds = np.array(own.commands), {}
    for sign, field in ((1.0, "overlap_fill"), (-1.0, "overlap_vent")):
        first = float(np.min(np.abs(commands[sign * commands > 0.0]), initial=np.inf))
        bounds[field] = min(getattr(guessed, field), MAX_OVERLAP_RATIO * first)
    return replace(own, areas=tuple(guessed(commands).tolist()), **bounds)


def direct_base_friction(model: Model, views: Sequence[ResidualModel]) -> list[dict[str, float]]:
    """Return Coulomb friction above zero (N) with viscous friction (N s/m), by name, from the balance of forces."""
    known = _direct_friction(model, views, two_branches=False)
    return [_with_priors(_base(direct), model.rig.priors) for direct in known if direct["coulomb"] > 0.0]


def _direct_friction(model: Model, views: Sequence[ResidualModel], *, two_branches: bool) -> list[dict[str, float]]:
    balanced = [
        view.experiment for view in views if isinstance(view, ForceBalance) and not view.experiment.p2_is_unmeasured
    ]
    mass = model.base_values()["rig.moving_mass"] + model.sum_of_port("mass")
    return direct_friction(force_samples(balanced, mass), two_branches=two_branches)


def _base(direct: Mapping[str, float]) -> dict[str, float]:
    return {f"friction.{name}": direct[name] for name in ("coulomb", "viscous")}


def _named(
    direct: Mapping[str, float], effects: Sequence[Effect], added: Effect, facts: RigQuantities
) -> dict[str, float]:
    """Return direct values by the names of parameters; of the effect to be added the others are as usual."""
    values = _base(direct)
    for effect in effects:
        for p in effect.parameters:
            size, value = p.range_on(facts), direct.get(p.direct or "")
            if value is not None:
                values[f"{effect.name}.{p.name}"] = float(np.clip(value, size.lower, size.upper))
            elif effect is added and size.typical and not p.refines:
                values[f"{effect.name}.{p.name}"] = size.typical[0]
    return values


def _with_priors(values: dict[str, float], priors: Mapping[str, ParameterPrior]) -> dict[str, float]:
    return {name: _with_prior(value, priors[name]) if name in priors else value for name, value in values.items()}


def _with_prior(value: float, prior: ParameterPrior) -> float:
    stated = prior.start if prior.fixed is None else prior.fixed
    return float(np.clip(value if stated is None else stated, prior.lower, prior.upper))


MIN_POWER_SHARE = 1e-10  # of the squares of a change: what rounding leaves of one that the free parameters reproduce


@dataclass(frozen=True)
class ScoreTest:
    """The predicted gain of an effect at given values.

    ``gain`` is the decrease of the squared cost by a linear ``step`` along the change of the residuals, the other
    parameters adjusting; ``step_error`` is the step's standard error, from the scores of blocks.
    ``direct``: the values are those of a direct fit, and ``gain`` is the decrease of the cost at them.
    """

    values: dict[str, float]
    gain: float
    step: float
    step_error: float
    direct: bool = False


def initial_guesses(
    effect: Effect, quantities: RigQuantities, priors: Mapping[str, ParameterPrior] = MappingProxyType({})
) -> list[dict[str, float]]:
    """Combine the typical values of an effect's parameters into start values.

    Args:
        effect: The effect.
        quantities: The quantities of the rig that scale typical values.
        priors: Values from the pipeline file by EFFECT.PARAMETER; they replace typical values.

    Returns:
        Start values by EFFECT.PARAMETER; none where a scale is unknown. A range ``from`` .. ``to`` is in order.

    """
    stated = [p for p in effect.parameters if not p.refines or f"{effect.name}.{p.name}" in priors]
    names = [f"{effect.name}.{p.name}" for p in stated]
    lists = [
        _typical_values(p.range_on(quantities).typical, priors.get(name)) for p, name in zip(stated, names, strict=True)
    ]
    combinations = [dict(zip(names, values, strict=True)) for values in itertools.product(*lists)]
    stretch = (f"{effect.name}.from", f"{effect.name}.to")
    return [c for c in combinations if stretch[0] not in c or c[stretch[0]] < c[stretch[1]]]


def _typical_values(typical: tuple[float, ...], prior: ParameterPrior | None) -> tuple[float, ...]:
    if prior is None:
        return typical
    stated = prior.start if prior.fixed is None else prior.fixed
    values = typical if stated is None else (stated,)
    return tuple(dict.fromkeys(float(np.clip(value, prior.lower, prior.upper)) for value in values))


def residual_changes(
    effect: Effect, fitted: Fit, residual_models: Sequence[ResidualModel], starts: Sequence[dict[str, float]]
) -> Iterator[Array]:
    """Yield the change of the residuals for each set of the effect's values.

    Only the residual models that are sensitive to the effect are evaluated.

    Args:
        effect: The effect.
        fitted: The fit without it.
        residual_models: The residual models of the fit.
        starts: Values of the effect's parameters.

    Yields:
        The change in units of noise, shape (N,).

    """
    affected = [i for i, residual_model in enumerate(residual_models) if residual_model.is_sensitive_to(effect)]
    sizes = residual_counts(residual_models)
    nominal = np.split(fitted.residual, np.cumsum(sizes)[:-1])
    problem = LeastSquaresProblem(
        fitted.model,
        [residual_models[i] for i in affected],
        (),
        [fitted.initial_state_sensitivities[i] for i in affected],
    )
    for values in starts if affected else ():
        part = problem.data_residuals(with_effect(fitted.model, effect, values))
        parts = [np.zeros(n) for n in sizes]
        for i, residual in zip(affected, part, strict=True):
            parts[i] = residual - nominal[i]
        yield np.concatenate(parts)


def score_tests(effect: Effect, fitted: Fit, residual_models: Sequence[ResidualModel]) -> list[ScoreTest]:
    """Compute the score test of an effect at each of its typical values, and at those of a direct fit.

    Args:
        effect: The effect.
        fitted: The fit without it.
        residual_models: The residual models of the fit.

    Returns:
        The tests, largest gain first; none where no residual model is sensitive to the effect.

    References:
        C. R. Rao, Proc. Cambridge Phil. Soc. 44 (1948) 50-57.
    """
    typical = initial_guesses(
        effect, rig_quantities(fitted.model, [one.experiment for one in residual_models]), fitted.model.rig.priors
    )
    nested = effect.in_model_with(fitted.model.effects).nested
    out = [
        _score_test(values, change, fitted, nested=nested)
        for values, change in zip(typical, residual_changes(effect, fitted, residual_models, typical), strict=False)
    ]
    guesses = direct_guesses(effect, fitted.model, residual_models)
    direct = [_direct_test(values, effect, fitted, residual_models) for values in guesses]
    return sorted([*out, *direct], key=lambda test: -test.gain)


def _direct_test(
    values: dict[str, float], effect: Effect, fitted: Fit, residual_models: Sequence[ResidualModel]
) -> ScoreTest:
    model, target = with_effect(fitted.model, effect, values), fitted.projected_residual
    problem = LeastSquaresProblem(model, residual_models, (), fitted.initial_state_sensitivities)
    gain = float(target @ target) - float(sum(part @ part for part in problem.data_residuals(model)))
    return ScoreTest(values, gain if math.isfinite(gain) else -math.inf, 1.0, math.inf, direct=True)


def _score_test(values: dict[str, float], change: Array, fitted: Fit, *, nested: bool) -> ScoreTest:
    """Return the test of a change of the residuals (N,), from sums over the blocks: no array of N numbers is projected.

    With the part t of the residuals that the free parameters leave, and the change c = n + J a that they reproduce but
    for n: n'n = c'c - a'J'c, and n't = c't, in each block less (J't)'a.
    """
    target, along = fitted.projected_residual, fitted.transposed_product(change)
    absorbed = fitted.inverse_hessian @ along
    power = float(change @ change - along @ absorbed)
    if not np.isfinite(power) or power < MIN_POWER_SHARE * max(float(change @ change), 1e-30):
        return ScoreTest(values, 0.0, 0.0, np.inf)
    by_block = np.bincount(fitted.blocks, weights=change * target) - fitted.projected_scores @ absorbed
    product, error = float(by_block.sum()), float(np.linalg.norm(by_block)) / power
    if not nested:  # it cannot be switched on by degrees
        return ScoreTest(values, -2.0 * product - power, 1.0, error)
    step = -product / power
    return ScoreTest(values, step * step * power, step, error)


def scaled_initial_guess(
    effect: Effect, test: ScoreTest, model: Model, quantities: RigQuantities, step_share: float = 1.0
) -> dict[str, float]:
    """Move the values of a score test from their nulls by a share of the predicted step.

    Args:
        effect: The effect.
        test: Its score test.
        model: The model without the effect.
        quantities: The quantities that scale the effect's range.
        step_share: Share of the predicted step, which is first limited to 0.05 .. 5.

    Returns:
        Start values by EFFECT.PARAMETER; a parameter without a null keeps the tested value.

    """
    if test.direct:
        return dict(test.values)
    step = step_share * float(np.clip(test.step, 0.05, 5.0))
    values = dict(test.values)
    for p in effect.in_model_with(model.effects).parameters:
        name = f"{effect.name}.{p.name}"
        null = null_value(p, model) if name in values else None
        if null is not None:  # steps between the typical values, no further
            size = p.range_on(quantities)
            values[name] = float(np.clip(null + step * (values[name] - null), size.lower, size.upper))
    return values
