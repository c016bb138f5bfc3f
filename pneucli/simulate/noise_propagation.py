"""Propagate sensor noise through smoothing and simulation: how far the readings of a run deviate from a correct model.

The noise passes through the same smoothing as the measurement. Smoothing is linear, so the draws need no true signal.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pneucli.arrays import Array
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.outputs import simulate_outputs

NOISE_SEED = 20151


def sample_deviations(model: Model, experiment: Experiment, draws: int, seed: int = NOISE_SEED) -> dict[str, Array]:
    """Draw deviations (measured - model) of a correct model.

    Args:
        model: The model.
        experiment: The experiment.
        draws: Number of draws.
        seed: Seed of the generator.

    Returns:
        Deviations by channel in SI units, each (draws, n).
    """
    deviations = list(iterate_deviations(model, experiment, draws, seed))
    return {channel: np.array([one[channel] for one in deviations]) for channel in experiment.channels}


def iterate_deviations(
    model: Model, experiment: Experiment, draws: int, seed: int = NOISE_SEED
) -> Iterator[dict[str, Array]]:
    """Yield deviations (measured - model) of a correct model.

    Args:
        model: The model.
        experiment: The experiment.
        draws: Number of draws.
        seed: Seed of the generator.

    Returns:
        Iterator over draws: deviations by channel in SI units, each (n,).
    """
    has_bristles = model.sum_of_port("bristle_stiffness") > 0.0  # springs that are stiff for the longer steps
    simulated = experiment if has_bristles else experiment.for_differences
    nominal = simulate_outputs(model, simulated)
    for noise, inputs in experiment.noise_draws(draws, seed):
        disturbed = simulate_outputs(model, simulated, inputs, noise)
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
