"""What a simulation errs by because it starts from a smoothed reading, and how a residual is whitened for it.

Each stretch between restarts starts from the smoothed pressure, a sensor's lag undone, and carries its error on for as
long as no gas flows. Unsmoothed pressures (of few samples) are taken as they are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment, segment_lengths
from pneucli.simulate.model import Model
from pneucli.simulate.motion_smoother import input_errors
from pneucli.simulate.run import simulate

Array = NDArray[np.float64]

PRESSURE_COLUMNS = {"p1": at.IN_P1, "p2": at.IN_P2}
NOISE_DRAWS = 16  # of noise
SMOOTHING_BIAS_FACTOR = 1.4  # times the noise that smoothing leaves in a start: it errs by as much again where it bends
PRESSURE_PERTURBATION = 2e-4  # of the highest pressure, added to a start to see what becomes of an error


def initial_state_errors(experiment: Experiment) -> dict[str, tuple[float, float]]:
    """Return by pressure the standard deviations of its starts in Pa, and of their rates in Pa/s."""
    e, rng = experiment, np.random.default_rng(0)
    drawn = [input_errors(e.draw_noise(rng), e.smoothers, e.motion_smoother, e.time) for _ in range(NOISE_DRAWS)]
    values = np.array([d[e.restarts] for d in drawn])
    rates = np.array([np.gradient(d, e.time, axis=0)[e.restarts] for d in drawn])
    return {
        n: (SMOOTHING_BIAS_FACTOR * float(np.std(values[..., c])), float(np.std(rates[..., c])))
        for n, c in PRESSURE_COLUMNS.items()
    }


def initial_state_sensitivity(
    model: Model, experiment: Experiment, errors: dict[str, tuple[float, float]]
) -> dict[str, Array]:
    """Return by pressure what errors of the starts become in what is read, (1, n) each in units of the sensor's noise.

    ``errors`` is what :func:`initial_state_errors` gives; a start from readings whose lag is undone errs by their rate
    too.
    """
    nudged, e, out = experiment.inputs.copy(), experiment, {}
    nudge = PRESSURE_PERTURBATION * float(nudged[:, list(PRESSURE_COLUMNS.values())].max())
    nudged[:, list(PRESSURE_COLUMNS.values())] += nudge  # all along: a delay makes a start of later readings
    plain, moved = simulate(model, e), simulate(model, e, nudged)
    for channel in (c for c in PRESSURE_COLUMNS if c in e.smoothers and c in e.channels and e.noise[c].rms):
        value, rate = errors[channel]
        error = float(np.hypot(value, model.sum_of_port("sensor_lag") * rate)) / e.noise[channel].rms
        out[channel] = error * (moved[channel] - plain[channel])[None] / nudge
    return out


def apply_whitening(residual: Array, errors: Array, restarts: NDArray[np.int64]) -> Array:
    """Return a residual (..., n) whitened for ``errors`` (k, n), what errors of a start or of a stretch become.

    All in units of the noise. In each stretch the covariance is that of the noise times I + sum of e e'; one error
    after the other, its inverse square root takes away a share of what the residual has along it.
    """
    for error in _sequentially_whitened(errors, restarts):
        residual = _shrunk_along(residual, error, restarts)
    return residual


def log_determinant(errors: Array, restarts: NDArray[np.int64]) -> Array:
    """Return the logarithm of the determinant of that covariance, spread evenly over each stretch (n,).

    What a likelihood adds to the sum of squares: a model whose starts err more must not gain by the allowance.
    """
    n = errors.shape[-1]
    samples, total = segment_lengths(restarts, n), np.zeros(n)
    for error in _sequentially_whitened(errors, restarts):
        total += np.repeat(np.log1p(np.add.reduceat(error * error, restarts)) / samples, samples)
    return total


def _sequentially_whitened(errors: Array, restarts: NDArray[np.int64]) -> list[Array]:
    """Return errors (k, n), each as whitening for those before it leaves it."""
    if len(errors) < 2:
        return list(errors)
    first, *others = errors
    return [
        first,
        *_sequentially_whitened(np.array([_shrunk_along(other, first, restarts) for other in others]), restarts),
    ]


def _shrunk_along(residual: Array, error: Array, restarts: NDArray[np.int64]) -> Array:
    """Return a residual (..., n) without a share of what it has along an error (n,)."""
    power = np.add.reduceat(error * error, restarts)
    along = np.add.reduceat(error * residual, restarts, axis=-1)
    share = (1.0 - 1.0 / np.sqrt(1.0 + power)) / np.maximum(power, 1e-12)
    return np.asarray(residual - np.repeat(share * along, segment_lengths(restarts, error.size), axis=-1) * error)
