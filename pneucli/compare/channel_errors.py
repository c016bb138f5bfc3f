"""The errors of a model, channel by channel (interface, section 3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneucli.compare.expected_error import MOTION_CHANNELS, expected_rms
from pneucli.quantities import SIGNALS
from pneucli.simulate.end_stops import in_end_contact
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.outputs import simulate_outputs

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ChannelResult:
    """Errors of one channel in one recording, SI; ``noise`` is the rms that a correct model would show.

    ``measured_range`` is the largest less the smallest reading.
    """

    recording: str
    use: str
    channel: str
    unit: str
    rmsd: float
    percent: float
    relative_error_percent: float
    fit_percent: float
    noise: float
    ratio_to_noise: float
    measured_range: float


@dataclass(frozen=True)
class Comparison:
    """One experiment: its channels' errors, what was measured and what the model says, each (n,)."""

    experiment: Experiment
    results: tuple[ChannelResult, ...]
    measured: dict[str, Array]
    modelled: dict[str, Array]

    def residual(self, channel: str) -> Array:
        """Return measured minus model, NaN where nothing was measured."""
        return self.measured[channel] - self.modelled[channel]

    @property
    def segment(self) -> NDArray[np.int64]:
        """Number of the restart that each sample follows."""
        return np.searchsorted(self.experiment.restarts, np.arange(self.experiment.time.size), side="right") - 1


def compare(model: Model, experiment: Experiment, noise: dict[str, float] | None = None) -> Comparison:
    """Compare a model with one experiment; ``noise`` by channel is drawn where it is not given.

    Where an end decides on the motion, it is not compared. A channel of which nothing is left has no result.
    """
    noise = expected_rms(model, experiment) if noise is None else noise
    modelled = simulate_outputs(model, experiment)
    measured = {channel: experiment.measured(channel) for channel in experiment.channels}
    if "x" in modelled:
        given = {c: in_end_contact(experiment, modelled["x"], c) for c in MOTION_CHANNELS if c in measured}
        measured |= {c: np.where(ends, np.nan, measured[c]) for c, ends in given.items()}
    results = tuple(
        evaluate_channel(experiment, channel, measured[channel], modelled[channel], noise[channel])
        for channel in experiment.channels
        if np.isfinite(measured[channel] - modelled[channel]).any()
    )
    return Comparison(experiment, results, measured, modelled)


def evaluate_channel(experiment: Experiment, channel: str, y: Array, model: Array, noise: float) -> ChannelResult:
    """Return the errors of one channel: measured and modelled of shape (n,), NaN where there is nothing."""
    seen = ~np.isnan(y) & ~np.isnan(model)
    y, error = y[seen], (y - model)[seen]
    rmsd = float(np.sqrt(np.mean(error**2)))
    return ChannelResult(
        recording=experiment.recording.name,
        use=experiment.recording.use,
        channel=channel,
        unit=SIGNALS[channel].unit,
        rmsd=rmsd,
        percent=100 * rmsd / (float(np.ptp(y)) or np.nan),
        relative_error_percent=100 * float(np.linalg.norm(error) / (np.linalg.norm(y) or np.nan)),
        fit_percent=fit_percent(y, y - error),
        noise=noise,
        ratio_to_noise=rmsd / noise if noise > 0 else np.nan,
        measured_range=float(np.ptp(y)),
    )


def fit_percent(measured: Array, modelled: Array) -> float:
    """Return 100 (1 - |y - model| / |y - mean y|), NaN where nothing changes; samples with NaN are left out."""
    seen = ~np.isnan(measured) & ~np.isnan(modelled)
    y, error = measured[seen], (measured - modelled)[seen]
    spread = float(np.linalg.norm(y - y.mean())) if y.size else 0.0
    return 100 * (1 - float(np.linalg.norm(error)) / (spread or np.nan))


def overall_error(results: Sequence[ChannelResult], use: str) -> float | None:
    """Return the root mean square of ``ratio_to_noise`` over the channels of that use; None where there is none."""
    ratios = [r.ratio_to_noise for r in results if r.use == use and np.isfinite(r.ratio_to_noise)]
    return float(np.sqrt(np.mean(np.square(ratios)))) if ratios else None
