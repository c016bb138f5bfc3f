"""Substitutes for inputs that a recording lacks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pneucli.recording import Recording, Rig
from pneucli.simulate import layout as at

Array = NDArray[np.float64]


def substitute_missing_inputs(inputs: Array, recording: Recording, rig: Rig) -> None:
    """Fill in inputs that were not measured, in place.

    Pressures are ambient, the supply pressure is the stated one. p2 of a closed chamber is that of trapped gas, as much
    as the force balance of the moving piston needs; behind a valve p2 holds the piston at the start. Both need p1, x
    and the areas, the first also the stroke.

    Args:
        inputs: Inputs in the kernel's layout, shape (n, 8).
        recording: The recording.
        rig: The rig.
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
    """Return the pressure (n,) of gas trapped in chamber 2, from the force balance while the piston moves.

    The gas, the mass, dry and viscous friction balance the force of p1; each of them can only resist.
    """
    from scipy.optimize import nnls  # noqa: PLC0415 - slow to import, and few recordings lack a pressure

    area_1, area_2 = rig.piston_areas
    x, v = inputs[:, at.IN_X], inputs[:, at.IN_V]
    volume = np.maximum(area_2 * (stroke - x), 0.0) + (rig.dead_volume_2 or 0.0)
    rise = (float(volume.max()) / volume) ** (rig.polytropic_exponent or rig.heat_capacity_ratio)
    force = area_1 * (inputs[:, at.IN_P1] - rig.ambient_pressure) + inputs[:, at.IN_FORCE]
    design = np.stack([area_2 * rise, np.sign(v), v, np.gradient(v, time)], axis=1)
    moving = v != 0.0
    sizes = np.abs(design[moving]).max(axis=0, initial=1e-300)
    coefficients = nnls(design[moving] / sizes, force[moving] + area_2 * rig.ambient_pressure)[0] / sizes
    return np.asarray(coefficients[0] * rise)
