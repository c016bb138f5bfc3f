"""Imposed motion: the force that the model needs for the measured motion, against the force that was measured."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.motion import motion, v_still
from pneucli.simulate.run import base_vector, kernel_for

Array = NDArray[np.float64]


def imposed_force(model: Model, experiment: Experiment, noise: Mapping[str, Array] | None = None) -> Array:
    """Return the force in N, shape (n,): the driving force, or without one the net force of the pressures.

    Where both are measured, the force of the pressures counts as known and the driving force is compared.
    """
    kernel = kernel_for(model.effects)
    inputs = experiment.inputs.copy()
    inputs[:, at.IN_X], inputs[:, at.IN_V], a = motion(experiment, noise)
    if "a" in experiment.raw:
        a = a - resting_reading(model, experiment)
    still = v_still(experiment, inputs[:, at.IN_V])
    out = np.zeros(experiment.time.size)
    base, th = base_vector(model, experiment), kernel.vector(model.effect_values())
    on = kernel.switches(experiment.active(model.effects))
    driven = "force" in experiment.recording
    kernel.functions.run_imposed(experiment.time, inputs, a, still, driven, base, th, on, out)
    return out


def resting_reading(model: Model, experiment: Experiment) -> float:
    """Return what the model's accelerometer reads at rest in m/s^2."""
    reading = 0.0
    for effect in model.effects:
        if "read_a" in effect.ports and effect.name in experiment.active((effect,)):
            reading = float(effect.ports["read_a"](reading, *model.own(effect)))  # type: ignore[arg-type]
    return reading
