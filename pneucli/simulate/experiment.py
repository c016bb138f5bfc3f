"""An experiment: a recording with smoothed inputs, restarts, switches, and the measurements to compare with."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.experiments import Part
from pneucli.noise import NoiseModel
from pneucli.physics.declaration import Effect
from pneucli.physics.ports import LEAK_PORTS
from pneucli.recording import Recording, Rig
from pneucli.simulate import layout as at
from pneucli.simulate.end_detection import POSITION_SCATTER_SIGMA, contact_side
from pneucli.simulate.kernel_settings import GIVEN_MOTION_STEPS, max_filling_step, max_motion_step
from pneucli.simulate.local_polynomials import LocalPolynomialSmoother, choose_windows
from pneucli.simulate.motion_smoother import MeasuredMotion, Motion, MotionSmoother, missed_speed, smooth_inputs

Draw = TypeVar("Draw")

MAX_CACHE_BYTES = 16 << 20  # bytes, of one recording


def draw_sensor_noise(noise: Mapping[str, NoiseModel], time: Array, rng: np.random.Generator) -> dict[str, Array]:
    """Draw the noise of every sensor once.

    Args:
        noise: Noise of each sensor.
        time: Time stamps in s, shape (n,).
        rng: Generator of random numbers.

    Returns:
        Noise of each sensor in the unit of its signal, each (n,).
    """
    return {name: model.draw(time, rng) for name, model in noise.items()}


def cache_draws(
    cache: dict[tuple[int, int], list[Draw]], key: tuple[int, int], drawn: Iterable[Draw], size: int
) -> Iterable[Draw]:
    """Return cached draws, or cache new ones where they fit.

    Args:
        cache: Draws by key.
        key: Number of draws and seed.
        drawn: New draws.
        size: Number of floats of all draws.

    Returns:
        The draws of the key.
    """
    if key in cache:
        return cache[key]
    return cache.setdefault(key, list(drawn)) if 8 * size <= MAX_CACHE_BYTES else drawn


MAX_GAP_PERIODS = 20  # sampling periods


def restart_samples(time: Array, horizon: float | None, shortest: float = 0.0) -> NDArray[np.int64]:
    """Return the samples at which the model restarts: periodically, and after each gap of the record.

    Args:
        time: Time stamps in s, shape (n,).
        horizon: Time in s between restarts; None: at the start only.
        shortest: Shortest time in s between restarts.

    Returns:
        Indices of samples, rising, the first 0.

    >>> restart_samples(np.arange(0.0, 1.0, 0.01), 0.25)
    array([ 0, 25, 50, 75])
    """
    period = float(np.median(np.diff(time)))
    gaps = 1 + np.flatnonzero(np.diff(time) > MAX_GAP_PERIODS * period)
    grid = np.arange(0.0, time[-1] - time[0], max(horizon, shortest)) if horizon else np.zeros(1)
    return np.unique(np.concatenate([np.searchsorted(time, time[0] + grid - 1e-9), gaps])).astype(np.int64)


def segment_lengths(restarts: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    """Return the number of samples of each segment, from one restart to the next.

    Args:
        restarts: Indices of the restarts, rising, shape (k,).
        n: Number of samples.

    Returns:
        Number of samples of each segment, shape (k,).

    >>> segment_lengths(np.array([0, 3]), 10)
    array([3, 7])
    """
    return np.diff(np.append(restarts, n))


OUTPUT_COLUMNS = {"p1": at.R1, "p2": at.R2, "x": at.X, "v": at.V, "a": at.A, "temperature": at.GAS_T, "flow": at.FLOW}
MIN_STEP_RATIO = 4.0  # of longer steps, where these are taken for differences
LEAKS = {"leak_area", *LEAK_PORTS}  # ports of flows beside the valve's
LATE_READINGS = {"sensor_lag", "sensor_delay"}  # ports at which pressures are only read later
SMEAR_MEMORY_FACTOR = 3.0  # times the smoother's memory, over which it spreads a stop
DIFFERENTIATION_BANDWIDTH_FACTOR = 4.0  # times the frequency of the low-pass, before differentiation
RISE_TIME_FACTOR = 0.35  # rise time from 10 to 90 % of a step times the frequency of the low-pass
MIN_SEGMENT_SMEARS = 4.0  # times ``smear_time``: in a shorter segment the error of the restart dominates


@dataclass(frozen=True)
class Experiment:
    """One recording, prepared for the kernel.

    Attributes:
        recording: The recording as it was read.
        rig: The rig on which it was made.
        raw: Measured signals with gaps filled, each (n,).
        noise: Noise of each sensor.
        smoothers: Smoother of each signal.
        motion_smoother: What tells the motion from the readings; None where nothing does.
        inputs: Smoothed signals in the kernel's layout, shape (n, 8).
        restarts: Samples at which the state of the model is set to the smoothed measurement.
        flags: Switches of the kernel, shape (9,).
        low_pass: Frequency in Hz of the filter behind which model and measurement are compared; None: no filter.
        standstill_speed: Speed in m/s below which the piston counts as at rest.
        stroke_limits: Lowest and highest x in m; None: as the rig states them.
        detected_ends: Ends in m that recordings show, infinite where they show none.
        end_compliance: Distance in m by which an end may yield.
        longest_step: Longest step of the kernel in s; None: that of :attr:`max_step`.
    """

    recording: Recording
    rig: Rig
    raw: Mapping[str, Array]
    noise: Mapping[str, NoiseModel]
    smoothers: Mapping[str, LocalPolynomialSmoother]
    motion_smoother: MeasuredMotion | None
    inputs: Array
    restarts: NDArray[np.int64]
    flags: Array
    low_pass: float | None = None
    standstill_speed: float = 0.0
    stroke_limits: tuple[float, float] | None = None
    detected_ends: tuple[float, float] = (-np.inf, np.inf)
    end_compliance: float = 0.0
    longest_step: float | None = None

    @property
    def time(self) -> Array:
        """Time stamps in s, shape (n,)."""
        return self.recording.time

    @cached_property
    def gap_ends(self) -> NDArray[np.int64]:
        """The first sample of the recording, and those after gaps."""
        return restart_samples(self.time, None)

    @cached_property
    def contact_side(self) -> Array:
        """The side on which an end of the stroke may carry the piston: -1, 0 or 1 for each sample, shape (n,)."""
        return contact_side(self.inputs[:, at.IN_X], self.detected_ends, self.contact_tolerance)

    @property
    def is_free(self) -> NDArray[np.bool_]:
        """Samples (n,) off the ends. On an end any force may act: they say nothing of friction, springs or loads."""
        return np.asarray(self.contact_side == 0.0)

    @property
    def contact_tolerance(self) -> float:
        """Distance in m from an end within which the piston may touch it, by noise or compliance."""
        return max(self.position_scatter, self.end_compliance)

    @property
    def position_scatter(self) -> float:
        """Distance in m within which noise may scatter the readings of one position."""
        return POSITION_SCATTER_SIGMA * self.noise["x"].rms if "x" in self.noise else 0.0

    @property
    def horizon(self) -> float:
        """Longest time in s from one restart to the next, or to the end of the recording."""
        return float(np.diff(np.append(self.time[self.restarts], self.time[-1])).max())

    @property
    def segments(self) -> NDArray[np.int64]:
        """Number of the restart that each sample follows, shape (n,)."""
        return np.searchsorted(self.restarts, np.arange(self.time.size), side="right") - 1

    @cached_property
    def undetermined_restarts(self) -> NDArray[np.bool_]:
        """The restarts beside a jump of the acceleration between two samples, which leaves their velocity open."""
        if not isinstance(self.motion_smoother, MotionSmoother):
            return np.zeros(self.restarts.size, dtype=bool)
        missed = np.pad(missed_speed(self.time, self.raw["a"]), 1)
        return np.asarray(np.maximum(missed[:-1], missed[1:])[self.restarts] > self.standstill_speed)

    @property
    def vessel(self) -> bool:
        """Whether the chamber is the fixed vessel of a valve test."""
        return self.recording.kind.vessel

    @cached_property
    def parts(self) -> frozenset[Part]:
        """The parts of the rig whose effects can act in this experiment."""
        recording = self.recording
        return recording.kind.parts(
            vessel_is_chamber=self.rig.vessel_is_chamber,
            supply_recorded="p_supply" in recording,
            chamber_2=recording.chamber_2,
        )

    def can_show(self, effect: Effect) -> bool:
        """Return whether the effect's part takes part, and for a sensor's fault whether that sensor was recorded.

        In a shut vessel nothing happens at a known time: a late reading of its pressure is that of an earlier start.
        Without any pressure a leak is told from the valve's own flow by nothing.
        """
        recorded = self.raw.keys()
        read = not effect.sensors or bool(effect.sensors & recorded)
        is_timed = not (self.vessel and self.recording.valve_shut) or not effect.ports.keys() <= LATE_READINGS
        is_told = not (self.lacks_pressures and LEAKS & effect.ports.keys())
        return effect.part in self.parts and read and is_timed and is_told and effect.needs <= recorded

    @property
    def p2_is_unmeasured(self) -> bool:
        """Whether p2 acts on the piston without a sensor that reads it."""
        return self.recording.chamber_2 in ("closed", "valve") and "p2" not in self.raw

    @cached_property
    def inferred_pressures(self) -> tuple[str, ...]:
        """The unmeasured pressures that follow from the model, the motion and the commands."""
        if self.vessel or not self.recording.kind.valve or "x" not in self.raw:
            return ()
        acting = ("p1", "p2") if self.recording.chamber_2 in ("closed", "valve") else ("p1",)
        areas = dict(zip(("p1", "p2"), self.rig.piston_areas, strict=True))
        return tuple(p for p in acting if p not in self.raw and areas[p] > 0.0)

    @property
    def lacks_pressures(self) -> bool:
        """Whether every pressure that acts on the piston is inferred."""
        return bool(self.inferred_pressures) and not {"p1", "p2"} & self.raw.keys()

    @cached_property
    def motion_inputs(self) -> MotionInputs:
        """The measured motion as inputs of a model on which it is imposed; no model changes it."""
        return motion_inputs(self)

    @property
    def measured_motion(self) -> Motion:
        """The smoothed motion that was measured."""
        assert self.motion_smoother is not None  # as motion_is_known tells
        return self.motion_smoother.motion(self.motion_smoother.corrected(self.raw))

    @cached_property
    def acceleration(self) -> Array:
        """Acceleration in m/s^2, shape (n,): measured, or else what the measured position or velocity shows."""
        return self.raw["a"] if "a" in self.raw else self.measured_motion[2]

    def without_mechanics(self) -> Experiment:
        """Return the experiment with the measured motion imposed."""
        flags = self.flags.copy()
        flags[at.MECHANICS] = 0.0
        return replace(self, flags=flags)

    @cached_property
    def with_imposed_motion(self) -> Experiment:
        """The experiment with the measured motion imposed, restarted after gaps only."""
        return replace(self.without_mechanics(), restarts=self.gap_ends)

    @cached_property
    def max_step(self) -> float:
        """Longest step of the kernel in s, for a moving piston or for chambers that fill."""
        if self.longest_step is not None:
            return self.longest_step
        filled = [p for p in ("p1", "p2") if p in self.raw]
        if self.flags[at.MECHANICS] > 0.0 or not filled:
            return max_motion_step(self.rig, self.recording.period)
        return min(self._filling_step(p) for p in filled)

    @cached_property
    def max_given_step(self) -> float:
        """Longest step of the kernel in s with the measured motion, before a run with a longest step of its own."""
        if self.flags[at.MECHANICS] == 0.0:
            return self.max_step
        return max(self.max_step, min(GIVEN_MOTION_STEPS * self.max_step, self.without_mechanics().max_step))

    @cached_property
    def for_differences(self) -> Experiment:
        """The experiment as it is simulated where only the difference of two runs with different noise is asked for:
        with the steps that suffice for a measured motion both err alike. Those are taken where they save most of the
        time; they change in which of a few draws a piston breaks away.
        """
        if self.longest_step is not None or self.max_given_step < MIN_STEP_RATIO * self.max_step:
            return self
        return replace(self, longest_step=self.max_given_step)

    def _filling_step(self, name: str) -> float:
        smoother = self.smoothers.get(name)
        slope = smoother.slope(self.raw[name]) if smoother else np.gradient(self.raw[name], self.time)
        return max_filling_step(self.inputs[:, at.INPUTS.index(name)], slope, self.recording.period)

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """The signals in which model and measurement are compared."""
        r = self.recording
        if r.imposed == "motion":
            return ("force",)
        compared = tuple(c for c in r.kind.compared_channels if c != "p2" or r.chamber_2 != "open")
        available = {*self.raw, "v"} if self.motion_is_known else set(self.raw)
        return tuple(c for c in (*compared, *r.kind.optional_channels) if c in available)

    @property
    def motion_is_known(self) -> bool:
        """Whether position, velocity or an integrable acceleration was recorded."""
        return self.motion_smoother is not None

    @cached_property
    def smear_time(self) -> float:
        """Time in s on each side of a stop or a break-away that smoothing and sampling blur."""
        smoother = self.motion_smoother
        return self.recording.period + (SMEAR_MEMORY_FACTOR * smoother.memory if smoother else 0.0)

    @cached_property
    def signal_ranges(self) -> SignalRanges:
        """Largest command, pressure, force and speed, range of x, sampling period.

        Where the piston rests on an end, a force is no measure of the drive; positions count where it moves.
        """

        def largest(*columns: int, where: NDArray[np.bool_] | slice = slice(None)) -> float:
            measured = [c for c in columns if at.INPUTS[c] in self.raw]
            return float(np.abs(self.inputs[where][:, measured]).max(initial=0.0)) if measured else 0.0

        moving = (self.inputs[:, at.IN_V] != 0.0) & self.is_free
        x = self.inputs[moving, at.IN_X] if "x" in self.raw and moving.any() else np.zeros(1)
        speed = float(np.abs(self.inputs[:, at.IN_V]).max())
        command = float(self.flags[at.U_MAX]) if {"u", "u2"} & self.raw.keys() else 0.0
        pressure = largest(at.IN_SUPPLY, at.IN_P1, at.IN_P2)
        bounds = float(x.min()), float(x.max())
        force = largest(at.IN_FORCE, where=self.is_free)
        return SignalRanges(command, pressure, force, speed, *bounds, self.recording.period)

    def measured(self, channel: str) -> Array:
        """Return a measured channel, filtered where the comparison filters.

        Args:
            channel: Name of the channel.

        Returns:
            The signal in SI units, shape (n,); NaN where it was not measured, and of the force that an imposed motion
            needs where the motion does not determine it.
        """
        values = self._measured_unmasked(channel)
        imposed = channel == "force" and self.recording.imposed
        return np.where(self.force_is_determined, values, np.nan) if imposed else values

    def _measured_unmasked(self, channel: str) -> Array:
        if channel == "force" and "force" not in self.recording:
            return self.low_passed(self.net_pressure_force())
        if channel == "v" and "v" not in self.raw:
            return self.low_passed(self.inputs[:, at.IN_V])
        complete = self.raw[channel] is self.recording.signals.get(channel)
        values = self.low_passed(self.raw[channel])
        return values if complete else np.where(np.isnan(self.recording[channel]), np.nan, values)

    @cached_property
    def force_is_determined(self) -> NDArray[np.bool_]:
        """Samples (n,) at which the motion determines the force: off the ends, and in a certain direction."""
        return np.asarray(self.is_free & ~detect_reversals(self))

    def net_pressure_force(self) -> Array:
        """Return the force in N of the measured pressures on the piston toward +x, shape (n,)."""
        a1, a2 = self.rig.piston_areas
        ambient = np.full(self.time.size, self.rig.ambient_pressure)
        p1, p2 = self.raw.get("p1", ambient), self.raw.get("p2", ambient)
        return np.asarray(a1 * (p1 - ambient) - a2 * (p2 - ambient))

    def net_pressure_noise(self, noise: Mapping[str, Array]) -> Array:
        """Return the error in N that the noise of the pressures adds to this force, shape (n,)."""
        a1, a2 = self.rig.piston_areas
        zero = np.zeros(self.time.size)
        return np.asarray(a1 * noise.get("p1", zero) - a2 * noise.get("p2", zero))

    def low_passed(self, values: Array, bandwidth_factor: float = 1.0) -> Array:
        """Filter a signal where the comparison filters.

        A Butterworth filter of second order runs forward and backward: no phase shift, half the amplitude at its
        frequency.

        Args:
            values: Signal, shape (n,).
            bandwidth_factor: Factor on the frequency of the filter.

        Returns:
            The filtered signal, shape (n,); the signal itself without a filter.
        """
        if self.low_pass is None:
            return values
        nyquist = 0.5 / self.recording.period
        if bandwidth_factor * self.low_pass >= nyquist:
            return values
        from scipy.signal import butter, sosfiltfilt  # noqa: PLC0415 - slow to import, and few pipelines filter

        sections = butter(2, bandwidth_factor * self.low_pass / nyquist, output="sos")
        return np.asarray(sosfiltfilt(sections, values))

    def active_effects(self, effects: tuple[Effect, ...]) -> list[str]:
        """Return the names of the effects whose part takes part in this experiment."""
        return [e.name for e in effects if e.part in self.parts]

    def draw_noise(self, rng: np.random.Generator) -> dict[str, Array]:
        """Draw the noise of every sensor once."""
        return draw_sensor_noise(self.noise, self.time, rng)

    def input_errors(self, noise: Mapping[str, Array]) -> Array:
        """Return the errors of the kernel's inputs (n, 8) from draws of the sensors' noise, each (n,)."""
        is_uncertain = "x" in noise or "x" not in self.raw  # a position that was set has no noise
        motion = self.motion_smoother.errors(noise) if self.motion_smoother and is_uncertain else None
        return smooth_inputs(noise, self.smoothers, motion, self.time)

    def resample_inputs(self, noise: Mapping[str, Array]) -> Array:
        """Return inputs that other readings of the same run would give.

        The smoothed signals get noise and are smoothed again. Windows are chosen anew, since the choice depends on the
        noise; the least squares of the motion are linear.

        Args:
            noise: Noise of each sensor, each (n,).

        Returns:
            Inputs, shape (n, 8).
        """
        inputs = self.inputs + self.input_errors(noise)
        for name in self.smoothers.keys() - {"x"}:
            column = at.INPUTS.index(name)
            reading = self.inputs[:, column] + noise[name]
            inputs[:, column] = choose_windows(reading, self.noise[name], self.recording.period)(reading)
        inputs[np.abs(inputs[:, at.IN_V]) < self.standstill_speed, at.IN_V] = 0.0
        return inputs

    def noise_draws(self, draws: int, seed: int) -> Iterable[tuple[dict[str, Array], Array]]:
        """Return noise and inputs of other readings of the same run.

        They do not depend on a model. Those of a short recording are cached, since smoothing dominates the time.

        Args:
            draws: Number of draws.
            seed: Seed of the generator.

        Returns:
            Pairs of the noise of each sensor and the inputs, shape (n, 8).
        """
        drawn = ((noise, self.resample_inputs(noise)) for noise in self.iterate_noise(draws, seed))
        return cache_draws(
            self._draw_cache, (draws, seed), drawn, draws * (len(self.raw) + len(at.INPUTS)) * self.time.size
        )

    def iterate_noise(self, draws: int, seed: int) -> Iterator[dict[str, Array]]:
        """Yield draws of the noise of every sensor."""
        rng = np.random.default_rng(seed)
        return (self.draw_noise(rng) for _ in range(draws))

    @cached_property
    def _draw_cache(self) -> dict[tuple[int, int], list[tuple[dict[str, Array], Array]]]:
        return {}

    def __getstate__(self) -> dict[str, object]:
        """Leave the last simulations out of a copy for another process: they are those of compiled code in this one."""
        return {name: value for name, value in self.__dict__.items() if not name.startswith("recent_")}

    @cached_property
    def recent_runs(self) -> dict[tuple[object, ...], Array]:
        """The outputs of the last simulations by what they depend on, see :mod:`pneucli.simulate.run`."""
        return {}

    @cached_property
    def recent_sensitivities(self) -> dict[tuple[object, ...], Array]:
        """How the pressures of the last models depend on their initial state: refits and tests ask again."""
        return {}

    def with_restarts(self, horizon: float | None) -> Experiment:
        """Return the experiment with a restart every ``horizon`` s (None: at the start and after gaps only)."""
        other = replace(self, restarts=restart_samples(self.time, horizon, MIN_SEGMENT_SMEARS * self.smear_time))
        other.__dict__["_draw_cache"] = self._draw_cache  # other readings of the same run do not depend on restarts
        return other


class SignalRanges(NamedTuple):
    """Ranges of the signals of one recording, SI, from which the scales of a rig follow; 0 where not recorded.

    ``low`` and ``high`` bound the positions at which the piston moves.
    """

    command: float
    pressure: float
    force: float
    speed: float
    low: float
    high: float
    period: float


def imposed_motion(experiment: Experiment, noise: Mapping[str, Array] | None = None) -> Motion:
    """Return the imposed motion; derivatives that were not measured follow from x.

    With a low-pass, x is filtered at ``DIFFERENTIATION_BANDWIDTH_FACTOR`` times its frequency before differentiation:
    the filter of the comparison removes more, and differentiated noise would return through the sign of friction.

    Args:
        experiment: The experiment.
        noise: Noise added to the readings, by signal, each (n,).

    Returns:
        Position in m, velocity in m/s, acceleration in m/s^2, each (n,).
    """
    motion, raw = experiment.motion_smoother, experiment.raw
    assert motion is not None  # an imposed motion was measured
    readings, disturbed = dict(motion.corrected(raw)), {"x"} if "x" in raw else raw.keys()
    for name in disturbed & (noise or {}).keys():
        readings[name] = readings[name] + (noise or {})[name]
    if experiment.low_pass is not None and motion.differentiates:
        readings["x"] = experiment.low_passed(readings["x"], DIFFERENTIATION_BANDWIDTH_FACTOR)
        motion = MeasuredMotion(experiment.time)
    return motion.motion(readings)


class MotionInputs(NamedTuple):
    """An imposed motion as inputs of the kernel (n, 8) and acceleration in m/s^2 (n,), and the speed in m/s below which
    its direction is uncertain.
    """

    inputs: Array
    acceleration: Array
    standstill_speed: float


def motion_inputs(experiment: Experiment, noise: Mapping[str, Array] | None = None) -> MotionInputs:
    """Return the imposed motion as the inputs of a model.

    Args:
        experiment: The experiment.
        noise: Noise added to the readings, by signal, each (n,).

    Returns:
        The inputs, in which x (m) and v (m/s) are those of the motion.
    """
    inputs = experiment.inputs.copy()
    inputs[:, at.IN_X], inputs[:, at.IN_V], a = imposed_motion(experiment, noise)
    return MotionInputs(inputs, a, standstill_speed(experiment, inputs[:, at.IN_V]))


def detect_reversals(experiment: Experiment) -> NDArray[np.bool_]:
    """Return the samples at which the direction of the measured motion is uncertain.

    A reversal lasts from the last sample in one direction to the first in the other; sampling and smoothing shift it by
    up to a period. A low-pass widens it by its rise time on both sides.

    Args:
        experiment: The experiment.

    Returns:
        True at a reversal, shape (n,); nowhere in a recording that would contain nothing else.
    """
    v, period = imposed_motion(experiment)[1], experiment.recording.period
    uncertain = np.abs(v) <= standstill_speed(experiment, v)
    moving = np.flatnonzero(~uncertain)
    reversed_after = np.flatnonzero(np.diff(np.sign(v[moving])))
    rise = 0 if experiment.low_pass is None else round(RISE_TIME_FACTOR / experiment.low_pass / period)
    for last, first in zip(moving[reversed_after], moving[reversed_after + 1], strict=True):
        uncertain[max(last - rise, 0) : first + rise + 1] = True
    return uncertain if not uncertain.all() else np.zeros_like(uncertain)


def standstill_speed(experiment: Experiment, v: Array) -> float:
    """Return the speed below which the direction of the measured motion is uncertain.

    Args:
        experiment: The experiment.
        v: Velocity in m/s, shape (n,).

    Returns:
        Speed in m/s.
    """
    period = experiment.recording.period
    noise = experiment.noise["x"].rms / period if "x" in experiment.noise else 0.0
    return float(min(max(noise, 1e-6), 0.05 * np.max(np.abs(v)) + 1e-9))
