"""What stands in for readings that a recording lacks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from pneucli.recording import Recording, Rig
from pneucli.simulate import layout as at

Array = NDArray[np.float64]


def substitute_missing_inputs(inputs: Array, recording: Recording, rig: Rig) -> None:
    """Fill in what was not measured, in inputs (n, 8): ambient pressure, the regulator's setting, a shut chamber's p2.

    p2 of a shut chamber is that of a gas shut in, as much of it as the forces on the moving piston ask for; behind a
    valve it is held at what carries the piston at the start. Either needs p1, x and the areas, the former the stroke.
    """
    for column, name, value in (
        (at.IN_P1, "p1", rig.ambient_pressure),
        (at.IN_P2, "p2", rig.ambient_pressure),
        (at.IN_SUPPLY, "p_supply", rig.supply_pressure or rig.ambient_pressure),
    ):
        if name not in recording:
            inputs[:, column] = value
    if {"p1", "x"} <= recording.signals.keys() and "p2" not in recording and all(rig.piston_areas):
        if recording.chamber_2 == "valve":
            inputs[:, at.IN_P2] = _balancing_p2(inputs, rig)
        elif recording.chamber_2 == "closed" and rig.stroke:
            inputs[:, at.IN_P2] = _trapped_gas_p2(inputs, recording.time, rig, rig.stroke)


def _balancing_p2(inputs: Array, rig: Rig) -> float:
    """Return the pressure in Pa that holds the piston at the start."""
    area_1, area_2 = rig.piston_areas
    return max(rig.ambient_pressure + area_1 / area_2 * (float(inputs[0, at.IN_P1]) - rig.ambient_pressure), 0.0)


def _trapped_gas_p2(inputs: Array, time: Array, rig: Rig, stroke: float) -> Array:
    """Return the pressure (n,) of a gas shut in chamber 2, from the balance of forces while the piston moves.

    What p1 drives is held by that gas, the mass, dry and viscous friction, each of which can but resist.
    """
    area_1, area_2 = rig.piston_areas
    x, v = inputs[:, at.IN_X], inputs[:, at.IN_V]
    volume = np.maximum(area_2 * (stroke - x), 0.0) + (rig.dead_volume_2 or 0.0)
    rise = (float(volume.max()) / volume) ** (rig.polytropic_exponent or rig.heat_capacity_ratio)
    force = area_1 * (inputs[:, at.IN_P1] - rig.ambient_pressure) + inputs[:, at.IN_FORCE]
    design = np.stack([area_2 * rise, np.sign(v), v, np.gradient(v, time)], axis=1)
    moving = v != 0.0
    sizes = np.abs(design[moving]).max(axis=0, initial=1e-300)
    found = nnls(design[moving] / sizes, force[moving] + area_2 * rig.ambient_pressure)[0] / sizes
    return np.asarray(found[0] * rise)
