"""Errors of a simulation's initial state, and the whitening of residuals for them.

Each segment between restarts starts from the smoothed pressure, whatever the model. Its error persists for as long as
no gas flows. Pressures without a smoother (recordings of few samples) are taken as exact.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.motion_smoother import input_errors
from pneucli.simulate.restarts import segment_lengths
from pneucli.simulate.run import simulate

Array = NDArray[np.float64]

PRESSURE_COLUMNS = {"p1": at.IN_P1, "p2": at.IN_P2}
NOISE_DRAWS = 16  # draws of the sensors' noise
SMOOTHING_BIAS_FACTOR = 1.4  # times the noise left after smoothing: sqrt(2), since the bias at bends is as large
PRESSURE_PERTURBATION = 2e-4  # of the highest pressure, for forward differences


def initial_state_errors(experiment: Experiment) -> dict[str, float]:
    """Estimate the standard deviations of initial pressures.

    Args:
        experiment: The experiment with its smoothers and noise.

    Returns:
        By pressure, the standard deviation in Pa.

    """
    e, rng = experiment, np.random.default_rng(0)
    errors_of_inputs = [
        input_errors(e.draw_noise(rng), e.smoothers, e.motion_smoother, e.time) for _ in range(NOISE_DRAWS)
    ]
    values = np.array([d[e.restarts] for d in errors_of_inputs])
    return {n: SMOOTHING_BIAS_FACTOR * float(np.std(values[..., c])) for n, c in PRESSURE_COLUMNS.items()}


def initial_state_sensitivity(model: Model, experiment: Experiment, errors: dict[str, float]) -> dict[str, Array]:
    """Compute the effect of initial-state errors on the pressure readings.

    Args:
        model: The model.
        experiment: The experiment.
        errors: Standard deviations of :func:`initial_state_errors`.

    Returns:
        By pressure, shape (1, n), in units of the sensor's noise.

    """
    perturbed, e, out = experiment.inputs.copy(), experiment, {}
    perturbation = PRESSURE_PERTURBATION * float(perturbed[:, list(PRESSURE_COLUMNS.values())].max())
    perturbed[:, list(PRESSURE_COLUMNS.values())] += perturbation
    nominal, shifted = simulate(model, e), simulate(model, e, perturbed)
    for channel in (c for c in PRESSURE_COLUMNS if c in e.smoothers and c in e.channels and e.noise[c].rms):
        error = errors[channel] / e.noise[channel].rms
        out[channel] = error * (shifted[channel] - nominal[channel])[None] / perturbation
    return out


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
    power = np.add.reduceat(error * error, restarts)
    projection = np.add.reduceat(error * residual, restarts, axis=-1)
    shrinkage = (1.0 - 1.0 / np.sqrt(1.0 + power)) / np.maximum(power, 1e-12)
    return np.asarray(
        residual - np.repeat(shrinkage * projection, segment_lengths(restarts, error.size), axis=-1) * error
    )
