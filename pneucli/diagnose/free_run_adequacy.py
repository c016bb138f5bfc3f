"""Whether the fitted model runs astray where all of it is simulated, as the user will run it.

The fit and the search see one subsystem at a time. What passes there may still not replay: an effect that another one
feigns, or a force too small in the balance that decides when a piston breaks away.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pneucli.compare.expected_error import MOTION
from pneucli.diagnose.adequacy import Remainder
from pneucli.identify.residuals import Forces, View, Whole
from pneucli.identify.residuals.initial_state import lengths
from pneucli.simulate.end_stops import at_ends
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.noise_propagation import deviations
from pneucli.simulate.outputs import outputs

Array = NDArray[np.float64]

DRAWS = 6  # of noise, of which a correct model's error exceeds all in one stretch out of seven
FEWEST = 20  # stretches, to tell a share of them
BEYOND = 0.5  # of the stretches
ASTRAY = 1.4  # times what the draws show, in the median


def astray(model: Model, views: Sequence[View]) -> list[Remainder]:
    """Return the channels in which most stretches between restarts err by more than every draw of noise, worst first.

    And by much more in the median. Ranks, since single stretches with stick-slip scatter widely even where the model
    is true. Such a remainder is one of the whole and has no shape: the errors of a free run do not tell where they
    began.
    """
    scores: dict[tuple[str, str], list[Array]] = {}
    for e in (v.experiment for v in views if isinstance(v, Forces)):
        for channel, ratios in _of(model, e).items():
            scores.setdefault((e.recording.experiment, channel), []).append(ratios)
    found = [_judged(channel, np.concatenate(parts)) for (_, channel), parts in scores.items()]
    return sorted((r for r in found if r is not None), key=lambda r: -r.ratio)


def _judged(channel: str, ratios: Array) -> Remainder | None:
    """Return what ratios (stretches, 2) to the largest and to the typical draw say, None where noise may do as much."""
    beyond, typical = np.mean(ratios[:, 0] > 1.0), float(np.median(ratios[:, 1]))
    if len(ratios) < FEWEST or beyond < BEYOND or typical < ASTRAY:
        return None
    return Remainder(Whole, channel, typical, typical, ())


def _of(model: Model, experiment: Experiment) -> dict[str, Array]:
    """Return by channel the error of each stretch over the largest and over the typical draw (stretches, 2)."""
    simulated, drawn, found = outputs(model, experiment), deviations(model, experiment, DRAWS), {}
    for channel, draws in drawn.items():
        left = np.nan_to_num(experiment.measured(channel) - simulated[channel])
        if channel in MOTION and "x" in simulated:
            left[at_ends(experiment, simulated["x"], channel)] = 0.0
        error = _rms(left, experiment)
        noise = np.maximum(np.array([_rms(d, experiment) for d in draws]), 1e-12)
        found[channel] = np.column_stack([error / noise.max(axis=0), error / np.sqrt(np.mean(noise**2, axis=0))])
    return found


def _rms(values: Array, experiment: Experiment) -> Array:
    """Return the rms of each stretch between restarts, shape (stretches,)."""
    starts = experiment.restarts
    return np.asarray(np.sqrt(np.add.reduceat(values**2, starts) / lengths(starts, values.size)))
