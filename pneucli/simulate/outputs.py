"""A model's answer to an experiment, channel by channel, filtered as the comparison asks for."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pneucli.simulate.experiment import Experiment
from pneucli.simulate.imposed import imposed_force
from pneucli.simulate.model import Model
from pneucli.simulate.run import simulate
from pneucli.simulate.unread import with_settled_p2

Array = NDArray[np.float64]


def outputs(
    model: Model, experiment: Experiment, inputs: Array | None = None, noise: Mapping[str, Array] | None = None
) -> dict[str, Array]:
    """Return the channels that are compared, each of shape (n,), low-passed where the comparison asks for it.

    ``inputs`` and ``noise`` disturb the measured inputs (see :mod:`pneucli.compare.expected`).
    """
    if experiment.recording.imposed == "motion":
        return {"force": experiment.filtered(imposed_force(model, experiment, noise))}
    if experiment.infers_p2:
        inputs = with_settled_p2(model, experiment, experiment.inputs if inputs is None else inputs)
    raw = simulate(model, experiment, inputs)
    return {channel: experiment.filtered(raw[channel].copy()) for channel in experiment.channels}
