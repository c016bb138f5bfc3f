"""What a correct model would show: sensor noise, and the noise of restart states and inputs carried through the model.

The sensors' noise is drawn from its identified model, passed through the same smoothing as the measurement, and the
recording is simulated with it; the smoothing being linear, the draws need no truth. (Interface, section 3.)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.outputs import outputs

Array = NDArray[np.float64]
DRAWS = 6
SEED = 20151
MOTION = ("x", "v", "a")


def deviations(model: Model, experiment: Experiment, draws: int = DRAWS, seed: int = SEED) -> dict[str, Array]:
    """Return draws of (measured - model) of a correct model, shape (draws, n) for each channel."""
    drawn = list(_drawn(model, experiment, draws, seed))
    return {channel: np.array([one[channel] for one in drawn]) for channel in experiment.channels}


def _drawn(model: Model, experiment: Experiment, draws: int, seed: int) -> Iterator[dict[str, Array]]:
    """Yield one draw after the other, shape (n,) for each channel."""
    rng = np.random.default_rng(seed)
    nominal = outputs(model, experiment)
    for _ in range(draws):
        yield _deviation(model, experiment, nominal, rng)


def _deviation(
    model: Model, experiment: Experiment, nominal: dict[str, Array], rng: np.random.Generator
) -> dict[str, Array]:
    noise = experiment.draw_noise(rng)
    inputs = experiment.read_again(noise)
    disturbed = outputs(model, experiment, inputs, noise)
    return {
        channel: experiment.filtered(_reading_noise(experiment, channel, noise, inputs))
        - (disturbed[channel] - nominal[channel])
        for channel in experiment.channels
    }


def _reading_noise(experiment: Experiment, channel: str, noise: dict[str, Array], inputs: Array) -> Array:
    if channel in noise:
        return noise[channel]
    if channel == "v":
        return np.asarray(inputs[:, at.IN_V] - experiment.inputs[:, at.IN_V])
    return experiment.net_pressure_noise(noise)


def expected_rms(model: Model, experiment: Experiment, draws: int = DRAWS, seed: int = SEED) -> dict[str, float]:
    """Return the rms deviation by channel that a correct model would show, never below the sensor's own noise."""
    squares = [{c: float(np.mean(d**2)) for c, d in drawn.items()} for drawn in _drawn(model, experiment, draws, seed)]
    rms = {c: float(np.sqrt(np.mean([one[c] for one in squares]))) for c in experiment.channels}
    low_pass = experiment.low_pass is not None
    return {
        c: max(r, 0.0 if low_pass or c not in experiment.noise else experiment.noise[c].rms) for c, r in rms.items()
    }


def expected_of_all(
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
        out.append({c: _pooled([n[c] for n in like if c in n]) if c in MOTION else r for c, r in mine.items()})
    return out


def _pooled(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
