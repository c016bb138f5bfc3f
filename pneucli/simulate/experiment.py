"""A recording made ready for the kernel: smoothed inputs, restarts, switches, and what it can be compared with."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from pneucli.experiments import Part
from pneucli.noise import NoiseModel
from pneucli.physics.declaration import Effect
from pneucli.recording import Recording, Rig
from pneucli.simulate import layout as at
from pneucli.simulate.imposed_motion import detect_reversals
from pneucli.simulate.kernel_settings import max_filling_step, max_motion_step
from pneucli.simulate.local_polynomials import LocalPolynomialSmoother, choose_windows
from pneucli.simulate.motion_smoother import MotionSmoother, input_errors
from pneucli.simulate.position_smoother import PositionSmoother

Array = NDArray[np.float64]
Draw = TypeVar("Draw")

OUTPUT_COLUMNS = {"p1": at.R1, "p2": at.R2, "x": at.X, "v": at.V, "a": at.A, "temperature": at.GAS_T, "flow": at.FLOW}
SMEAR_MEMORY_FACTOR = 3.0  # times the smoothing's memory, over which it spreads a stop
MAX_GAP_PERIODS = 20  # sampling periods
MIN_SEGMENT_SMEARS = 4.0  # times what smears a restart's state: a shorter stretch leaves the model nothing to say
MAX_CACHE_BYTES = 16 << 20  # bytes, of one recording


@dataclass(frozen=True)
class Experiment:
    """One recording, smoothed, with what the kernel needs to run it.

    ``raw`` holds the measured signals with gaps filled, ``noise`` what each sensor adds, ``inputs`` (n, 8) the
    smoothed readings in the kernel's layout, ``restart_samples`` the samples at which the model is set to them; ``standstill_speed`` is
    the speed in m/s below which the piston is taken to rest; ``stroke_limits`` the least and the largest x in m that it can
    have, None as the rig states them, ``detected_ends`` the ends that recordings show, infinite where they show none.
    """

    recording: Recording
    rig: Rig
    raw: Mapping[str, Array]
    noise: Mapping[str, NoiseModel]
    smoothers: Mapping[str, LocalPolynomialSmoother]
    motion_smoother: MotionSmoother | PositionSmoother | None
    inputs: Array
    restarts: NDArray[np.int64]
    flags: Array
    low_pass: float | None = None
    standstill_speed: float = 0.0
    stroke_limits: tuple[float, float] | None = None
    detected_ends: tuple[float, float] = (-np.inf, np.inf)

    @property
    def time(self) -> Array:
        """Time stamps in s, shape (n,)."""
        return self.recording.time

    @property
    def vessel(self) -> bool:
        """Whether the chamber is the fixed vessel of a valve test."""
        return self.recording.kind.vessel

    @cached_property
    def parts(self) -> frozenset[Part]:
        """What stands on the bench and can show."""
        recording = self.recording
        return recording.kind.parts(
            cylinder_known=self.rig.has_cylinder,
            supply_recorded="p_supply" in recording,
            chamber_2=recording.chamber_2,
        )

    def can_show(self, effect: Effect) -> bool:
        """Whether the effect's part stands on this bench; of a sensor's fault, whether that sensor was recorded."""
        recorded = self.raw.keys()
        read = not effect.sensors or bool(effect.sensors & recorded)
        return effect.part in self.parts and read and effect.needs <= recorded

    @property
    def p2_is_unmeasured(self) -> bool:
        """Whether no sensor reads p2, though it acts."""
        return self.recording.chamber_2 in ("closed", "valve") and "p2" not in self.raw

    @cached_property
    def infers_p2(self) -> bool:
        """Whether a p2 that no sensor reads follows from the model, the motion and the commands."""
        return (
            self.p2_is_unmeasured
            and self.recording.kind.valve
            and not self.vessel
            and "x" in self.raw
            and self.rig.piston_areas[1] > 0.0
        )

    def without_mechanics(self) -> Experiment:
        """Return the same with its motion imposed."""
        flags = self.flags.copy()
        flags[at.MECHANICS] = 0.0
        return replace(self, flags=flags)

    @cached_property
    def with_imposed_motion(self) -> Experiment:
        """The same with its motion imposed, started at the first sample and after each gap in the record."""
        return replace(self.without_mechanics(), restarts=restart_samples(self.time, None))

    @cached_property
    def max_step(self) -> float:
        """The longest step of the kernel in s: a piston's that forces move, else that of chambers which are filled."""
        filled = [p for p in ("p1", "p2") if p in self.raw]
        if self.flags[at.MECHANICS] > 0.0 or not filled:
            return max_motion_step(self.rig, self.recording.period)
        return min(self._filling_step(p) for p in filled)

    def _filling_step(self, name: str) -> float:
        known = self.smoothers.get(name)
        slope = known.slope(self.raw[name]) if known else np.gradient(self.raw[name], self.time)
        return max_filling_step(self.inputs[:, at.INPUTS.index(name)], slope, self.recording.period)

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """The signals that a model's output is compared with."""
        r = self.recording
        if r.imposed == "motion":
            return ("force",)
        compared = tuple(c for c in r.kind.compared_channels if c != "p2" or r.chamber_2 != "open")
        known = {*self.raw, "v"} if "x" in self.raw else set(self.raw)
        return tuple(c for c in (*compared, *r.kind.optional_channels) if c in known)

    @cached_property
    def smear_time(self) -> float:
        """The time in s on either side of a stop or a break-away in which neither smoothing nor sampling tells it."""
        smoother = self.motion_smoother
        return self.recording.period + (SMEAR_MEMORY_FACTOR * smoother.memory if smoother else 0.0)

    @cached_property
    def signal_ranges(self) -> SignalRanges:
        """The largest command, pressure, force and speed, the range of x, and the sampling period."""

        def largest(*columns: int) -> float:
            mine = [c for c in columns if at.INPUTS[c] in self.raw]
            return float(np.abs(self.inputs[:, mine]).max()) if mine else 0.0

        x = self.inputs[:, at.IN_X] if "x" in self.raw else np.zeros(1)
        speed = float(np.abs(self.inputs[:, at.IN_V]).max())
        command = float(self.flags[at.U_MAX]) if {"u", "u2"} & self.raw.keys() else 0.0
        pressure = largest(at.IN_SUPPLY, at.IN_P1, at.IN_P2)
        bounds = float(x.min()), float(x.max())
        return SignalRanges(command, pressure, largest(at.IN_FORCE), speed, *bounds, self.recording.period)

    def measured(self, channel: str) -> Array:
        """Return the measured channel, filtered where the comparison asks for it.

        NaN where it was not measured, and a force where an imposed motion turns: dry friction may have either sign.
        """
        seen = self._measured_unmasked(channel)
        return np.where(self.reversals, np.nan, seen) if channel == "force" and self.recording.imposed else seen

    def _measured_unmasked(self, channel: str) -> Array:
        if channel == "force" and "force" not in self.recording:
            return self.low_passed(self.net_pressure_force())
        if channel == "v" and "v" not in self.raw:
            return self.low_passed(self.inputs[:, at.IN_V])
        whole = self.raw[channel] is self.recording.signals.get(channel)
        seen = self.low_passed(self.raw[channel])
        return seen if whole else np.where(np.isnan(self.recording[channel]), np.nan, seen)

    @cached_property
    def reversals(self) -> NDArray[np.bool_]:
        """At which samples (n,) the measured motion does not tell its direction."""
        return detect_reversals(self)

    def net_pressure_force(self) -> Array:
        """Return the force of the measured pressures on the piston, toward +x, in N."""
        a1, a2 = self.rig.piston_areas
        ambient = np.full(self.time.size, self.rig.ambient_pressure)
        p1, p2 = self.raw.get("p1", ambient), self.raw.get("p2", ambient)
        return np.asarray(a1 * (p1 - ambient) - a2 * (p2 - ambient))

    def net_pressure_noise(self, noise: Mapping[str, Array]) -> Array:
        """Return what the pressures' noise adds to that force."""
        a1, a2 = self.rig.piston_areas
        zero = np.zeros(self.time.size)
        return np.asarray(a1 * noise.get("p1", zero) - a2 * noise.get("p2", zero))

    def low_passed(self, values: Array, bandwidth_factor: float = 1.0) -> Array:
        """Return values low-passed, where the comparison asks for it (at ``bandwidth_factor`` times its frequency).

        A Butterworth filter of second order, forward and backward: no phase shift, half the amplitude at its frequency.
        """
        nyquist = 0.5 / self.recording.period
        if self.low_pass is None or bandwidth_factor * self.low_pass >= nyquist:
            return values
        sections = butter(2, bandwidth_factor * self.low_pass / nyquist, output="sos")
        return np.asarray(sosfiltfilt(sections, values))

    def active_effects(self, effects: tuple[Effect, ...]) -> list[str]:
        """Return the names of the effects whose part stands on this bench."""
        return [e.name for e in effects if e.part in self.parts]

    def draw_noise(self, rng: np.random.Generator) -> dict[str, Array]:
        """Return one realisation of every sensor's noise."""
        return draw_sensor_noise(self.noise, self.time, rng)

    def resample_inputs(self, noise: Mapping[str, Array]) -> Array:
        """Return the inputs (n, 8) that other readings of the same run would give: smoothed, with noise, smoothed.

        Windows are chosen anew, since their choice follows the noise; the motion's least squares is linear.
        """
        inputs = self.inputs + input_errors(noise, self.smoothers, self.motion_smoother, self.time)
        for name in self.smoothers.keys() - {"x"}:
            column = at.INPUTS.index(name)
            reading = self.inputs[:, column] + noise[name]
            inputs[:, column] = choose_windows(reading, self.noise[name], self.recording.period)(reading)
        inputs[np.abs(inputs[:, at.IN_V]) < self.standstill_speed, at.IN_V] = 0.0
        return inputs

    def noise_draws(self, draws: int, seed: int) -> Iterable[tuple[dict[str, Array], Array]]:
        """Return noise and inputs (n, 8) of other readings of the same run, for as many ``draws``.

        They do not depend on a model: those of a short recording are kept, since smoothing takes longest.
        """
        drawn = ((noise, self.resample_inputs(noise)) for noise in self.iterate_noise(draws, seed))
        return cache_draws(
            self._draw_cache, (draws, seed), drawn, draws * (len(self.raw) + len(at.INPUTS)) * self.time.size
        )

    def iterate_noise(self, draws: int, seed: int) -> Iterator[dict[str, Array]]:
        """Yield as many realisations of every sensor's noise."""
        rng = np.random.default_rng(seed)
        return (self.draw_noise(rng) for _ in range(draws))

    @cached_property
    def _draw_cache(self) -> dict[tuple[int, int], list[tuple[dict[str, Array], Array]]]:
        return {}

    def with_restarts(self, horizon: float | None) -> Experiment:
        """Return the experiment with the model restarted every ``horizon`` s (None: at the start alone)."""
        return replace(self, restarts=restart_samples(self.time, horizon, MIN_SEGMENT_SMEARS * self.smear_time))


def draw_sensor_noise(noise: Mapping[str, NoiseModel], time: Array, rng: np.random.Generator) -> dict[str, Array]:
    """Return one realisation of the noise of every sensor."""
    return {name: model.draw(time, rng) for name, model in noise.items()}


def restart_samples(time: Array, horizon: float | None, shortest: float = 0.0) -> NDArray[np.int64]:
    """Return the samples at which the model starts anew: every ``horizon`` s, and after each gap in the record.

    A horizon below the ``shortest`` (s) counts as that.
    """
    period = float(np.median(np.diff(time)))
    gaps = 1 + np.flatnonzero(np.diff(time) > MAX_GAP_PERIODS * period)
    grid = np.arange(0.0, time[-1] - time[0], max(horizon, shortest)) if horizon else np.zeros(1)
    return np.unique(np.concatenate([np.searchsorted(time, time[0] + grid - 1e-9), gaps])).astype(np.int64)


def cache_draws(
    cache: dict[tuple[int, int], list[Draw]], key: tuple[int, int], drawn: Iterable[Draw], size: int
) -> Iterable[Draw]:
    """Return what was drawn under a key before, else what is ``drawn`` now, kept if so many ``size`` fit."""
    if key in cache:
        return cache[key]
    return cache.setdefault(key, list(drawn)) if 8 * size <= MAX_CACHE_BYTES else drawn


class SignalRanges(NamedTuple):
    """How far one recording's signals go, SI: what a rig's scales are worked out from; 0 for what was not recorded."""

    command: float
    pressure: float
    force: float
    speed: float
    low: float
    high: float
    period: float


def segment_lengths(restarts: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    """Return the number of samples in each segment of n samples; a segment runs from one restart to the next."""
    return np.diff(np.append(restarts, n))
