"""What the controller takes from a model's effects: read at the ports where they enter, whatever they are called."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneucli.controller.layout import PLACES
from pneucli.physics.gas import orifice_flow
from pneucli.simulate.model import Model

Array = NDArray[np.float64]

WIDE = 1e3  # m/s, by which friction has fallen
SETTLED = 400  # steps of the valve's answer to a step of the command
STEP = 1e-3  # s, of that answer
STAIRS = 2000  # of a slow way to and fro of the command
LONG = 1e6  # s, after which all has settled
SOON = 1e-3  # s, of rest: too short for anything to settle
BAR = 1e5  # Pa


def moving_mass(model: Model) -> float:
    """Return all that is moved, in kg."""
    return model.base()["rig.moving_mass"] + model.total("mass")


def dead_volumes(model: Model) -> tuple[float, float]:
    """Return the dead volumes of both chambers in m^3."""
    base = model.base()
    return base["rig.dead_volume_1"] + model.total("volume_1"), base["rig.dead_volume_2"] + model.total("volume_2")


def places(model: Model) -> Array:
    """Return the places along the stroke in m, shape (PLACES,)."""
    return np.linspace(0.0, model.base()["rig.stroke"], PLACES)


def pull(model: Model, x: Array) -> Array:
    """Return the force in N toward x = 0 with which springs, weights and the like pull the resting piston at x (m)."""
    return -_over(x, lambda at: model.total("force", at, 0.0, model.base()["rig.stroke"]))


def pulls_back(model: Model) -> bool:
    """Whether something pulls the piston toward x = 0 all over the stroke."""
    return bool(np.all(pull(model, places(model)) > 0.0))


def added_damping(model: Model, x: Array, v: float) -> Array:
    """Return what brakes beside friction, in N s/m, at x (m) and a speed v (m/s) that tells the direction."""
    stroke = model.base()["rig.stroke"]
    return _over(x, lambda at: (model.total("force", at, 0.0, stroke) - model.total("force", at, v, stroke)) / v)


def viscous(model: Model, way: float) -> float:
    """Return viscous friction in N s/m toward ``way`` (1 or -1)."""
    return model.base()["friction.viscous"] * _product(model, "viscous_factor", way)


def dry_factors(model: Model, x: Array, way: float) -> Array:
    """Return the factor on dry friction at x (m) toward ``way``, with both chambers at ambient pressure."""
    return _over(x, lambda at: _dry(model, way, at, 0.0, 0.0))


def dry_over_pressure(model: Model) -> tuple[float, float]:
    """Return by how much dry friction grows with p1 and with p2, in 1/Pa: over a bar, in the middle, in the mean."""
    middle = 0.5 * model.base()["rig.stroke"]
    found = []
    for p1, p2 in ((BAR, 0.0), (0.0, BAR)):
        grown = [_dry(model, way, middle, p1, p2) / _dry(model, way, middle, 0.0, 0.0) - 1.0 for way in (1.0, -1.0)]
        found.append(0.5 * sum(grown) / BAR)
    return found[0], found[1]


def _dry(model: Model, way: float, x: float, p1: float, p2: float) -> float:
    ambient = model.base()["rig.ambient_pressure"]
    return max(_product(model, "dry_factor", way, x, ambient + p1, ambient + p2, ambient), 1e-3)


@dataclass(frozen=True)
class Dwell:
    """What a rest makes of the friction that holds: its factor after a long one, and the rate in 1/s it begins with."""

    most: float
    rate: float


def dwell(model: Model) -> Dwell:
    """Return how the friction that holds grows while the piston rests."""
    least, soon, late = (_product(model, "static_factor", t) for t in (0.0, SOON, LONG))
    return Dwell(max(late, 1.0), max((soon - least) / SOON, 0.0))


def bristle_stiffness(model: Model) -> float:
    """Return the stiffness in N/m of what gives way before the piston slides; 0 where that is rigid."""
    return model.total("bristle_stiffness")


def slowing(model: Model) -> float:
    """Return dry friction while slowing over Coulomb's; 1 where both branches are one."""
    return _product(model, "slowing")


def critical_ratio(model: Model) -> float:
    """Return the critical pressure ratio of the valve."""
    return model.through("critical_ratio", model.base()["valve.critical_ratio"])


def breakaway(model: Model) -> tuple[float, float]:
    """Return friction at break-away in N, and the speed in m/s at which half of its rise over Coulomb's is left.

    With thesis 3.6 these are its static friction and its Stribeck velocity. 1 m/s where nothing rises.
    """
    coulomb = model.base()["friction.coulomb"]
    rise = model.total("dry_rise", coulomb, 0.0)
    if rise <= 0.0:
        return coulomb, 1.0
    low, high = 0.0, WIDE
    while high - low > 1e-9 * high:
        middle = 0.5 * (low + high)
        above = model.total("dry_rise", coulomb, middle) > 0.5 * rise
        low, high = (middle, high) if above else (low, middle)
    return coulomb + rise, 0.5 * (low + high)


@dataclass(frozen=True)
class Leaks:
    """Areas in m^2 of the orifices that leak as the model does: chambers to ambient, between them, in the valve."""

    chamber_1: float
    chamber_2: float
    between: float
    valve: float


def leaks(model: Model) -> Leaks:
    """Return the leaks, each taken between ambient and supply pressure."""
    base = model.base()
    high, low = base["rig.supply_pressure"], base["rig.ambient_pressure"]
    k = math.sqrt(2.0 / (base["rig.gas_constant"] * base["rig.gas_temperature"]))
    through = orifice_flow(high, low, critical_ratio(model), k, k)
    first, second, between = (
        model.total(port, high, low, k) / through for port in ("leak_1_ambient", "leak_2_ambient", "leak_1_2")
    )
    return Leaks(first, second, between, model.total("leak_area"))


@dataclass(frozen=True)
class Sensor:
    """How a pressure sensor reads: ``scale`` p + ``zero`` (Pa)."""

    scale: float
    zero: float


def sensor(model: Model, chamber: int) -> Sensor:
    """Return the static reading of the sensor of p1 or p2, as a line through ambient and supply pressure."""
    ambient, supply = model.base()["rig.ambient_pressure"], model.base()["rig.supply_pressure"]
    low, high = (model.through(f"read_p{chamber}", p, ambient) for p in (ambient, supply))
    scale = (high - low) / (supply - ambient)
    return Sensor(scale, low - scale * ambient)


def sensor_lag(model: Model) -> float:
    """Return the time constant in s of the sensors of pressure."""
    return model.total("sensor_lag")


def sensor_delay(model: Model) -> float:
    """Return the time in s by which pressures are read late."""
    return model.total("sensor_delay")


def flow_delay(model: Model) -> float:
    """Return the time in s that the flow takes from valve to chamber."""
    return model.total("flow_delay")


@dataclass(frozen=True)
class Spool:
    """What stands between command and opening: a play of ``half_width`` (V), then a first-order ``lag`` (s).

    ``openings`` (V) are what it settles at, the play aside, over ``commands`` (V from the null one).
    """

    half_width: float
    lag: float
    commands: Array
    openings: Array


def spool(model: Model) -> Spool:
    """Return what the effects between command and opening do, found by driving them: slowly, and by a step.

    The play is half of what the ways to and fro are apart, the lag the mean time by which a step is followed.
    """
    largest = max((abs(c) for c in model.valve.commands), default=0.0)
    up = np.linspace(-largest, largest, STAIRS + 1)
    if not any("command" in effect.ports for effect in model.effects) or largest == 0.0:
        return Spool(0.0, 0.0, up, up)
    slow = _follow(model, np.concatenate([up, up[::-1], up]), LONG)
    back, forth = slow[STAIRS + 1 : 2 * STAIRS + 2][::-1], slow[2 * STAIRS + 2 :]
    inner = np.abs(up) < 0.6 * largest
    width = 0.5 * float(np.median((back - forth)[inner])) / _slope(up, 0.5 * (back + forth))
    steps = _follow(model, np.concatenate([np.full(SETTLED, -largest), np.full(SETTLED, largest)]), STEP)[SETTLED:]
    lag = math.fsum(STEP * (steps[-1] - o) / (steps[-1] - slow[0]) for o in steps)
    return Spool(max(width, 0.0) if width > 1e-9 * largest else 0.0, max(lag, 0.0), up, 0.5 * (back + forth))


def _slope(u: Array, opening: Array) -> float:
    """Return by how much the opening grows with the command beyond whatever is overlapped."""
    return float(np.max(np.diff(opening)) / (u[1] - u[0])) or 1.0


def _follow(model: Model, commands: Array, step: float) -> Array:
    """Return the openings in V after each of the ``commands`` (V), each held for ``step`` (s)."""
    users = sorted((e for e in model.effects if "command" in e.ports), key=lambda e: (e.order, e.name))
    states, opened = dict.fromkeys((e.name for e in users), float(commands[0])), np.zeros(commands.size)
    for k, u in enumerate(commands.tolist()):
        for effect in users:
            u, states[effect.name] = effect.ports["command"](u, states[effect.name], step, *model.own(effect))  # type: ignore[misc]  # noqa: PLW2901
        opened[k] = u
    return opened


def _product(model: Model, port: str, *arguments: float) -> float:
    """Return what the effects of a port multiply to."""
    users = [effect for effect in model.effects if port in effect.ports]
    factors = [effect.ports[port](*arguments, *model.own(effect)) for effect in users]
    return float(np.prod(np.array(factors, dtype=np.float64)))


def _over(x: Array, function: Callable[[float], float]) -> Array:
    return np.array([function(float(at)) for at in x])
