"""Simulation of transients with the area model, and its sensitivity to initial pressures and parameters.

Source: the equation of docs/valve-identification.md and its first variation.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pneucli.caches import compiled
from pneucli.identify.valve.area_model import AreaModel
from pneucli.identify.valve.transients import Transients

Array = NDArray[np.float64]


def simulate_transients(area_model: AreaModel, theta: Array, start: Array, transients: Transients) -> Array:
    """Simulate the pressure of all transients.

    The midpoint rule holds u over each sample: its error, (h / time constant)^2 / 6 of the gradient, stays below 1e-4.
    No step crosses the pressure on the other side of the valve, where the slope of the flow function is infinite.

    Args:
        area_model: The area model.
        theta: Its parameters.
        start: Initial pressures in Pa, shape ``(L,)``.
        transients: The transients with commands and supply pressures.

    Returns:
        The pressures in Pa, shape ``(N, L)``.

    """
    quasi_static = area_model.model_gradient.at_coordinates(area_model.model_coordinates(theta))
    coefficients = area_model.correction_coefficients(theta, transients.u)
    shift = area_model.coordinate_shift(theta)[: transients.memory_gradient.shape[-1] - 1]
    memory = transients.memory_gradient[..., 0] + transients.memory_gradient[..., 1:] @ shift
    opposite = area_model.opposite_pressure(transients.u, transients.supply)
    correct = area_model.correction_of_gradient(theta)
    p = np.empty_like(transients.p)
    p[0] = start
    h = transients.period / transients.substeps
    for k in range(transients.p.shape[0] - 1):
        u, supply, beyond, q = transients.u[k], transients.supply[k], opposite[k], p[k]
        for _ in range(transients.substeps):
            midpoint = q
            for step in (0.5 * h, h):
                slope = correct(quasi_static(u, midpoint, supply), coefficients[k], beyond, midpoint)
                midpoint = _step_to_equilibrium(beyond, q, step, slope, memory[k])
            q = midpoint
        p[k + 1] = q
    return p


@compiled(nogil=True, error_model="numpy")
def _step_to_equilibrium(opposite: Array, p: Array, h: Array, slope: Array, memory: Array) -> Array:
    """Return pressures (L,) in Pa after a step, limited to the pressure on the other side of the valve."""
    out = np.empty(p.size)
    for i in range(p.size):
        after = p[i] + h[i] * (slope[i] + memory[i])
        out[i] = opposite[i] if (p[i] - opposite[i]) * (after - opposite[i]) < 0.0 else after
    return out


def initial_pressure_sensitivity(
    area_model: AreaModel, theta: Array, p: Array, transients: Transients
) -> tuple[Array, Array]:
    """Compute the sensitivity of a simulated pressure to its initial value.

    Args:
        area_model: The area model.
        theta: Its parameters.
        p: Simulated pressures in Pa, shape ``(N, L)``.
        transients: The transients.

    Returns:
        The decay of an error over each sample, shape ``(N - 1, L)``, and dp/dp(0), shape ``(N, L)``.

    """
    delta = 1e-6 * area_model.supply
    above, below = (area_model.gradient(theta, transients.u, p + d, transients.supply) for d in (delta, -delta))
    stiffness = (above - below) / (2 * delta)
    decay = np.exp(np.minimum(0.5 * transients.period * (stiffness[1:] + stiffness[:-1]), 1.0))
    return decay, np.concatenate([np.ones((1, p.shape[1])), np.cumprod(decay, axis=0)])


def parameter_sensitivity(area_model: AreaModel, theta: Array, p: Array, decay: Array, transients: Transients) -> Array:
    """Compute the sensitivity of a simulated pressure to the parameters.

    Args:
        area_model: The area model.
        theta: Its parameters.
        p: Simulated pressures in Pa, shape ``(N, L)``.
        decay: Decay of an error over each sample, shape ``(N - 1, L)``.
        transients: The transients.

    Returns:
        dp/dtheta, shape ``(N, L, size)``.

    """
    by_theta = area_model.sensitivity(theta, transients.u, p, transients.supply)
    by_theta[..., : transients.memory_gradient.shape[-1] - 1] += transients.memory_gradient[..., 1:]
    force = 0.5 * transients.period[:, None] * by_theta
    out = np.zeros_like(force)
    for k in range(p.shape[0] - 1):
        out[k + 1] = decay[k][:, None] * (out[k] + force[k]) + force[k + 1]
    return out


def initial_pressures(data: Transients) -> Array:
    """Return the first readings of the transients.

    Args:
        data: The transients.

    Returns:
        The pressures in Pa, shape ``(L,)``; the median of all readings where the first is missing.

    """
    return np.asarray(np.nan_to_num(data.p[0], nan=float(np.nanmedian(data.p))))
