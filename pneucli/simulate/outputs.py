"""Simulate the channels that are compared, filtered as the comparison filters, and estimate an unmeasured p2."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pneucli.arrays import Array
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.force_clock import force_delay, recorded_late, with_force_in_time
from pneucli.simulate.imposed_motion import motion_inputs, standstill_speed
from pneucli.simulate.model import Model
from pneucli.simulate.run import base_vector, kernel_for, read_only, simulate, with_p2

RELATIVE_P2_STEP = 1e-3  # of the start, for a difference quotient
MIN_DENOMINATOR = 1e-300


def simulate_outputs(
    model: Model, experiment: Experiment, inputs: Array | None = None, noise: Mapping[str, Array] | None = None
) -> dict[str, Array]:
    """Simulate the channels that are compared.

    Args:
        model: The model.
        experiment: The experiment.
        inputs: Inputs in place of the experiment's own, shape (n, 8).
        noise: Noise added to an imposed motion, by signal, each (n,).

    Returns:
        Channels in SI units, each (n,), low-passed where the comparison filters.
    """
    if experiment.recording.imposed == "motion":
        return {"force": experiment.low_passed(required_force(model, experiment, noise))}
    if experiment.infers_p2:
        inputs = with_estimated_p2(model, experiment, experiment.inputs if inputs is None else inputs)
    raw = simulate(model, experiment, inputs)
    return {channel: experiment.low_passed(raw[channel].copy()) for channel in experiment.channels}


def required_force(model: Model, experiment: Experiment, noise: Mapping[str, Array] | None = None) -> Array:
    """Return the force that the model needs for the measured motion.

    Args:
        model: The model.
        experiment: An experiment with an imposed motion.
        noise: Noise added to the motion, by signal, each (n,).

    Returns:
        Force in N, shape (n,): the driving force where it was measured, then less the net force of the pressures; else
        the net force of the pressures.

    References:
        Thesis 6.1-6.7.
    """
    kernel = kernel_for(model.effects)
    inputs, a, still = experiment.motion_inputs if noise is None else motion_inputs(experiment, noise)
    if "a" in experiment.raw:
        a = a - accelerometer_offset(model, experiment)
    out = np.zeros(experiment.time.size)
    base, th = base_vector(model, experiment), kernel.effect_vector(model.effect_values())
    on = kernel.effect_switches(experiment.active_effects(model.effects))
    driven = "force" in experiment.recording
    kernel.functions.run_imposed(read_only(experiment.time), inputs, a, still, driven, base, th, on, out)
    delay = force_delay(model, experiment)
    return recorded_late(experiment, out, inputs[:, at.IN_V], delay) if delay else out


def accelerometer_offset(model: Model, experiment: Experiment) -> float:
    """Return the reading of the model's accelerometer at rest.

    Args:
        model: The model.
        experiment: The experiment.

    Returns:
        Reading in m/s^2.
    """
    reading = 0.0
    for effect in model.effects:
        if "read_a" in effect.ports and effect.name in experiment.active_effects((effect,)):
            reading = float(effect.ports["read_a"](reading, *model.effect_parameters(effect)))  # type: ignore[arg-type]
    return reading


def with_estimated_p2(model: Model, experiment: Experiment, inputs: Array) -> Array:
    """Return inputs with the p2 of the model, started so that the force balance holds best.

    The start of each segment between gaps minimises the squared residual of the force balance for the measured motion.
    p2 is linear in its start while the gas is trapped, and nearly so while a valve vents it.

    Args:
        model: The model.
        experiment: An experiment without a sensor of p2.
        inputs: Inputs, shape (n, 8).

    Returns:
        Inputs with p2 in Pa, shape (n, 8).

    References:
        docs/method.md, residual models: force balance with an inferred p2.
    """
    e, area_2 = experiment, experiment.rig.piston_areas[1]
    shifted, estimate = inputs.copy(), with_p2(model, e, inputs)
    shifted[:, at.IN_P2] *= 1.0 + RELATIVE_P2_STEP
    sensitivity = (with_p2(model, e, shifted) - estimate)[:, at.IN_P2] / RELATIVE_P2_STEP
    missing = -_force_residual(model, e, estimate) / area_2
    begins, moving = e.gap_ends, (inputs[:, at.IN_V] != 0.0) & e.is_free
    share = np.add.reduceat(sensitivity * missing * moving, begins) / (
        np.add.reduceat(sensitivity**2 * moving, begins) + MIN_DENOMINATOR
    )
    lengths = np.diff(np.append(begins, e.time.size))
    estimate[:, at.IN_P2] += np.repeat(np.maximum(share, RELATIVE_P2_STEP - 1.0), lengths) * sensitivity
    return estimate


def _force_residual(model: Model, e: Experiment, inputs: Array) -> Array:
    """Return the residual of the force balance (n,) in N toward +x for the measured motion."""
    kernel, out = kernel_for(model.effects), np.zeros(e.time.size)
    a = e.acceleration - (accelerometer_offset(model, e) if "a" in e.raw else 0.0)
    values, on = kernel.effect_vector(model.effect_values()), kernel.effect_switches(e.active_effects(model.effects))
    still = standstill_speed(e, inputs[:, at.IN_V])
    kernel.functions.run_imposed(read_only(e.time), inputs, a, still, True, base_vector(model, e), values, on, out)
    return out - with_force_in_time(model, e, inputs)[:, at.IN_FORCE]
