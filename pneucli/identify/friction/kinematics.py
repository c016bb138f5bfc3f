"""Motion and friction of a recording: velocity, acceleration, driving force, and their uncertainty.

Source: thesis 6 (friction from the balance of forces); docs/friction-identification.md.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array, Mask, read_only
from pneucli.errors import InputError
from pneucli.noise import NoiseModel, estimate_noise
from pneucli.recording import Recording, Rig
from pneucli.simulate import layout as at
from pneucli.simulate.build import Kernel
from pneucli.simulate.end_detection import POSITION_SCATTER_SIGMA, Drive, contact_side, detect_ends, end_compliance
from pneucli.simulate.local_polynomials import choose_windows
from pneucli.simulate.model import Model
from pneucli.simulate.motion_smoother import (
    JUMP_ERROR_RATIO,
    integrate_between_rests,
    least_squares_motion,
    rest_mask,
    without_constant_position,
)
from pneucli.simulate.position_smoother import fit_position_smoother
from pneucli.simulate.preparation import fill_gaps
from pneucli.simulate.run import kernel_for, shifted

REMOVED_BALANCES = {
    "mechanics",
    "pressure sensor",
}  # of ports; an accelerometer's bias is found from the motion itself
Smoother = Callable[[Array], Array]
Kinematics = Callable[[Array, Array], tuple[Array, Array]]
REST_SIGMA = 5.0  # standard deviations of the velocity, below which the piston counts as resting
RINGING_RATIO = 1e-3  # of the highest speed: the ringing of the smoothed velocity next to a stop
MIN_NOISE_RATIO = 1e-5  # of a signal's spread: sampling errors of a computed signal exceed smaller noise
MIN_BLOCKS = 10  # of a recording
MAX_DRAWS = 6  # of the sensors' noise
MAX_DRAWN_SAMPLES = 600_000  # over all draws; a long recording needs fewer draws
ACCELERATION_SIGMA = 4.0  # standard deviations of the acceleration, within which its sign is uncertain


@dataclass(frozen=True)
class Motion:
    """Signals of one recording, each of shape (n,), SI; forces act toward +x.

    ``drive`` is every force on the piston except friction and inertia: pressures as faultless sensors would read them,
    a measured force, and the ``load`` of the model's effects (``non_friction``). ``smooth_drive`` and ``smooth_a`` are
    smoothed; ``drive_noise_draws`` (draws, n) is the noise that remains in the smooth drive; ``a`` has no sensor bias.
    ``sigma_v``, ``sigma_a`` (of ``smooth_a``) and ``sigma_drive`` (of ``drive``) are standard deviations,
    ``accelerometer_noise`` that of the accelerometer (0 without one). ``valid`` marks measured samples off the ends of
    the stroke, ``contact`` those on an end, which may carry any force. Smoothing of velocity and force reaches
    ``smoothing_samples`` samples to each side; noise scatters readings of one position within ``position_scatter`` (m).
    """

    recording: Recording
    non_friction: NonFrictionForces
    x: Array
    v: Array
    a: Array
    smooth_a: Array
    drive: Array
    smooth_drive: Array
    load: Array
    drive_noise_draws: Array
    valid: Mask
    contact: Mask
    smoothing_samples: int
    position_scatter: float
    sigma_v: float
    sigma_a: float
    sigma_drive: float
    accelerometer_noise: float

    @property
    def time(self) -> Array:
        """Time stamps in s."""
        return self.recording.time

    @property
    def imposed(self) -> bool:
        """Whether a machine imposed the motion."""
        return self.recording.imposed == "motion"

    @property
    def rest_speed(self) -> float:
        """The speed in m/s below which the piston counts as resting."""
        return max(REST_SIGMA * self.sigma_v, RINGING_RATIO * float(np.abs(self.v).max()))

    @property
    def moving(self) -> Mask:
        """Samples of certain motion: a resolved velocity that keeps its sign as far as smoothing reaches."""
        return self.sliding(self.smoothing_samples)

    def sliding(self, reach: int) -> Mask:
        """Mask samples whose velocity the sensors resolve, with one sign over ``reach`` samples to either side."""
        from scipy.ndimage import maximum_filter1d, minimum_filter1d  # noqa: PLC0415 - slow to import, and only friction asks for it

        direction = np.where(np.abs(self.v) > self.rest_speed, np.sign(self.v), 0.0)
        size = 2 * reach + 1
        forward = minimum_filter1d(direction, size, mode="constant") > 0
        backward = maximum_filter1d(direction, size, mode="constant") < 0
        return np.asarray((forward | backward) & self.valid)

    @cached_property
    def block_length(self) -> float:
        """How long residuals may be correlated, in s: the median duration of a slide, weighted by its length.

        Errors of a friction model return with every slide.
        """
        direction = np.where(self.moving, np.sign(self.v), 0.0)
        edges = np.flatnonzero(np.diff(direction, prepend=0.0, append=0.0))
        durations = np.diff(self.time[np.minimum(edges, direction.size - 1)])
        durations = np.sort(durations[direction[edges[:-1]] != 0.0])
        longest = (self.time[-1] - self.time[0]) / MIN_BLOCKS
        half = np.searchsorted(np.cumsum(durations), 0.5 * durations.sum())
        return float(min(durations[half], longest)) if durations.sum() else float(longest)

    @property
    def branch(self) -> NDArray[np.int8]:
        """1 where the piston certainly accelerates, -1 where it certainly slows, 0 elsewhere, shape (n,)."""
        acceleration_along = np.sign(self.v) * self.smooth_a
        is_certain = np.abs(acceleration_along) > ACCELERATION_SIGMA * self.sigma_a
        return np.where(self.moving & is_certain, np.sign(acceleration_along), 0).astype(np.int8)

    def moved_mass(self, mass: float) -> float:
        """Return the mass in kg that moved in this recording: the rig's, and what was added to it."""
        return mass + self.recording.added_mass

    def friction(self, mass: float) -> Array:
        """Return the friction force in N, positive where it brakes motion toward +x, for the rig's mass in kg."""
        return self.drive - self.moved_mass(mass) * self.a

    def sigma_friction(self, mass: float) -> float:
        """Return the standard deviation of one sample of :meth:`friction` in N."""
        return float(np.hypot(self.sigma_drive, self.moved_mass(mass) * self.accelerometer_noise))


def estimate_motion(recording: Recording, model: Model) -> Motion:
    """Estimate motion and driving force of a recording.

    Sensor faults, forces and mass of the model's effects are removed. A pressure that was not recorded counts as
    ambient.

    Args:
        recording: The recording.
        model: The model with the rig and its effects.

    Returns:
        The motion.

    Raises:
        InputError: Motion or drive was not recorded, a piston area is missing, p2 of a closed chamber is missing, or a
            force depends on a position that was not recorded.

    References:
        Thesis (6.1) to (6.7): measured pressures and acceleration, velocity by integration.
    """
    parts, non_friction, time = _drive_parts(recording, model.rig), NonFrictionForces(model), recording.time
    raw, noise, source = _readings(recording, parts)
    derive, smoothers, a, smoothing_samples = _estimators(recording, raw, noise)

    def drive_force(readings: Mapping[str, Array]) -> Array:
        true_readings = non_friction.corrected_readings(time, readings)
        return np.asarray(sum(gain * (true_readings[n] - zero) for n, (gain, zero) in parts.items()))

    x = raw.get("x", np.full(time.size, np.nan))
    v, smooth_a = derive(raw.get(source, np.zeros(time.size)), a)
    load = _non_friction_force(recording, non_friction, x, v)
    rng = np.random.default_rng(0)
    redrawn = np.empty((int(np.clip(MAX_DRAWN_SAMPLES // time.size, 1, MAX_DRAWS)), time.size))
    draws = ({n: model_of_noise.draw(time, rng) for n, model_of_noise in noise.items()} for _ in redrawn)
    first_draw = next(draws)
    v_error, a_error = derive(*(first_draw.get(n, np.zeros(time.size)) for n in (source, "a")))
    smooth_readings = {n: smoothers[n](raw[n]) for n in parts}
    smooth, rough = drive_force(smooth_readings), drive_force({n: raw[n] for n in parts})
    for out, one in zip(redrawn, chain([first_draw], draws), strict=True):
        out[:] = drive_force({n: y + smoothers[n](one[n]) for n, y in smooth_readings.items()}) - smooth
    drive_error = drive_force({n: raw[n] + first_draw[n] for n in parts}) - rough
    load_error = non_friction.forces(x + first_draw.get("x", 0.0), v + v_error) - load
    accelerometer = "a" in raw  # without one the force is smoothed as the motion is, so that both sides agree
    return Motion(
        recording=recording,
        non_friction=non_friction,
        x=x,
        v=v,
        a=a if accelerometer else smooth_a,
        smooth_a=smooth_a,
        drive=(rough if accelerometer else smooth) + load,
        smooth_drive=smooth + load,
        load=load,
        drive_noise_draws=redrawn,
        valid=np.logical_and.reduce([~np.isnan(recording[n]) for n in raw]),
        contact=np.zeros(time.size, dtype=bool),
        smoothing_samples=smoothing_samples,
        position_scatter=POSITION_SCATTER_SIGMA * noise["x"].rms if "x" in raw else 0.0,
        sigma_v=float(np.std(v_error)),
        sigma_a=float(np.std(a_error)),
        sigma_drive=float(np.hypot(np.std(drive_error), np.std(load_error))),
        accelerometer_noise=noise["a"].rms if accelerometer else 0.0,
    )


def _readings(
    recording: Recording, parts: Iterable[str]
) -> tuple[dict[str, Array], dict[str, NoiseModel], Literal["x", "v"]]:
    """Return the readings of drive and motion without gaps, their noise, and the signal that the motion comes from."""
    raw = {n: fill_gaps(recording.time, recording[n]) for n in (*parts, "x", "v", "a") if n in recording}
    noise = {n: _noise(recording, n, y) for n, y in raw.items()}
    raw = without_constant_position(raw, noise)
    source: Literal["x", "v"] = "x" if "x" in raw else "v"
    return {n: y for n, y in raw.items() if n != "v" or source == "v"}, noise, source


def with_contact(motions: Sequence[Motion], stroke: float | None) -> tuple[Motion, ...]:
    """Mark the samples on the ends of the stroke that the motions of one rig show.

    Args:
        motions: The motions.
        stroke: Stated stroke in m, None where it is not known.

    Returns:
        The motions in order.

    """
    drives = [_drive(m) for m in motions if np.isfinite(m.x).all()]
    ends, compliance = detect_ends(drives, stroke), end_compliance(drives)
    touching = [contact_side(m.x, ends, max(m.position_scatter, compliance)) != 0.0 for m in motions]
    return tuple(replace(m, contact=on, valid=m.valid & ~on) for m, on in zip(motions, touching, strict=True))


def _drive(m: Motion) -> Drive:
    v = np.where(np.abs(m.v) > m.rest_speed, m.v, 0.0)
    return Drive(m.x, v, m.smooth_a, m.smooth_drive, max(m.smoothing_samples, 1), m.position_scatter)


def _non_friction_force(recording: Recording, non_friction: NonFrictionForces, x: Array, v: Array) -> Array:
    load = non_friction.forces(x, v)
    if np.isfinite(load).all():
        return load
    names = ", ".join(e.name for e in non_friction.model.effects if "force" in e.ports)
    raise InputError(
        f"recording {recording.name}", f"x was not recorded, and a force depends on it ({names})", "x", code="E060"
    )


def _noise(recording: Recording, name: str, values: Array) -> NoiseModel:
    """Return a signal's noise, given or estimated, at least ``MIN_NOISE_RATIO`` of its spread (or of its level)."""
    noise = recording.noise.get(name) or estimate_noise(recording.time, values)
    min_noise = MIN_NOISE_RATIO * float(np.std(values) or np.abs(values).max() or 1.0)
    return noise if noise.rms >= min_noise else replace(noise, white=min_noise)


def _drive_parts(recording: Recording, rig: Rig) -> dict[str, tuple[float, float]]:
    """Return gain and zero of each signal that drives the piston."""
    name = f"recording {recording.name}"
    if recording.chamber_2 in ("closed", "valve") and "p1" in recording and "p2" not in recording:
        raise InputError(
            name, f"chamber 2 is {recording.chamber_2}, p2 was not recorded", "p2", "record or state p2", code="E060"
        )
    a1 = rig.piston_area_1 or 0.0
    areas = {"p1": a1, "p2": -(a1 if rig.piston_area_2 is None else rig.piston_area_2)}
    parts = {n: (area, rig.ambient_pressure) for n, area in areas.items() if n in recording and area}
    if "force" in recording:
        parts["force"] = (1.0, 0.0)
    if not parts:
        missing = "rig.cylinder.piston_area_1" if {"p1", "p2"} & set(recording.signals) else "p1, p2 or force"
        raise InputError(name, f"no {missing}", "what drives the piston", f"add {missing}", code="E060")
    return parts


def _estimators(
    recording: Recording, raw: dict[str, Array], noise: dict[str, NoiseModel]
) -> tuple[Kinematics, dict[str, Smoother], Array, int]:
    """Return the map (x, a) -> (v, smoothed a), smoothers by signal, unbiased acceleration, and reach of smoothing."""
    time = recording.time
    if not {"x", "v", "a"} & raw.keys():
        raise InputError(
            f"recording {recording.name}", "neither x, v nor a", "position, velocity or acceleration", code="E060"
        )
    if "a" not in raw and "x" not in raw:
        smooth = choose_windows(raw["v"], noise["v"], recording.period)
        blur = int(np.ceil(smooth.memory / recording.period)) + 1
        return lambda v, _: (smooth(v), smooth.slope(v)), dict.fromkeys(raw, smooth), np.zeros(time.size), blur
    if "a" not in raw:
        smoother = fit_position_smoother(time, raw["x"], noise["x"])
        raw["x"] = raw["x"] + smoother.correction
        smoothing_samples = int(np.ceil(np.pi * smoother.memory / recording.period))
        # the forces too: so both sides of the equation of motion are smoothed alike
        return (
            lambda x, _: smoother(x)[1:],
            dict.fromkeys(raw, lambda y: smoother(y)[0]),
            np.zeros(time.size),
            smoothing_samples,
        )
    smoothers: dict[str, Smoother] = {n: choose_windows(y, noise[n], recording.period) for n, y in raw.items()}
    if "x" in raw:
        velocity = fuse_position_and_acceleration(time, raw["a"], noise["x"].rms, noise["a"].rms)
        bias = velocity(raw["x"], raw["a"])[1]
        derive: Kinematics = lambda x, a: (velocity(x, a)[0], smoothers["a"](a))  # noqa: E731
    elif "v" in raw:
        bias = float(np.mean(raw["a"] - np.gradient(smoothers["v"](raw["v"]), time)))
        derive = lambda v, a: (smoothers["v"](v), smoothers["a"](a))  # noqa: E731
    else:
        rest = rest_mask(time, raw["a"], noise["a"])
        if not rest.any():
            raise InputError(
                f"recording {recording.name}", "never at rest", "x, or rests to integrate from", code="E062"
            )
        bias = float(np.mean(raw["a"][rest]))
        derive = lambda _, a: (integrate_between_rests(time, a, rest), smoothers["a"](a))  # noqa: E731
    return derive, smoothers, raw["a"] - bias, 1


def fuse_position_and_acceleration(
    time: Array, a: Array, x_noise: float, a_noise: float
) -> Callable[[Array, Array], tuple[Array, float]]:
    """Build the map from position and acceleration to a velocity without drift, and the accelerometer's bias.

    Least squares over position, velocity and one bias: x differs by its noise, and the velocity follows the
    acceleration, linear between samples, except for its noise and for jumps between two samples (break-away and stop),
    which ``a`` locates.

    Args:
        time: Stamps in s, shape (n,).
        a: Acceleration in m/s^2, shape (n,).
        x_noise: Standard deviation of x in m.
        a_noise: Standard deviation of a in m/s^2.

    Returns:
        The map from x and a, each (n,), to velocity in m/s and bias in m/s^2.

    """
    dt = np.diff(time)
    tolerance = dt * (a_noise + JUMP_ERROR_RATIO * np.abs(np.diff(a)))  # m/s a step
    weights = 1.0 / x_noise, 1.0 / tolerance, 2.0 / (tolerance * dt)
    return lambda x, a: least_squares_motion(dt, *weights, x, a)[1:]


@dataclass(frozen=True)
class NonFrictionForces:
    """The equations of a model's effects at the ports of ``REMOVED_BALANCES``."""

    model: Model

    @property
    def effect_names(self) -> tuple[str, ...]:
        """The effects whose forces are removed before friction is identified."""
        return tuple(e.name for e in self.model.effects if REMOVED_BALANCES & e.balances)

    @property
    def added_mass(self) -> float:
        """The mass in kg that effects add to the rig's."""
        return self.model.sum_of_port("mass")

    def corrected_readings(self, time: Array, readings: Mapping[str, Array]) -> dict[str, Array]:
        """Return readings, each (n,), with the faults of the sensors of p1, p2 and force removed."""
        inputs = np.full((time.size, len(at.INPUTS)), self.model.rig.ambient_pressure)
        columns = {"p1": at.IN_P1, "p2": at.IN_P2}
        for name in columns.keys() & readings.keys():
            inputs[:, columns[name]] = readings[name]
        self._kernel.functions.run_true_pressures(read_only(time), inputs, *self._vectors)
        corrected = {n: inputs[:, columns[n]] if n in columns else y for n, y in readings.items()}
        if "force" in corrected and (delay := self.model.sum_of_port("force_delay")):
            corrected["force"] = shifted(time, corrected["force"], delay)
        return corrected

    def forces(self, x: Array, v: Array) -> Array:
        """Return the effects' forces toward +x in N, shape (n,), at positions in m and velocities in m/s."""
        out = np.zeros(x.size)
        self._kernel.functions.run_forces(x, v, *self._vectors, out)
        return out

    def simulate_driven(
        self, time: Array, drive: Array, x: Array, start: float, mass: float, tables: Array, step: float, parts: int
    ) -> Array:
        """Return v (m/s) and a (m/s^2), shape (2, n); see :mod:`pneucli.simulate.kernel.table_friction`."""
        out = np.zeros((2, time.size))
        self._kernel.functions.run_table_friction(
            time, drive, x, float(start), float(mass), tables, float(step), parts, *self._vectors, out
        )
        return out

    @property
    def _kernel(self) -> Kernel:
        return kernel_for(self.model.effects)

    @cached_property
    def _vectors(self) -> tuple[Array, Array, NDArray[np.uint8]]:
        base = self.model.base_values()
        return (
            np.array([base[name] for name in at.BASE_NAMES]),
            self._kernel.effect_vector(self.model.effect_values()),
            self._kernel.effect_switches([e.name for e in self.model.effects]),
        )
