"""What relative errors of the flow through the valve become in the pressures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.run import simulate

Array = NDArray[np.float64]

COMMAND_PERTURBATION = 1e-3  # of each command, taken off to see what an error of it becomes


def flow_gain_sensitivity(model: Model, experiment: Experiment) -> dict[str, Array]:
    """Return by pressure what commands that are off by their own size become in what is read, (2, n) each.

    First those that fill chamber 1, then those that vent it, linearised, in units of the sensor's noise; from each
    restart on. An area that grows with the command's power of n is off by n times as much.
    """
    e, null = experiment, model.base_values()["valve.null"]
    plain, moved = (
        simulate(model, e),
        [simulate(model, e, _perturbed_commands(e.inputs, null, sign)) for sign in (1.0, -1.0)],
    )
    read = [c for c in ("p1", "p2") if c in e.channels and e.noise[c].rms]
    return {c: np.array([(plain[c] - m[c]) / (COMMAND_PERTURBATION * e.noise[c].rms) for m in moved]) for c in read}


def _perturbed_commands(inputs: Array, null: float, sign: float) -> Array:
    """Return inputs (n, 8) with the commands on one side of the null one a little nearer to it."""
    nudged = inputs.copy()
    for column in (at.IN_U, at.IN_U2):
        away = nudged[:, column] - null
        nudged[:, column] -= COMMAND_PERTURBATION * np.where(sign * away > 0.0, away, 0.0)
    return nudged
