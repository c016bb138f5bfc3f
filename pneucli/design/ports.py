"""What the controller takes from a model's effects: read at the ports where they enter, whatever they are called."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pneucli.simulate.model import Model

Array = NDArray[np.float64]

WIDE = 1e3  # m/s, by which friction has fallen
PLACES = 25  # along the stroke
SETTLED = 400  # steps of the valve's answer to a step of the command
STEP = 1e-3  # s, of that answer


def moving_mass(model: Model) -> float:
    """Return all that is moved, in kg."""
    return model.base()["rig.moving_mass"] + model.total("mass")


def dead_volumes(model: Model) -> tuple[float, float]:
    """Return the dead volumes of both chambers in m^3."""
    base = model.base()
    return base["rig.dead_volume_1"] + model.total("volume_1"), base["rig.dead_volume_2"] + model.total("volume_2")


def pull(model: Model, x: Array) -> Array:
    """Return the force in N toward x = 0 with which springs, weights and the like pull the resting piston at x (m)."""
    stroke = model.base()["rig.stroke"]
    return -np.array([model.total("force", float(at), 0.0, stroke) for at in x])


def pulls_back(model: Model) -> bool:
    """Whether something pulls the piston toward x = 0 all over the stroke."""
    return bool(np.all(pull(model, np.linspace(0.0, model.base()["rig.stroke"], PLACES)) > 0.0))


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


def lateness(model: Model) -> float:
    """Return the time in s between command and reading: the valve's answer, the line, and the sensors of pressure."""
    return command_lag(model) + sum(model.total(port) for port in ("flow_delay", "sensor_lag", "sensor_delay"))


def command_lag(model: Model) -> float:
    """Return the mean time in s by which the opening follows a step of the command; play and overlap take none."""
    users = sorted((e for e in model.effects if "command" in e.ports), key=lambda e: (e.order, e.name))
    largest = max((abs(c) for c in model.valve.commands), default=0.0)
    states, opened = dict.fromkeys((e.name for e in users), 0.0), np.zeros(SETTLED)
    for k in range(SETTLED):
        u = largest
        for effect in users:
            u, states[effect.name] = effect.ports["command"](u, states[effect.name], STEP, *model.own(effect))  # type: ignore[misc]
        opened[k] = u
    final = opened[-1]
    return math.fsum(STEP * (1.0 - opened / final)) if final else 0.0
