"""What a correct model would show: sensor noise, and the noise of restart states and inputs carried through the model
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
    """Return the rms deviation by channel that a correct model would show, never below the sensor's own noise."""
    seen = ~experiment.reversals if experiment.recording.imposed else slice(None)
    squares = [
        {c: float(np.mean(d[seen] ** 2)) for c, d in one.items()}
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
    """Return :func:`expected_rms` of each experiment, that of a simulated motion pooled over those of its kind.

    Whether a break-away falls before or after a restart decides most of the deviation of a motion, and the few draws
    of one recording may hold none: together they hold enough.
    """
    own = []
    for i, experiment in enumerate(experiments):
        progress(i)
        own.append(expected_rms(model, experiment))
    kinds = [(e.recording.experiment, e.recording.imposed) for e in experiments]
    out = []
    for kind, mine in zip(kinds, own, strict=True):
        like = [n for k, n in zip(kinds, own, strict=True) if k == kind]
        out.append(
            {
                c: _root_mean_square([n[c] for n in like if c in n]) if c in MOTION_CHANNELS else r
                for c, r in mine.items()
            }
        )
    return out


def _root_mean_square(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
