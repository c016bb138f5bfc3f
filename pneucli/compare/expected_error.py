"""The error of a correct model: sensor noise, and noise of restart states and inputs propagated through the model
(interface, section 3).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.noise_propagation import NOISE_SEED, iterate_deviations

NOISE_DRAWS = 6
MOTION_CHANNELS = ("x", "v", "a")


def expected_rms(
    model: Model, experiment: Experiment, draws: int = NOISE_DRAWS, seed: int = NOISE_SEED
) -> dict[str, float]:
    """Return the rms error that a correct model would have.

    Args:
        model: The model.
        experiment: The experiment.
        draws: Number of draws of the noise.
        seed: Seed of the generator.

    Returns:
        Rms error by channel, SI; at least the noise of the channel's sensor.
    """
    valid = ~experiment.reversals if experiment.recording.imposed else slice(None)
    squares = [
        {c: float(np.mean(d[valid] ** 2)) for c, d in one.items()}
        for one in iterate_deviations(model, experiment, draws, seed)
    ]
    rms = {c: float(np.sqrt(np.mean([one[c] for one in squares]))) for c in experiment.channels}
    low_pass = experiment.low_pass is not None
    return {
        c: max(r, 0.0 if low_pass or c not in experiment.noise else experiment.noise[c].rms) for c, r in rms.items()
    }


def expected_rms_of_all(
    model: Model, experiments: Sequence[Experiment], progress: Callable[[int], None] = lambda _: None
) -> list[dict[str, float]]:
    """Return :func:`expected_rms` of each experiment, for the motion pooled over experiments of one kind.

    Whether a break-away falls before or after a restart determines most of the deviation of the motion, and the few
    draws of one recording may contain none; those of all recordings contain enough.

    Args:
        model: The model.
        experiments: Experiments.
        progress: Called with the number of each experiment.

    Returns:
        Rms errors by channel for each experiment, SI.
    """
    own = []
    for i, experiment in enumerate(experiments):
        progress(i)
        own.append(expected_rms(model, experiment))
    kinds = [(e.recording.experiment, e.recording.imposed) for e in experiments]
    out = []
    for kind, rms in zip(kinds, own, strict=True):
        same_kind = [n for k, n in zip(kinds, own, strict=True) if k == kind]
        out.append(
            {
                c: _root_mean_square([n[c] for n in same_kind if c in n]) if c in MOTION_CHANNELS else r
                for c, r in rms.items()
            }
        )
    return out


def _root_mean_square(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
