"""The free-run test: does the fitted model diverge in a simulation of the complete axis, as the user will run it?

Fits and selection use one subsystem at a time. A model that passes there may still fail as a whole, because of an
effect that compensates for another one, or a small error of force that decides when the piston breaks away.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pneucli.compare.expected_error import MOTION_CHANNELS
from pneucli.diagnose.adequacy import LackOfFit
from pneucli.identify.residuals import ForceBalance, FreeRun, ResidualModel
from pneucli.simulate.end_stops import in_end_contact
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.noise_propagation import sample_deviations
from pneucli.simulate.outputs import simulate_outputs
from pneucli.simulate.restarts import segment_lengths

Array = NDArray[np.float64]

NOISE_DRAWS = 6  # a correct model exceeds all of them in one segment of seven
MIN_SEGMENTS = 20  # fewer give no usable share
MIN_EXCEEDING_SHARE = 0.5  # of the segments
MAX_MEDIAN_RATIO = 1.4  # times the typical draw, in the median


def free_run_lack_of_fit(model: Model, residual_models: Sequence[ResidualModel]) -> list[LackOfFit]:
    """Return the channels whose error exceeds every noise draw in most segments between restarts, worst first.

    It must exceed the typical draw clearly in the median, too. Ranks are used because single segments with stick-slip
    scatter widely even for a correct model. The result has no shape, because a free run does not show where an error
    began.
    """
    scores: dict[tuple[str, str], list[Array]] = {}
    for e in (v.experiment for v in residual_models if isinstance(v, ForceBalance)):
        for channel, ratios in _error_ratios(model, e).items():
            scores.setdefault((e.recording.experiment, channel), []).append(ratios)
    found = [_channel_lack_of_fit(channel, np.concatenate(parts)) for (_, channel), parts in scores.items()]
    return sorted((r for r in found if r is not None), key=lambda r: -r.ratio)


def _channel_lack_of_fit(channel: str, ratios: Array) -> LackOfFit | None:
    """Return the lack of fit from ratios (segments, 2) to the largest and the typical draw; None within the noise."""
    exceeding, typical = np.mean(ratios[:, 0] > 1.0), float(np.median(ratios[:, 1]))
    if len(ratios) < MIN_SEGMENTS or exceeding < MIN_EXCEEDING_SHARE or typical < MAX_MEDIAN_RATIO:
        return None
    return LackOfFit(FreeRun, channel, typical, typical, ())


def _error_ratios(model: Model, experiment: Experiment) -> dict[str, Array]:
    """Return by channel the error of each segment over the largest and over the typical draw (segments, 2)."""
    simulated, deviations, found = (
        simulate_outputs(model, experiment),
        sample_deviations(model, experiment, NOISE_DRAWS),
        {},
    )
    for channel, draws in deviations.items():
        residual = np.nan_to_num(experiment.measured(channel) - simulated[channel])
        if channel in MOTION_CHANNELS and "x" in simulated:
            residual[in_end_contact(experiment, simulated["x"], channel)] = 0.0
        error = _segment_rms(residual, experiment)
        noise = np.maximum(np.array([_segment_rms(d, experiment) for d in draws]), 1e-12)
        found[channel] = np.column_stack([error / noise.max(axis=0), error / np.sqrt(np.mean(noise**2, axis=0))])
    return found


def _segment_rms(values: Array, experiment: Experiment) -> Array:
    """Return the rms of each segment between restarts, shape (segments,)."""
    restarts = experiment.restarts
    return np.asarray(np.sqrt(np.add.reduceat(values**2, restarts) / segment_lengths(restarts, values.size)))
