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
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.restarts import segment_lengths
from pneucli.simulate.run import recalled, simulate

PRESSURE_COLUMNS = {"p1": at.IN_P1, "p2": at.IN_P2}
NOISE_DRAWS = 16  # draws of the sensors' noise
SMOOTHING_BIAS_FACTOR = 1.4  # times the noise left after smoothing: sqrt(2), since the bias at bends is as large
PAIRWISE_LANES, PAIRWISE_BLOCK = 8, 128  # of numpy's pairwise summation
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
    """Whiten a residual for initial-state errors, segment by segment.

    In each segment the covariance, in units of the noise, is C = I + sum of e e'. The inverse square root of each
    factor shrinks the component of the residual along that error.

    Args:
        residual: Residual in units of the noise, shape (..., n).
        errors: Effect of each error in units of the noise, shape (k, n).
        restarts: First samples of the segments.

    Returns:
        The whitened residual, shape (..., n).

    """
    for error in _sequentially_whitened(errors, restarts):
        residual = _shrunk_along(residual, error, restarts)
    return residual


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


def _sequentially_whitened(errors: Array, restarts: NDArray[np.int64]) -> list[Array]:
    """Return errors (k, n), each whitened for those before it."""
    if len(errors) < 2:
        return list(errors)
    first_error, *later_errors = errors
    return [
        first_error,
        *_sequentially_whitened(
            np.array([_shrunk_along(later, first_error, restarts) for later in later_errors]), restarts
        ),
    ]


def _shrunk_along(residual: Array, error: Array, restarts: NDArray[np.int64]) -> Array:
    """Return a residual (..., n) with its component along an error (n,) shrunk."""
    rows = np.ascontiguousarray(residual, dtype=np.float64).reshape(-1, error.size)
    out = np.empty(rows.shape)
    _shrink(rows, np.ascontiguousarray(error), restarts, out)
    return out.reshape(residual.shape)


@compiled(nogil=True, error_model="numpy")
def _pairwise_dot(a: Array, b: Array) -> float:
    """Return the sum of products by pairwise summation, as numpy sums."""
    n = a.size
    if n > PAIRWISE_BLOCK:
        half = n // 2
        half -= half % PAIRWISE_LANES
        return _pairwise_dot(a[:half], b[:half]) + _pairwise_dot(a[half:], b[half:])
    total, end = 0.0, n - n % PAIRWISE_LANES
    if end:
        lanes = np.zeros(PAIRWISE_LANES)
        for i in range(0, end, PAIRWISE_LANES):
            for k in range(PAIRWISE_LANES):
                lanes[k] += a[i + k] * b[i + k]
        total = ((lanes[0] + lanes[1]) + (lanes[2] + lanes[3])) + ((lanes[4] + lanes[5]) + (lanes[6] + lanes[7]))
    for i in range(end, n):
        total += a[i] * b[i]
    return total


@compiled(nogil=True, error_model="numpy")
def _shrink(rows: Array, error: Array, restarts: NDArray[np.int64], out: Array) -> None:
    """Write rows (m, n) whose component along an error (n,) is shrunk, one segment after another."""
    n = error.size
    for s in range(restarts.size):
        first, last = restarts[s], restarts[s + 1] if s + 1 < restarts.size else n
        e = error[first:last]
        power = e[0] * e[0] + _pairwise_dot(e[1:], e[1:])
        shrinkage = (1.0 - 1.0 / math.sqrt(1.0 + power)) / (MIN_POWER if power < MIN_POWER else power)
        for row in range(rows.shape[0]):
            along, to = rows[row, first:last], out[row, first:last]
            step = shrinkage * (e[0] * along[0] + _pairwise_dot(e[1:], along[1:]))
            for i in range(e.size):
                to[i] = along[i] - step * e[i]
