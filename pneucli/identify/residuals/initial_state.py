"""Errors of a simulation's initial state, and the whitening of residuals for them (docs/method.md).

Each segment between restarts starts from the smoothed pressure, whatever the model. Its error persists for as long as
no gas flows. Pressures without a smoother (recordings of few samples) are taken as exact.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.caches import compiled
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment, segment_lengths
from pneucli.simulate.model import Model
from pneucli.simulate.run import recalled, simulate

PRESSURE_COLUMNS = {"p1": at.IN_P1, "p2": at.IN_P2}
NOISE_DRAWS = 16  # draws of the sensors' noise
SMOOTHING_BIAS_FACTOR = 1.4  # times the noise left after smoothing: sqrt(2), since the bias at bends is as large
MIN_POWER = 1e-12  # of an error, relative to the noise
RECENT_SENSITIVITIES = 16  # of a recording: the candidates of a round, before and after their last fit
RECENT_BYTES = 8 << 20  # of all of them
PRESSURE_PERTURBATION = 2e-4  # of the highest pressure, for forward differences


def initial_state_errors(experiment: Experiment) -> dict[str, float]:
    """Estimate the standard deviations of initial pressures.

    Args:
        experiment: The experiment with its smoothers and noise.

    Returns:
        By pressure, the standard deviation in Pa.

    """
    e, rng = experiment, np.random.default_rng(0)
    values: dict[str, list[Array]] = {name: [] for name in PRESSURE_COLUMNS}
    for _ in range(NOISE_DRAWS):
        noise = e.draw_noise(rng)
        for name in PRESSURE_COLUMNS:
            drawn = noise.get(name, np.zeros(e.time.size))
            values[name].append((e.smoothers[name](drawn) if name in e.smoothers else drawn)[e.restarts])
    return {name: SMOOTHING_BIAS_FACTOR * float(np.std(np.array(drawn))) for name, drawn in values.items()}


def initial_state_sensitivity(model: Model, experiment: Experiment, errors: dict[str, float]) -> dict[str, Array]:
    """Compute the effect of initial-state errors on the pressure readings.

    Args:
        model: The model.
        experiment: The experiment.
        errors: Standard deviations of :func:`initial_state_errors`.

    Returns:
        By pressure, shape (1, n), in units of the sensor's noise.

    """
    e, numbers = experiment, {**model.base_values(), **model.values}
    key = (model.effects, tuple(numbers.items()), model.valve, model.valve_2)
    changes = recalled(
        e.recent_sensitivities, key, lambda: _pressure_changes(model, e), RECENT_SENSITIVITIES, RECENT_BYTES
    )
    out = {}
    for channel, change in zip(PRESSURE_COLUMNS, changes, strict=True):
        if channel in e.smoothers and channel in e.channels and e.noise[channel].rms:
            out[channel] = errors[channel] / e.noise[channel].rms * change[None]
    return out


def _pressure_changes(model: Model, experiment: Experiment) -> Array:
    """Return the changes of the readings of p1 and p2 where all pressures start 1 Pa higher, shape (2, n)."""
    perturbed, columns = experiment.inputs.copy(), list(PRESSURE_COLUMNS.values())
    perturbation = PRESSURE_PERTURBATION * float(perturbed[:, columns].max())
    perturbed[:, columns] += perturbation
    nominal, shifted = simulate(model, experiment), simulate(model, experiment, perturbed)
    with np.errstate(over="ignore", invalid="ignore"):  # a diverging model has no derivatives
        return np.array([shifted[c] - nominal[c] for c in PRESSURE_COLUMNS]) / perturbation


def apply_whitening(residual: Array, errors: Array, restarts: NDArray[np.int64]) -> Array:
    """Return a residual (..., n) whitened for initial-state errors, see :func:`whiten`."""
    out = np.array(residual, dtype=np.float64, order="C")
    rows = out.reshape(-1, out.shape[-1])
    whiten(rows, errors, restarts, np.arange(len(rows)))
    return out


def whiten(
    residuals: Array, errors: Array, restarts: NDArray[np.int64], rows: NDArray[np.intp], start: int = 0
) -> None:
    """Whiten residuals for initial-state errors, segment by segment, in place.

    In each segment the covariance, in units of the noise, is C = I + sum of e e'. The inverse square root of each
    factor shrinks the component of the residual along that error.

    Args:
        residuals: Residuals in units of the noise, shape (k, N), row after row in memory.
        errors: Effect of each error in units of the noise, shape (m, n).
        restarts: First samples of the segments.
        rows: Which of the residuals.
        start: Column at which their n samples begin.

    """
    for error in _sequentially_whitened(errors, restarts):
        _shrink(residuals, rows, start, error, restarts)


def log_determinant(errors: Array, restarts: NDArray[np.int64]) -> Array:
    """Compute log det C of that covariance, spread evenly over each segment.

    A likelihood adds it to the sum of squares, so that a model with larger initial-state errors does not win by them.

    Args:
        errors: Effect of each error in units of the noise, shape (k, n).
        restarts: First samples of the segments.

    Returns:
        The share of each sample, shape (n,); its sum is log det C.

    """
    n = errors.shape[-1]
    samples, total = segment_lengths(restarts, n), np.zeros(n)
    for error in _sequentially_whitened(errors, restarts):
        total += np.repeat(np.log1p(np.add.reduceat(error * error, restarts)) / samples, samples)
    return total


def _sequentially_whitened(errors: Array, restarts: NDArray[np.int64]) -> Array:
    """Return errors (k, n), each whitened for those before it."""
    out = errors.copy()
    for k in range(len(out) - 1):
        _shrink(out, np.arange(k + 1, len(out)), 0, out[k].copy(), restarts)
    return out


@compiled(nogil=True, error_model="numpy", fastmath={"reassoc", "contract"})  # sums in any order
def _shrink(residuals: Array, rows: NDArray[np.intp], start: int, error: Array, restarts: NDArray[np.int64]) -> None:
    """Shrink the component along an error (n,) of n columns of some rows, one segment after another."""
    for s in range(restarts.size):
        first, last = restarts[s], restarts[s + 1] if s + 1 < restarts.size else error.size
        e, power = error[first:last], 0.0
        for i in range(e.size):
            power += e[i] * e[i]
        shrinkage = (1.0 - 1.0 / math.sqrt(1.0 + power)) / max(power, MIN_POWER)
        for row in rows:
            along, product = residuals[row, start + first : start + last], 0.0
            for i in range(e.size):
                product += e[i] * along[i]
            for i in range(e.size):
                along[i] -= shrinkage * product * e[i]
