"""What was in a chamber 2 at the start whose pressure no sensor reads: as much as the forces on the piston ask for."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment, restarts
from pneucli.simulate.imposed import resting_reading
from pneucli.simulate.model import Model
from pneucli.simulate.motion import v_still
from pneucli.simulate.run import base_vector, kernel_for, with_p2

Array = NDArray[np.float64]

NUDGE = 1e-3  # of a start, to see what becomes of it
TINY = 1e-300


def with_settled_p2(model: Model, experiment: Experiment, inputs: Array) -> Array:
    """Return inputs (n, 8) with the model's p2, of which each stretch without a gap starts as the forces ask for.

    Least squares of the force that the model lacks for the measured motion; p2 is linear in its start while a gas is
    shut in, and nearly so where a valve lets it out.
    """
    e, area_2 = experiment, experiment.rig.areas[1]
    moved, settled = inputs.copy(), with_p2(model, e, inputs)
    moved[:, at.IN_P2] *= 1.0 + NUDGE
    grown = (with_p2(model, e, moved) - settled)[:, at.IN_P2] / NUDGE
    asked = -_lacking_force(model, e, settled) / area_2
    begins, moving = restarts(e.time, None), inputs[:, at.IN_V] != 0.0
    share = np.add.reduceat(grown * asked * moving, begins) / (np.add.reduceat(grown**2 * moving, begins) + TINY)
    stretches = np.diff(np.append(begins, e.time.size))
    settled[:, at.IN_P2] += np.repeat(np.maximum(share, NUDGE - 1.0), stretches) * grown
    return settled


def _lacking_force(model: Model, e: Experiment, inputs: Array) -> Array:
    """Return the force (n,) in N toward +x that the model lacks for the measured motion."""
    kernel, out = kernel_for(model.effects), np.zeros(e.time.size)
    measured = "a" in e.raw
    a = e.raw["a"] - resting_reading(model, e) if measured else np.gradient(inputs[:, at.IN_V], e.time)
    values, on = kernel.vector(model.effect_values()), kernel.switches(e.active(model.effects))
    still = v_still(e, inputs[:, at.IN_V])
    kernel.functions.run_imposed(e.time, inputs, a, still, True, base_vector(model, e), values, on, out)
    return out - inputs[:, at.IN_FORCE]
