"""What a simulation errs by because it starts from a smoothed reading, and how a residual is whitened for it.

Each stretch between restarts starts from the smoothed pressure, a sensor's lag undone, and carries its error on for as
long as no gas flows. Unsmoothed pressures (of few samples) are taken as they are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment, smooth
from pneucli.simulate.model import Model
from pneucli.simulate.run import simulate

Array = NDArray[np.float64]

COLUMNS = {"p1": at.IN_P1, "p2": at.IN_P2}
DRAWS = 16  # of noise
SMOOTHING_BIAS = 1.4  # times the noise that smoothing leaves in a start: it errs by as much again where it bends
NUDGE = 100.0  # Pa, of a start, to see what becomes of an error


def start_errors(experiment: Experiment) -> dict[str, tuple[float, float]]:
    """Return by pressure the standard deviations of its starts in Pa, and of their rates in Pa/s."""
    e, rng = experiment, np.random.default_rng(0)
    drawn = [smooth(e.draw_noise(rng), e.smoothers, e.fusion, e.time) for _ in range(DRAWS)]
    values = np.array([d[e.restarts] for d in drawn])
    rates = np.array([np.gradient(d, e.time, axis=0)[e.restarts] for d in drawn])
    return {
        n: (SMOOTHING_BIAS * float(np.std(values[..., c])), float(np.std(rates[..., c]))) for n, c in COLUMNS.items()
    }


def response(model: Model, experiment: Experiment) -> dict[str, Array]:
    """Return by pressure what an error of 1 Pa at each restart does to what is read, (n,) each."""
    nudged, e = experiment.inputs.copy(), experiment
    for column in COLUMNS.values():
        nudged[e.restarts, column] += NUDGE
    plain, moved = simulate(model, e), simulate(model, e, nudged)
    return {c: (moved[c] - plain[c]) / NUDGE for c in COLUMNS if c in e.smoothers and c in e.channels}


def whitened(residual: Array, error: Array, restarts: NDArray[np.int64]) -> Array:
    """Return a residual (n,) whitened for errors of the starts.

    ``error`` (n,) is what a start's standard deviation becomes, in units of the noise. In each stretch the covariance
    is that of the noise times (I + e e'); its inverse square root takes away a share of what the residual has along e.
    """
    power = np.add.reduceat(error * error, restarts)
    along = np.add.reduceat(error * residual, restarts)
    share = (1.0 - 1.0 / np.sqrt(1.0 + power)) / np.maximum(power, 1e-12)
    lengths = np.diff(np.append(restarts, residual.size))
    return np.asarray(residual - np.repeat(share * along, lengths) * error)
