"""What a recording says of motion and friction: velocity, acceleration, driving force, and how sure they are."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from pneucli.errors import InputError
from pneucli.identify.friction.non_friction_forces import NonFrictionForces
from pneucli.identify.friction.velocity_estimation import Smoother, fuse_position_and_acceleration
from pneucli.noise import NoiseModel, estimate_noise
from pneucli.recording import Recording, Rig
from pneucli.simulate.local_polynomials import choose_windows
from pneucli.simulate.model import Model
from pneucli.simulate.position_smoother import fit_position_smoother
from pneucli.simulate.preparation import fill_gaps
from pneucli.simulate.velocity_integration import integrate_between_rests, rest_mask, without_constant_position

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Kinematics = Callable[[Array, Array], tuple[Array, Array]]

REST_SIGMA = 5.0  # standard deviations of the velocity, below which a piston counts as resting
RINGING_RATIO = 1e-3  # of the highest speed: what smoothing leaves of it beside a stop
MIN_NOISE_RATIO = 1e-5  # of a signal's spread: below, a computed signal's sampling errs more than its sensor
MIN_BLOCKS = 10  # that a recording falls into at least
MAX_DRAWS = 6  # of the sensors' noise, at most
MAX_DRAWN_SAMPLES = 600_000  # samples of them: what so many tell, more draws of a long recording do not tell better
ACCELERATION_SIGMA = 4.0  # standard deviations of the acceleration, within which it neither speeds up nor slows


@dataclass(frozen=True)
class Motion:
    """Signals of one recording, each of shape (n,), SI; forces toward +x.

    ``drive`` is all that acts on the piston but friction and inertia: pressures as true sensors would read them, a
    measured force, and the ``load`` that the model's effects state (``non_friction``). ``smooth_drive`` and
    ``smooth_a`` are freed from noise, ``drive_noise_draws`` (draws, n) is what the sensors' noise leaves in the smooth
    drive; ``a`` is without the sensor's bias. ``sigma_v``, ``sigma_a`` (of ``smooth_a``) and ``sigma_drive`` (of what
    is not smoothed) are standard deviations, ``accelerometer_noise`` that of the accelerometer (0: none). ``valid``:
    measured. Velocity and force are smoothed over ``smoothing_samples`` samples to each side.
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
    smoothing_samples: int
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
        """Whether the motion was forced on the piston."""
        return self.recording.imposed == "motion"

    @property
    def rest_speed(self) -> float:
        """The velocity in m/s below which the piston counts as resting."""
        return max(REST_SIGMA * self.sigma_v, RINGING_RATIO * float(np.abs(self.v).max()))

    @property
    def moving(self) -> Mask:
        """Samples of certain motion: velocities that the sensors resolve, of one sign as far as smoothing reaches."""
        return self.sliding(self.smoothing_samples)

    def sliding(self, reach: int) -> Mask:
        """Return where the sensors resolve a velocity, and one of the same sign ``reach`` samples to either side."""
        way = np.where(np.abs(self.v) > self.rest_speed, np.sign(self.v), 0.0)
        size = 2 * reach + 1
        forward = minimum_filter1d(way, size, mode="constant") > 0
        backward = maximum_filter1d(way, size, mode="constant") < 0
        return np.asarray((forward | backward) & self.valid)

    @cached_property
    def block_length(self) -> float:
        """How long residuals may be correlated, in s: a slide in one direction (half of all motion is in ones as long).

        What a law of friction does not say comes back with every slide.
        """
        way = np.where(self.moving, np.sign(self.v), 0.0)
        edges = np.flatnonzero(np.diff(way, prepend=0.0, append=0.0))
        lasting = np.diff(self.time[np.minimum(edges, way.size - 1)])
        lasting = np.sort(lasting[way[edges[:-1]] != 0.0])
        most = (self.time[-1] - self.time[0]) / MIN_BLOCKS
        half = np.searchsorted(np.cumsum(lasting), 0.5 * lasting.sum())
        return float(min(lasting[half], most)) if lasting.sum() else float(most)

    @property
    def branch(self) -> NDArray[np.int8]:
        """1 where the piston speeds up for certain, -1 where it slows, 0 where that is open, shape (n,)."""
        along = np.sign(self.v) * self.smooth_a
        sure = np.abs(along) > ACCELERATION_SIGMA * self.sigma_a
        return np.where(self.moving & sure, np.sign(along), 0).astype(np.int8)

    def friction(self, mass: float) -> Array:
        """Return the friction force in N, positive where it brakes motion toward +x, for a moving mass in kg."""
        return self.drive - mass * self.a

    def sigma_friction(self, mass: float) -> float:
        """Return the standard deviation of one sample of :meth:`friction` in N."""
        return float(np.hypot(self.sigma_drive, mass * self.accelerometer_noise))


def estimate_motion(recording: Recording, model: Model) -> Motion:
    """Return motion and driving force of a recording with x, v, a or several, and p1, p2, force or several of them.

    What the model's effects state of sensors, forces and mass is taken out. A pressure that was not recorded counts as
    ambient. Raises InputError where motion or drive were not recorded, where pressures are the drive but the piston's
    area is missing, where p2 is missing of a chamber that is not open, and where a force depends on a position that
    was not recorded.
    """
    parts, beside, time = _drive_parts(recording, model.rig), NonFrictionForces(model), recording.time
    raw = {n: fill_gaps(time, recording[n]) for n in (*parts, "x", "v", "a") if n in recording}
    noise = {n: _noise(recording, n, y) for n, y in raw.items()}
    raw = without_constant_position(raw, noise)
    if "x" in raw:
        raw.pop("v", None)
    source = "x" if "x" in raw else "v"
    derive, smoothers, a, blur = _estimators(recording, raw, noise)

    def push(readings: Mapping[str, Array]) -> Array:
        true = beside.corrected_readings(time, readings)
        return np.asarray(sum(gain * (true[n] - zero) for n, (gain, zero) in parts.items()))

    x = raw.get("x", np.full(time.size, np.nan))
    v, smooth_a = derive(raw.get(source, np.zeros(time.size)), a)
    load = _non_friction_force(recording, beside, x, v)
    rng = np.random.default_rng(0)
    redrawn = np.empty((int(np.clip(MAX_DRAWN_SAMPLES // time.size, 1, MAX_DRAWS)), time.size))
    draws = ({n: its.draw(time, rng) for n, its in noise.items()} for _ in redrawn)
    first = next(draws)
    v_error, a_error = derive(*(first.get(n, np.zeros(time.size)) for n in (source, "a")))
    quiet = {n: smoothers[n](raw[n]) for n in parts}
    smooth, rough = push(quiet), push({n: raw[n] for n in parts})
    for out, one in zip(redrawn, chain([first], draws), strict=True):
        out[:] = push({n: y + smoothers[n](one[n]) for n, y in quiet.items()}) - smooth
    missed = push({n: raw[n] + first[n] for n in parts}) - rough
    moved = beside.forces(x + first.get("x", 0.0), v + v_error) - load
    # without an accelerometer the force is smoothed as the motion is, so that both sides of the equation agree
    accelerometer = "a" in raw
    return Motion(
        recording=recording,
        non_friction=beside,
        x=x,
        v=v,
        a=a if accelerometer else smooth_a,
        smooth_a=smooth_a,
        drive=(rough if accelerometer else smooth) + load,
        smooth_drive=smooth + load,
        load=load,
        drive_noise_draws=redrawn,
        valid=np.logical_and.reduce([~np.isnan(recording[n]) for n in raw]),
        smoothing_samples=blur,
        sigma_v=float(np.std(v_error)),
        sigma_a=float(np.std(a_error)),
        sigma_drive=float(np.hypot(np.std(missed), np.std(moved))),
        accelerometer_noise=noise["a"].rms if accelerometer else 0.0,
    )


def _non_friction_force(recording: Recording, beside: NonFrictionForces, x: Array, v: Array) -> Array:
    load = beside.forces(x, v)
    if np.isfinite(load).all():
        return load
    names = ", ".join(e.name for e in beside.model.effects if "force" in e.ports)
    raise InputError(f"recording {recording.name}", f"x was not recorded, and a force depends on it ({names})", "x")


def _noise(recording: Recording, name: str, values: Array) -> NoiseModel:
    """Return a signal's noise, as given or estimated, but no less than ``MIN_NOISE_RATIO`` of its spread (or of its level)."""
    given = recording.noise.get(name) or estimate_noise(recording.time, values)
    least = MIN_NOISE_RATIO * float(np.std(values) or np.abs(values).max() or 1.0)
    return given if given.rms >= least else replace(given, white=least)


def _drive_parts(recording: Recording, rig: Rig) -> dict[str, tuple[float, float]]:
    """Return gain and zero of every signal that drives the piston."""
    name = f"recording {recording.name}"
    if recording.chamber_2 in ("closed", "valve") and "p1" in recording and "p2" not in recording:
        raise InputError(name, f"chamber 2 is {recording.chamber_2}, p2 was not recorded", "p2", "record or state p2")
    a1 = rig.piston_area_1 or 0.0
    areas = {"p1": a1, "p2": -(a1 if rig.piston_area_2 is None else rig.piston_area_2)}
    parts = {n: (area, rig.ambient_pressure) for n, area in areas.items() if n in recording and area}
    if "force" in recording:
        parts["force"] = (1.0, 0.0)
    if not parts:
        missing = "rig.cylinder.piston_area_1" if {"p1", "p2"} & set(recording.signals) else "p1, p2 or force"
        raise InputError(name, f"no {missing}", "what drives the piston", f"add {missing}")
    return parts


def _estimators(
    recording: Recording, raw: dict[str, Array], noise: dict[str, NoiseModel]
) -> tuple[Kinematics, dict[str, Smoother], Array, int]:
    """Return the map (x, a) -> (v, smoothed a), each signal's smoother, the acceleration without bias, and the blur."""
    time = recording.time
    if not {"x", "v", "a"} & raw.keys():
        raise InputError(f"recording {recording.name}", "neither x, v nor a", "position, velocity or acceleration")
    if "a" not in raw and "x" not in raw:
        smooth = choose_windows(raw["v"], noise["v"], recording.period)
        blur = int(np.ceil(smooth.memory / recording.period)) + 1
        return lambda v, _: (smooth(v), smooth.slope(v)), dict.fromkeys(raw, smooth), np.zeros(time.size), blur
    if "a" not in raw:
        smoother = fit_position_smoother(time, raw["x"], noise["x"])
        blur = int(np.ceil(np.pi * smoother.memory / recording.period))
        # the forces too: so both sides of the equation of motion are smoothed alike
        return lambda x, _: smoother(x)[1:], dict.fromkeys(raw, lambda y: smoother(y)[0]), np.zeros(time.size), blur
    fits: dict[str, Smoother] = {n: choose_windows(y, noise[n], recording.period) for n, y in raw.items()}
    if "x" in raw:
        velocity = fuse_position_and_acceleration(time, raw["a"], noise["x"].rms, noise["a"].rms)
        bias = velocity(raw["x"], raw["a"])[1]
        derive: Kinematics = lambda x, a: (velocity(x, a)[0], fits["a"](a))  # noqa: E731
    elif "v" in raw:
        bias = float(np.mean(raw["a"] - np.gradient(fits["v"](raw["v"]), time)))
        derive = lambda v, a: (fits["v"](v), fits["a"](a))  # noqa: E731
    else:
        rest = rest_mask(time, raw["a"], noise["a"])
        if not rest.any():
            raise InputError(f"recording {recording.name}", "never at rest", "x, or rests to integrate from")
        bias = float(np.mean(raw["a"][rest]))
        derive = lambda _, a: (integrate_between_rests(time, a, rest), fits["a"](a))  # noqa: E731
    return derive, fits, raw["a"] - bias, 1
