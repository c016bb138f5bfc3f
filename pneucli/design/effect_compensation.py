"""Parameters of the controller from the effects of a model, evaluated at the ports at which effects enter.

The source of each equation is that of the effect (docs/effects.md).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from pneucli.arrays import Array
from pneucli.controller.layout import STROKE_NODES
from pneucli.physics.declaration import Effect
from pneucli.physics.effects import catalogue
from pneucli.physics.gas import orifice_flow
from pneucli.physics.ports import LEAK_PORTS
from pneucli.simulate.model import Model
from pneucli.simulate.rig_quantities import rig_quantities

MAX_SPEED = 1e3  # m/s, by which friction has fallen
SETTLING_STEPS = 400  # steps of the valve's answer to a step of the command
RESPONSE_STEP = 1e-3  # s, of that answer
SWEEP_STEPS = 2000  # of a slow way to and fro of the command
SETTLING_TIME = 1e6  # s, after which all has settled
SHORT_DWELL = 1e-3  # s, of rest: too short for anything to settle
BAR = 1e5  # Pa


def moving_mass(model: Model) -> float:
    """Return the total moving mass in kg."""
    return model.base_values()["rig.moving_mass"] + model.sum_of_port("mass")


def dead_volumes(model: Model) -> tuple[float, float]:
    """Return the dead volumes of both chambers in m^3."""
    base = model.base_values()
    return base["rig.dead_volume_1"] + model.sum_of_port("volume_1"), base["rig.dead_volume_2"] + model.sum_of_port(
        "volume_2"
    )


def stroke_grid(model: Model) -> Array:
    """Return the nodes along the stroke in m, shape (STROKE_NODES,)."""
    return np.linspace(0.0, model.base_values()["rig.stroke"], STROKE_NODES)


def restoring_force(model: Model, x: Array) -> Array:
    """Return the static force in N toward x = 0 on the resting piston at x (m), both (n,): springs, weights."""
    return -_over_stroke(x, lambda at: model.sum_of_port("force", at, 0.0, model.base_values()["rig.stroke"]))


def has_restoring_force(model: Model) -> bool:
    """Whether a static force pulls the piston toward x = 0 all along the stroke."""
    return bool(np.all(restoring_force(model, stroke_grid(model)) > 0.0))


def added_damping(model: Model, x: Array, v: float) -> Array:
    """Return the damping (n,) in N s/m in addition to friction at x (m), (n,), and a signed speed v (m/s)."""
    stroke = model.base_values()["rig.stroke"]
    return _over_stroke(
        x, lambda at: (model.sum_of_port("force", at, 0.0, stroke) - model.sum_of_port("force", at, v, stroke)) / v
    )


def viscous_friction(model: Model, direction: float) -> float:
    """Return viscous friction in N s/m toward ``direction`` (1 or -1)."""
    return model.base_values()["friction.viscous"] * _product(model, "viscous_factor", direction)


def dry_friction_factors(model: Model, x: Array, direction: float) -> Array:
    """Return the factor (n,) on dry friction at x (m), (n,), toward ``direction``, both chambers at ambient."""
    return _over_stroke(x, lambda at: _dry_friction_factor(model, direction, at, 0.0, 0.0))


def dry_friction_per_pressure(model: Model) -> tuple[float, float]:
    """Return the relative growth of dry friction with p1 and p2 in 1/Pa: mean over a bar at mid-stroke."""
    middle = 0.5 * model.base_values()["rig.stroke"]
    found = []
    for p1, p2 in ((BAR, 0.0), (0.0, BAR)):
        grown = [
            _dry_friction_factor(model, way, middle, p1, p2) / _dry_friction_factor(model, way, middle, 0.0, 0.0) - 1.0
            for way in (1.0, -1.0)
        ]
        found.append(0.5 * sum(grown) / BAR)
    return found[0], found[1]


def _dry_friction_factor(model: Model, way: float, x: float, p1: float, p2: float) -> float:
    ambient = model.base_values()["rig.ambient_pressure"]
    return max(_product(model, "dry_factor", way, x, ambient + p1, ambient + p2, ambient), 1e-3)


@dataclass(frozen=True)
class DwellStrengthening:
    """Growth of break-away with the time at rest: factor after a long rest, and initial rate in 1/s."""

    max_factor: float
    initial_rate: float


def dwell_strengthening(model: Model) -> DwellStrengthening:
    """Return the growth of break-away with the time at rest."""
    least, soon, late = (_product(model, "static_factor", t) for t in (0.0, SHORT_DWELL, SETTLING_TIME))
    return DwellStrengthening(max(late, 1.0), max((soon - least) / SHORT_DWELL, 0.0))


def bristle_stiffness(model: Model) -> float:
    """Return the presliding stiffness in N/m; 0 for a rigid contact."""
    return model.sum_of_port("bristle_stiffness")


def deceleration_friction_ratio(model: Model) -> float:
    """Return dry friction while decelerating over Coulomb friction; -1 for one branch.

    The ratio may be 1 with two branches: friction has no Stribeck rise while decelerating then.
    """
    return _product(model, "slowing") if any("slowing" in effect.ports for effect in model.effects) else -1.0


def critical_ratio(model: Model) -> float:
    """Return the critical pressure ratio of the valve."""
    return model.chain_of_port("critical_ratio", model.base_values()["valve.critical_ratio"])


def breakaway_friction(model: Model) -> tuple[float, float]:
    """Return break-away friction in N, and the speed in m/s at which half of its rise over Coulomb friction remains.

    In (3.6) these are static friction and Stribeck velocity. Without a rise the speed is the typical one of the effect
    that makes a rise: the controller learns at which force the piston breaks away, and must not take it for sliding.
    """
    coulomb = model.base_values()["friction.coulomb"]
    rise = model.sum_of_port("dry_rise", coulomb, 0.0)
    if rise <= 0.0:
        return coulomb, breakaway_friction(_with_typical_rise(model))[1]
    low, high = 0.0, MAX_SPEED
    while high - low > 1e-9 * high:
        middle = 0.5 * (low + high)
        above = model.sum_of_port("dry_rise", coulomb, middle) > 0.5 * rise
        low, high = (middle, high) if above else (low, middle)
    return coulomb + rise, 0.5 * (low + high)


def _with_typical_rise(model: Model) -> Model:
    """Return a model with the middle one of the typical rises of break-away over sliding friction.

    The speed by which a rise has fallen does not depend on its size: without Coulomb friction that of 1 N.
    """
    effect = next(e for e in catalogue().values() if "dry_rise" in e.ports)
    model = model.with_values({"friction.coulomb": model.base_values()["friction.coulomb"] or 1.0})
    rig = rig_quantities(model)
    typical = {p.name: p.range_on(rig).typical for p in effect.parameters}
    sizes = {f"{effect.name}.{name}": starts[len(starts) // 2] for name, starts in typical.items()}
    others = (e for e in model.effects if e.name != effect.name)
    return replace(model, effects=(*others, effect)).with_values(sizes)


@dataclass(frozen=True)
class LeakAreas:
    """Equivalent orifice areas in m^2 of the leaks: chambers to ambient, between them, in the valve."""

    chamber_1: float
    chamber_2: float
    between: float
    valve: float


def leak_areas(model: Model) -> LeakAreas:
    """Return the leaks, evaluated between ambient and supply pressure."""
    base = model.base_values()
    high, low = base["rig.supply_pressure"], base["rig.ambient_pressure"]
    k = math.sqrt(2.0 / (base["rig.gas_constant"] * base["rig.gas_temperature"]))
    through = orifice_flow(high, low, critical_ratio(model), k, k)
    first, second, between = (model.sum_of_port(port, high, low, k) / through for port in LEAK_PORTS)
    return LeakAreas(first, second, between, model.sum_of_port("leak_area"))


@dataclass(frozen=True)
class SensorLine:
    """Static characteristic of a pressure sensor: ``scale`` p + ``offset`` (Pa)."""

    scale: float
    offset: float


def sensor_line(model: Model, chamber: int) -> SensorLine:
    """Return the static characteristic of the sensor of p1 or p2, a line through ambient and supply pressure."""
    ambient, supply = model.base_values()["rig.ambient_pressure"], model.base_values()["rig.supply_pressure"]
    low, high = (model.chain_of_port(f"read_p{chamber}", p, ambient) for p in (ambient, supply))
    scale = (high - low) / (supply - ambient)
    return SensorLine(scale, low - scale * ambient)


def sensor_lag(model: Model) -> float:
    """Return the time constant in s of the pressure sensors."""
    return model.sum_of_port("sensor_lag")


def sensor_delay(model: Model) -> float:
    """Return the delay in s of the pressure sensors."""
    return model.sum_of_port("sensor_delay")


def flow_delay(model: Model) -> float:
    """Return the delay in s of the flow from valve to chamber, the longer one of both chambers."""
    return model.sum_of_port("flow_delay") + max(model.sum_of_port(f"flow_delay_{chamber}") for chamber in (1, 2))


def dead_times(model: Model) -> tuple[float, float]:
    """Return the shorter and the longer dead time in s of a switching valve's edges; 0 where it has none.

    Commands to fill and to shut, each held for ``SETTLING_STEPS``: a dead time is the time integral of what is missed.
    """
    users = [effect for effect in model.effects if "switched" in effect.ports]
    found = []
    for effect in users:
        position, state, values = 0.0, 0.0, model.effect_parameters(effect)
        for command in (1.0, 0.0):
            missed = []
            for _ in range(SETTLING_STEPS):
                position, state = effect.ports["switched"](command, state, RESPONSE_STEP, *values)  # type: ignore[misc]
                missed.append(abs(position - command))
            found.append(RESPONSE_STEP * math.fsum(missed))
    return min(found, default=0.0), max(found, default=0.0)


@dataclass(frozen=True)
class SpoolModel:
    """Model between command and opening: a play of ``play_half_width`` (V), then a first-order ``lag`` (s).

    ``openings`` (V): static openings without the play, over ``commands`` (V from the null command).
    """

    play_half_width: float
    lag: float
    commands: Array
    openings: Array


def identify_spool(model: Model) -> SpoolModel:
    """Identify play and lag of the effects between command and opening, by a slow cycle and a step.

    The play is half the distance between both directions, the lag the mean delay of the step response.
    """
    largest = max((abs(c) for c in model.valve.commands), default=0.0)
    users = sorted((e for e in model.effects if "command" in e.ports), key=lambda e: (e.order, e.name))
    if not users or largest == 0.0:
        up = np.linspace(-largest, largest, SWEEP_STEPS + 1)
        return SpoolModel(0.0, 0.0, up, up)
    return _identified_spool(largest, tuple((e, tuple(model.effect_parameters(e))) for e in users))


SpoolEffects = tuple[tuple[Effect, tuple[float, ...]], ...]  # in the order of the command through them


@lru_cache(maxsize=64)  # a design asks thrice, and a search designs hundreds of controllers for a few lags
def _identified_spool(largest: float, effects: SpoolEffects) -> SpoolModel:
    """Identify the spool of effects with their parameters, for commands of up to ``largest`` (V) from the null."""
    up = np.linspace(-largest, largest, SWEEP_STEPS + 1)
    slow = _opening_response(effects, np.concatenate([up, up[::-1], up]), SETTLING_TIME)
    back, forth = slow[SWEEP_STEPS + 1 : 2 * SWEEP_STEPS + 2][::-1], slow[2 * SWEEP_STEPS + 2 :]
    inner = np.abs(up) < 0.6 * largest
    width = 0.5 * float(np.median((back - forth)[inner])) / _max_slope(up, 0.5 * (back + forth))
    steps = _opening_response(
        effects, np.concatenate([np.full(SETTLING_STEPS, -largest), np.full(SETTLING_STEPS, largest)]), RESPONSE_STEP
    )[SETTLING_STEPS:]
    lag = math.fsum(RESPONSE_STEP * (steps[-1] - o) / (steps[-1] - slow[0]) for o in steps)
    middle = 0.5 * (back + forth)
    for shared in (up, middle):
        shared.flags.writeable = False
    return SpoolModel(max(width, 0.0) if width > 1e-9 * largest else 0.0, max(lag, 0.0), up, middle)


def _max_slope(u: Array, opening: Array) -> float:
    """Return the slope of the opening over the command beyond the overlap."""
    return float(np.max(np.diff(opening)) / (u[1] - u[0])) or 1.0


def _opening_response(effects: SpoolEffects, commands: Array, step: float) -> Array:
    """Return the openings in V after each of the ``commands`` (V), each held for ``step`` (s)."""
    states, opened = [2 * (float(commands[0]),)] * len(effects), np.zeros(commands.size)
    for k, command in enumerate(commands.tolist()):
        u = command
        for i, (effect, parameters) in enumerate(effects):
            u, states[i] = opening_after(effect, u, states[i], step, parameters)
        opened[k] = u
    return opened


def opening_after(
    effect: Effect, u: float, states: tuple[float, float], step: float, parameters: Sequence[float]
) -> tuple[float, tuple[float, float]]:
    """Return the mean opening in V over a step (s) under a command u (V), and the states after it.

    Args:
        effect: An effect between command and opening.
        u: Command in V.
        states: Of the opening and of what drives it, in V.
        step: Step in s.
        parameters: The effect's parameters.

    """
    opening, driven = states
    if "drive" in effect.ports:
        u, driven = effect.ports["drive"](u, driven, opening, step, *parameters)  # type: ignore[misc]
    u, opening = effect.ports["command"](u, opening, step, *parameters)  # type: ignore[misc]
    return u, (opening, driven)


def _product(model: Model, port: str, *arguments: float) -> float:
    """Return the product of the effects at a port."""
    users = [effect for effect in model.effects if port in effect.ports]
    factors = [effect.ports[port](*arguments, *model.effect_parameters(effect)) for effect in users]
    return float(np.prod(np.array(factors, dtype=np.float64)))


def _over_stroke(x: Array, function: Callable[[float], float]) -> Array:
    return np.array([function(float(at)) for at in x])
