"""Prepare a recording for simulation: fill gaps, estimate noise, smooth the inputs, choose the restarts."""

from collections.abc import Mapping

import numpy as np

from pneucli.arrays import Array
from pneucli.noise import NoiseModel, estimate_noise
from pneucli.recording import Recording, Rig
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment, draw_sensor_noise, restart_samples
from pneucli.simulate.kernel_settings import recording_flags
from pneucli.simulate.local_polynomials import LocalPolynomialSmoother, choose_windows
from pneucli.simulate.motion_smoother import (
    MeasuredMotion,
    MotionSmoother,
    estimate_acceleration_delay,
    integrated_motion,
    smooth_inputs,
    without_constant_position,
)
from pneucli.simulate.position_smoother import fit_position_smoother

SMOOTHED_PRESSURES = ("p1", "p2", "p_supply")
MIN_SMOOTHED_SAMPLES = 80  # samples; fewer are taken as they are
MIN_RELATIVE_NOISE = {"x": 1e-8, "a": 1e-4}  # of a signal's spread: no sensor of a rig is surer than that
DEFAULT_NOISE = {"x": 1e-9, "a": 1e-3}  # m and m/s^2, the noise of a sensor that never changes: any will do
STANDSTILL_SIGMA = 4.0  # standard deviations of the smoothed velocity, below which the piston is taken to rest


def prepare(recording: Recording, rig: Rig, horizon: float | None, low_pass: float | None = None) -> Experiment:
    """Prepare a recording for simulation.

    Args:
        recording: The recording as it was read.
        rig: The rig on which it was made.
        horizon: Time in s after which the model restarts from the smoothed measurement; None: at the start and after
            gaps only.
        low_pass: Frequency in Hz of the filter behind which model and measurement are compared; None: no filter.

    Returns:
        The recording with gaps filled, noise estimated where the recording states none, inputs smoothed, signals that
        no sensor read substituted, and restarts chosen.

    """
    time = recording.time
    raw = {name: fill_gaps(time, values) for name, values in recording.signals.items()}
    noise = {n: recording.noise.get(n) or estimate_noise(time, recording[n]) for n in raw}
    if recording.kind.motion_signals:
        raw = without_constant_position(raw, noise)
    smoothers = _smoothers(recording, raw, noise)
    motion_smoother = integrated_motion(recording, raw, noise, smoothers) or _motion_smoother(time, raw, noise)
    if isinstance(motion_smoother, MotionSmoother):
        raw["a"] = _without_delay(raw["x"], raw["a"], recording.period, motion_smoother)
    motion = motion_smoother.motion(motion_smoother.corrected(raw)) if motion_smoother else None
    inputs = smooth_inputs(raw, smoothers, motion, time)
    standstill_speed = 0.0
    if motion_smoother is not None:
        drawn = draw_sensor_noise(noise, time, np.random.default_rng(0))
        noise_speed = float(np.std(motion_smoother.motion(drawn)[1]))
        standstill_speed = STANDSTILL_SIGMA * noise_speed
        inputs[np.abs(inputs[:, at.IN_V]) < standstill_speed, at.IN_V] = 0.0
    if rig.command_sign(recording.chamber) < 0.0:
        inputs[:, at.IN_U] = 2.0 * rig.valve_null - inputs[:, at.IN_U]
    substitute_missing_inputs(inputs, recording, rig)
    experiment = Experiment(
        recording,
        rig,
        raw,
        noise,
        smoothers,
        motion_smoother,
        inputs,
        restart_samples(time, None),
        recording_flags(recording, rig, raw, noise),
        low_pass,
        standstill_speed,
    )
    return experiment.with_restarts(horizon)


def fill_gaps(time: Array, values: Array) -> Array:
    """Fill missing samples by linear interpolation over time.

    Args:
        time: Time stamps in s, shape (n,).
        values: Signal, NaN where a sample is missing, shape (n,).

    Returns:
        The signal without NaN, shape (n,); the same array where nothing is missing.

    >>> fill_gaps(np.array([0.0, 1.0, 4.0]), np.array([2.0, np.nan, 6.0]))
    array([2., 3., 6.])

    """
    measured = ~np.isnan(values)
    return values if measured.all() else np.interp(time, time[measured], values[measured])


def _smoothers(
    recording: Recording, raw: Mapping[str, Array], noise: Mapping[str, NoiseModel]
) -> dict[str, LocalPolynomialSmoother]:
    if recording.time.size < MIN_SMOOTHED_SAMPLES:
        return {}
    motion = ("v",) if recording.kind.motion_signals and "x" not in raw else ()
    smoothed = [name for name in (*SMOOTHED_PRESSURES, *motion, "force") if name in raw]
    return {name: choose_windows(raw[name], noise[name], recording.period) for name in smoothed}


def _motion_smoother(time: Array, raw: Mapping[str, Array], noise: Mapping[str, NoiseModel]) -> MeasuredMotion | None:
    if "x" not in raw:
        return None
    if time.size < MIN_SMOOTHED_SAMPLES or ("a" not in raw and not noise["x"].rms):
        return MeasuredMotion(time)
    if "a" not in raw:
        return fit_position_smoother(time, raw["x"], noise["x"])
    x_noise, a_noise = (
        max(noise[name].rms, share * float(np.std(raw[name])) or DEFAULT_NOISE[name])
        for name, share in MIN_RELATIVE_NOISE.items()
    )
    return MotionSmoother(time, x_noise, a_noise)


def _without_delay(x: Array, a: Array, period: float, smoother: MotionSmoother) -> Array:
    """Return the acceleration (n,) shifted forward by its delay behind the position."""
    delay = estimate_acceleration_delay(x, a, period, smoother.memory)
    return np.append(a[delay:], np.full(delay, a[-1])) if delay else a


def substitute_missing_inputs(inputs: Array, recording: Recording, rig: Rig) -> None:
    """Fill in inputs that were not measured, in place.

    Pressures are ambient, the supply pressure is the stated one. p2 of a closed chamber is that of trapped gas, as much
    as the force balance of the moving piston needs; behind a valve p2 holds the piston at the start. Both need p1, x
    and the areas, the first also the stroke. Without any pressure p1 of an axis is amid ambient and supply.

    Args:
        inputs: Inputs in the kernel's layout, shape (n, 8).
        recording: The recording.
        rig: The rig.
    """
    for column, name, value in (
        (at.IN_P1, "p1", rig.ambient_pressure),
        (at.IN_P2, "p2", rig.ambient_pressure),
        (at.IN_SUPPLY, "p_supply", rig.supply_pressure or rig.ambient_pressure),
    ):
        if name not in recording:
            inputs[:, column] = value
    if recording.kind.axis and "p1" not in recording:
        inputs[:, at.IN_P1] = 0.5 * (rig.ambient_pressure + inputs[:, at.IN_SUPPLY].mean())
    if (
        "x" in recording
        and (recording.kind.axis or "p1" in recording)
        and "p2" not in recording
        and all(rig.piston_areas)
    ):
        if recording.chamber_2 == "valve":
            inputs[:, at.IN_P2] = _balancing_p2(inputs, rig)
        elif recording.chamber_2 == "closed" and rig.stroke:
            inputs[:, at.IN_P2] = _trapped_gas_p2(inputs, recording.time, rig, rig.stroke)


def _balancing_p2(inputs: Array, rig: Rig) -> float:
    """Return the pressure in Pa that holds the piston at the start."""
    area_1, area_2 = rig.piston_areas
    return max(rig.ambient_pressure + area_1 / area_2 * (float(inputs[0, at.IN_P1]) - rig.ambient_pressure), 0.0)


def _trapped_gas_p2(inputs: Array, time: Array, rig: Rig, stroke: float) -> Array:
    """Return the pressure (n,) of gas trapped in chamber 2, from the force balance while the piston moves.

    The gas, the mass, dry and viscous friction balance the force of p1; each of them can only resist.
    """
    from scipy.optimize import nnls  # noqa: PLC0415 - slow to import, and few recordings lack a pressure

    area_1, area_2 = rig.piston_areas
    x, v = inputs[:, at.IN_X], inputs[:, at.IN_V]
    volume = np.maximum(area_2 * (stroke - x), 0.0) + (rig.dead_volume_2 or 0.0)
    rise = (float(volume.max()) / volume) ** (rig.polytropic_exponent or rig.heat_capacity_ratio)
    force = area_1 * (inputs[:, at.IN_P1] - rig.ambient_pressure) + inputs[:, at.IN_FORCE]
    design = np.stack([area_2 * rise, np.sign(v), v, np.gradient(v, time)], axis=1)
    moving = v != 0.0
    sizes = np.abs(design[moving]).max(axis=0, initial=1e-300)
    coefficients = nnls(design[moving] / sizes, force[moving] + area_2 * rig.ambient_pressure)[0] / sizes
    return np.asarray(coefficients[0] * rise)
