"""Effect of relative flow errors of the valve on the pressures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.run import simulate

Array = NDArray[np.float64]

COMMAND_PERTURBATION = 1e-3  # of each command, for forward differences


def flow_gain_sensitivity(model: Model, experiment: Experiment) -> dict[str, Array]:
    """Compute the pressure change caused by commands with a relative error of 1, linearised, from each restart on.

    Where the area grows with the n-th power of the command, its relative error is n times the command's.

    Args:
        model: The model.
        experiment: The experiment.

    Returns:
        By pressure, shape (2, n), in units of the sensor's noise: commands that fill chamber 1, then those that vent
        it.

    """
    e, null = experiment, model.base_values()["valve.null"]
    nominal, shifted = (
        simulate(model, e),
        [simulate(model, e, _perturbed_commands(e.inputs, null, sign)) for sign in (1.0, -1.0)],
    )
    channels = [c for c in ("p1", "p2") if c in e.channels and e.noise[c].rms]
    return {
        c: np.array([(nominal[c] - one[c]) / (COMMAND_PERTURBATION * e.noise[c].rms) for one in shifted])
        for c in channels
    }


def _perturbed_commands(inputs: Array, null: float, sign: float) -> Array:
    """Return inputs (n, 8) with the commands on one side of the null slightly closer to it."""
    perturbed = inputs.copy()
    for column in (at.IN_U, at.IN_U2):
        opening = perturbed[:, column] - null
        perturbed[:, column] -= COMMAND_PERTURBATION * np.where(sign * opening > 0.0, opening, 0.0)
    return perturbed
