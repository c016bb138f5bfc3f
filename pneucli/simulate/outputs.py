"""A model's answer to an experiment, channel by channel, filtered as the comparison asks for."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment, restart_samples
from pneucli.simulate.imposed_motion import imposed_motion, smooth_acceleration, standstill_speed
from pneucli.simulate.model import Model
from pneucli.simulate.run import base_vector, kernel_for, simulate, with_p2

Array = NDArray[np.float64]


def simulate_outputs(
    model: Model, experiment: Experiment, inputs: Array | None = None, noise: Mapping[str, Array] | None = None
) -> dict[str, Array]:
    """Return the channels that are compared, each of shape (n,), low-passed where the comparison asks for it.

    ``inputs`` and ``noise`` disturb the measured inputs (see :mod:`pneucli.compare.expected_error`).
    """
    if experiment.recording.imposed == "motion":
        return {"force": experiment.low_passed(required_force(model, experiment, noise))}
    if experiment.infers_p2:
        inputs = with_estimated_p2(model, experiment, experiment.inputs if inputs is None else inputs)
    raw = simulate(model, experiment, inputs)
    return {channel: experiment.low_passed(raw[channel].copy()) for channel in experiment.channels}


def required_force(model: Model, experiment: Experiment, noise: Mapping[str, Array] | None = None) -> Array:
    """Return the force in N, shape (n,): the driving force, or without one the net force of the pressures.

    Where both are measured, the force of the pressures counts as known and the driving force is compared.
    """
    kernel = kernel_for(model.effects)
    inputs = experiment.inputs.copy()
    inputs[:, at.IN_X], inputs[:, at.IN_V], a = imposed_motion(experiment, noise)
    if "a" in experiment.raw:
        a = a - accelerometer_offset(model, experiment)
    still = standstill_speed(experiment, inputs[:, at.IN_V])
    out = np.zeros(experiment.time.size)
    base, th = base_vector(model, experiment), kernel.effect_vector(model.effect_values())
    on = kernel.effect_switches(experiment.active_effects(model.effects))
    driven = "force" in experiment.recording
    kernel.functions.run_imposed(experiment.time, inputs, a, still, driven, base, th, on, out)
    return out


def accelerometer_offset(model: Model, experiment: Experiment) -> float:
    """Return what the model's accelerometer reads at rest in m/s^2."""
    reading = 0.0
    for effect in model.effects:
        if "read_a" in effect.ports and effect.name in experiment.active_effects((effect,)):
            reading = float(effect.ports["read_a"](reading, *model.effect_parameters(effect)))  # type: ignore[arg-type]
    return reading


RELATIVE_P2_STEP = 1e-3  # of a start, to see what becomes of it
MIN_DENOMINATOR = 1e-300


def with_estimated_p2(model: Model, experiment: Experiment, inputs: Array) -> Array:
    """Return inputs (n, 8) with the model's p2, of which each stretch without a gap starts as the forces ask for.

    Least squares of the force that the model lacks for the measured motion; p2 is linear in its start while a gas is
    shut in, and nearly so where a valve lets it out.
    """
    e, area_2 = experiment, experiment.rig.piston_areas[1]
    moved, settled = inputs.copy(), with_p2(model, e, inputs)
    moved[:, at.IN_P2] *= 1.0 + RELATIVE_P2_STEP
    grown = (with_p2(model, e, moved) - settled)[:, at.IN_P2] / RELATIVE_P2_STEP
    asked = -_force_residual(model, e, settled) / area_2
    begins, moving = restart_samples(e.time, None), inputs[:, at.IN_V] != 0.0
    share = np.add.reduceat(grown * asked * moving, begins) / (
        np.add.reduceat(grown**2 * moving, begins) + MIN_DENOMINATOR
    )
    stretches = np.diff(np.append(begins, e.time.size))
    settled[:, at.IN_P2] += np.repeat(np.maximum(share, RELATIVE_P2_STEP - 1.0), stretches) * grown
    return settled


def _force_residual(model: Model, e: Experiment, inputs: Array) -> Array:
    """Return the force (n,) in N toward +x that the model lacks for the measured motion."""
    kernel, out = kernel_for(model.effects), np.zeros(e.time.size)
    measured = "a" in e.raw
    a = e.raw["a"] - accelerometer_offset(model, e) if measured else smooth_acceleration(e)
    values, on = kernel.effect_vector(model.effect_values()), kernel.effect_switches(e.active_effects(model.effects))
    still = standstill_speed(e, inputs[:, at.IN_V])
    kernel.functions.run_imposed(e.time, inputs, a, still, True, base_vector(model, e), values, on, out)
    return out - inputs[:, at.IN_FORCE]
