"""Simulate the channels that are compared, filtered alike, with unmeasured pressures estimated, and their noise.

Sensor noise is propagated through the same smoothing and simulation as the measurement: it says how far the readings of
a run deviate from a correct model. Smoothing is linear, so the draws need no true signal.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from pneucli.arrays import Array, read_only
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment, motion_inputs, standstill_speed
from pneucli.simulate.model import Model
from pneucli.simulate.run import (
    base_vector,
    force_delay,
    kernel_for,
    recorded_late,
    simulate,
    with_force_in_time,
    with_inferred_pressures,
)

RELATIVE_START_STEP = 1e-3  # of the start, for a difference quotient; and the least start


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
    if experiment.inferred_pressures:
        inputs = with_estimated_pressures(model, experiment, experiment.inputs if inputs is None else inputs)
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


def with_estimated_pressures(model: Model, experiment: Experiment, inputs: Array) -> Array:
    """Return inputs with the unmeasured pressures of the model, started so that the force balance holds best.

    The starts of each segment between gaps minimise the squared residual of the force balance for the measured motion,
    beside a prior as wide as the starts themselves: the motion may tell only one combination of two. A pressure is
    linear in its start while the gas is trapped, and nearly so while a valve vents it.

    Args:
        model: The model.
        experiment: An experiment without a sensor of p1 or p2.
        inputs: Inputs, shape (n, 8).

    Returns:
        Inputs with these pressures in Pa, shape (n, 8).

    References:
        docs/method.md, residual models: force balance with inferred pressures.
    """
    e, estimate = experiment, with_inferred_pressures(model, experiment, inputs)
    gains = dict(zip(("p1", "p2"), e.rig.piston_areas * np.array([1.0, -1.0]), strict=True))
    columns = {name: at.INPUTS.index(name) for name in e.inferred_pressures}
    changes = {}
    for name, column in columns.items():
        shifted = inputs.copy()
        shifted[:, column] *= 1.0 + RELATIVE_START_STEP
        changes[name] = (with_inferred_pressures(model, e, shifted) - estimate) / RELATIVE_START_STEP
    moving = (inputs[:, at.IN_V] != 0.0) & e.is_free
    pushes = [moving * sum(gains[n] * change[:, c] for n, c in columns.items()) for change in changes.values()]
    missing = moving * _force_residual(model, e, estimate)
    for segment in np.split(np.arange(e.time.size), e.gap_ends[1:]):
        design = np.array([push[segment] for push in pushes])
        prior = np.mean(missing[segment] ** 2) * np.eye(len(design))
        shares = np.linalg.lstsq(design @ design.T + prior, design @ missing[segment])[0]
        for share, change in zip(np.maximum(shares, RELATIVE_START_STEP - 1.0), changes.values(), strict=True):
            for column in columns.values():
                estimate[segment, column] += share * change[segment, column]
    return estimate


def _force_residual(model: Model, e: Experiment, inputs: Array) -> Array:
    """Return the residual of the force balance (n,) in N toward +x for the measured motion."""
    kernel, out = kernel_for(model.effects), np.zeros(e.time.size)
    a = e.acceleration - (accelerometer_offset(model, e) if "a" in e.raw else 0.0)
    values, on = kernel.effect_vector(model.effect_values()), kernel.effect_switches(e.active_effects(model.effects))
    still = standstill_speed(e, inputs[:, at.IN_V])
    kernel.functions.run_imposed(read_only(e.time), inputs, a, still, True, base_vector(model, e), values, on, out)
    return out - with_force_in_time(model, e, inputs)[:, at.IN_FORCE]


NOISE_SEED = 20151


def sample_deviations(model: Model, experiment: Experiment, draws: int, seed: int = NOISE_SEED) -> dict[str, Array]:
    """Draw deviations (measured - model) of a correct model.

    Args:
        model: The model.
        experiment: The experiment.
        draws: Number of draws.
        seed: Seed of the generator.

    Returns:
        Deviations by channel in SI units, each (draws, n).
    """
    deviations = list(iterate_deviations(model, experiment, draws, seed))
    return {channel: np.array([one[channel] for one in deviations]) for channel in experiment.channels}


def iterate_deviations(
    model: Model, experiment: Experiment, draws: int, seed: int = NOISE_SEED
) -> Iterator[dict[str, Array]]:
    """Yield deviations (measured - model) of a correct model.

    Args:
        model: The model.
        experiment: The experiment.
        draws: Number of draws.
        seed: Seed of the generator.

    Returns:
        Iterator over draws: deviations by channel in SI units, each (n,).
    """
    has_bristles = model.sum_of_port("bristle_stiffness") > 0.0  # springs that are stiff for the longer steps
    simulated = experiment if has_bristles else experiment.for_differences
    nominal = simulate_outputs(model, simulated)
    for noise, inputs in experiment.noise_draws(draws, seed):
        disturbed = simulate_outputs(model, simulated, inputs, noise)
        yield {
            channel: experiment.low_passed(_reading_noise(experiment, channel, noise, inputs))
            - (disturbed[channel] - nominal[channel])
            for channel in experiment.channels
        }


def _reading_noise(experiment: Experiment, channel: str, noise: dict[str, Array], inputs: Array) -> Array:
    if channel in noise:
        return noise[channel]
    if channel == "v":
        return np.asarray(inputs[:, at.IN_V] - experiment.inputs[:, at.IN_V])
    return experiment.net_pressure_noise(noise)
