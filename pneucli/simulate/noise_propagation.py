"""How far readings of a run may lie from a correct model: the sensors' noise, drawn and carried through all of it.

It passes through the same smoothing as the measurement, and the recording is simulated with it; the smoothing being
linear, the draws need no truth.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.outputs import simulate_outputs

Array = NDArray[np.float64]

NOISE_SEED = 20151


def sample_deviations(model: Model, experiment: Experiment, draws: int, seed: int = NOISE_SEED) -> dict[str, Array]:
    """Return draws of (measured - model) of a correct model, shape (draws, n) for each channel."""
    found = list(iterate_deviations(model, experiment, draws, seed))
    return {channel: np.array([one[channel] for one in found]) for channel in experiment.channels}


def iterate_deviations(
    model: Model, experiment: Experiment, draws: int, seed: int = NOISE_SEED
) -> Iterator[dict[str, Array]]:
    """Yield such draws one after the other, shape (n,) for each channel."""
    nominal = simulate_outputs(model, experiment)
    for noise, inputs in experiment.noise_draws(draws, seed):
        disturbed = simulate_outputs(model, experiment, inputs, noise)
        yield {
            channel: experiment.low_passed(_reading_noise(experiment, channel, noise, inputs))
            - (disturbed[channel] - nominal[channel])
            for channel in experiment.channels
        }


def _reading_noise(experiment: Experiment, channel: str, noise: dict[str, Array], inputs: Array) -> Array:
    if channel in noise:
        return noise[channel]
    if channel == "v":
        return np.asarray(inputs[:, at.IN_V] - experiment.inputs[:, at.IN_V])
    return experiment.net_pressure_noise(noise)
