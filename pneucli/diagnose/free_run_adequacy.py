"""Whether the fitted model runs astray where all of it is simulated, as the user will run it.

The fit and the search see one subsystem at a time. What passes there may still not replay: an effect that another one
feigns, or a force too small in the balance that decides when a piston breaks away.
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

NOISE_DRAWS = 6  # of noise, of which a correct model's error exceeds all in one stretch out of seven
MIN_SEGMENTS = 20  # stretches, to tell a share of them
MIN_EXCEEDING_SHARE = 0.5  # of the stretches
MAX_MEDIAN_RATIO = 1.4  # times what the draws show, in the median


def free_run_lack_of_fit(model: Model, views: Sequence[ResidualModel]) -> list[LackOfFit]:
    """Return the channels in which most stretches between restarts err by more than every draw of noise, worst first.

    And by much more in the median. Ranks, since single stretches with stick-slip scatter widely even where the model
    is true. Such a remainder is one of the whole and has no shape: the errors of a free run do not tell where they
    began.
    """
    scores: dict[tuple[str, str], list[Array]] = {}
    for e in (v.experiment for v in views if isinstance(v, ForceBalance)):
        for channel, ratios in _error_ratios(model, e).items():
            scores.setdefault((e.recording.experiment, channel), []).append(ratios)
    found = [_channel_lack_of_fit(channel, np.concatenate(parts)) for (_, channel), parts in scores.items()]
    return sorted((r for r in found if r is not None), key=lambda r: -r.ratio)


def _channel_lack_of_fit(channel: str, ratios: Array) -> LackOfFit | None:
    """Return what ratios (stretches, 2) to the largest and to the typical draw say, None where noise may do as much."""
    beyond, typical = np.mean(ratios[:, 0] > 1.0), float(np.median(ratios[:, 1]))
    if len(ratios) < MIN_SEGMENTS or beyond < MIN_EXCEEDING_SHARE or typical < MAX_MEDIAN_RATIO:
        return None
    return LackOfFit(FreeRun, channel, typical, typical, ())


def _error_ratios(model: Model, experiment: Experiment) -> dict[str, Array]:
    """Return by channel the error of each stretch over the largest and over the typical draw (stretches, 2)."""
    simulated, drawn, found = simulate_outputs(model, experiment), sample_deviations(model, experiment, NOISE_DRAWS), {}
    for channel, draws in drawn.items():
        left = np.nan_to_num(experiment.measured(channel) - simulated[channel])
        if channel in MOTION_CHANNELS and "x" in simulated:
            left[in_end_contact(experiment, simulated["x"], channel)] = 0.0
        error = _segment_rms(left, experiment)
        noise = np.maximum(np.array([_segment_rms(d, experiment) for d in draws]), 1e-12)
        found[channel] = np.column_stack([error / noise.max(axis=0), error / np.sqrt(np.mean(noise**2, axis=0))])
    return found


def _segment_rms(values: Array, experiment: Experiment) -> Array:
    """Return the rms of each stretch between restarts, shape (stretches,)."""
    starts = experiment.restarts
    return np.asarray(np.sqrt(np.add.reduceat(values**2, starts) / segment_lengths(starts, values.size)))
