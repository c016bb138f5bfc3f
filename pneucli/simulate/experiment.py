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
from pneucli.noise import NoiseModel, estimate
from pneucli.physics.declaration import Effect
from pneucli.recording import Recording, Rig
from pneucli.simulate import layout as at
from pneucli.simulate.imposed_motion import smooth_motion, turning
from pneucli.simulate.kernel_settings import filling_step, flags_of, longest_step
from pneucli.simulate.smoothing import Kinematics, LocalFits, lateness, local_fits
from pneucli.simulate.substitutes import stand_in

Array = NDArray[np.float64]

PRESSURES = ("p1", "p2", "p_supply")
OUTPUTS = {"p1": at.R1, "p2": at.R2, "x": at.X, "v": at.V, "a": at.A, "temperature": at.GAS_T, "flow": at.FLOW}
SMOOTHED_FROM = 80  # samples; fewer are taken as they are
FINEST = {"x": 1e-8, "a": 1e-4}  # of a signal's spread: no sensor of a rig is surer than that
SMEARING = 3.0  # times the smoothing's memory, over which it spreads a stop
STILL = {"x": 1e-9, "a": 1e-3}  # m and m/s^2, the noise of a sensor that never changes: any will do
RESTING = 4.0  # standard deviations of the smoothed velocity, below which the piston is taken to rest
GAP = 20  # sampling periods
SHORTEST = 4.0  # times what smears a restart's state: a shorter stretch leaves the model nothing to say


@dataclass(frozen=True)
class Experiment:
    """One recording, smoothed, with what the kernel needs to run it.

    ``raw`` holds the measured signals with gaps filled, ``noise`` what each sensor adds, ``inputs`` (n, 8) the
    smoothed readings in the kernel's layout, ``restarts`` the samples at which the model is set to them; ``still`` is
    the speed in m/s below which the piston is taken to rest; ``ends`` the least and the largest x in m that it can
    have, None as the rig states them, ``struck`` the ends that recordings show, infinite where they show none.
    """

    recording: Recording
    rig: Rig
    raw: Mapping[str, Array]
    noise: Mapping[str, NoiseModel]
    smoothers: Mapping[str, LocalFits]
    fusion: Kinematics | None
    inputs: Array
    restarts: NDArray[np.int64]
    flags: Array
    low_pass: float | None = None
    still: float = 0.0
    ends: tuple[float, float] | None = None
    struck: tuple[float, float] = (-np.inf, np.inf)

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
        recorded = "p_supply" in self.recording
        return self.recording.kind.parts(cylinder_known=self.rig.has_cylinder, supply_recorded=recorded)

    @property
    def lacks_p2(self) -> bool:
        """Whether no sensor reads p2, though it acts."""
        return self.recording.chamber_2 in ("closed", "valve") and "p2" not in self.raw

    @cached_property
    def infers_p2(self) -> bool:
        """Whether a p2 that no sensor reads follows from the model, the motion and the commands."""
        return (
            self.lacks_p2
            and self.recording.kind.valve
            and not self.vessel
            and "x" in self.raw
            and self.rig.areas[1] > 0.0
        )

    def imposing(self) -> Experiment:
        """Return the same with its motion imposed."""
        flags = self.flags.copy()
        flags[at.MECHANICS] = 0.0
        return replace(self, flags=flags)

    @cached_property
    def driven(self) -> Experiment:
        """The same with its motion imposed, started at the first sample and after each gap in the record."""
        return replace(self.imposing(), restarts=restarts(self.time, None))

    @cached_property
    def step(self) -> float:
        """The longest step of the kernel in s: a piston's that forces move, else that of chambers which are filled."""
        filled = [p for p in ("p1", "p2") if p in self.raw]
        if self.flags[at.MECHANICS] > 0.0 or not filled:
            return longest_step(self.rig, self.recording.period)
        return min(self._filling_step(p) for p in filled)

    def _filling_step(self, name: str) -> float:
        known = self.smoothers.get(name)
        slope = known.slope(self.raw[name]) if known else np.gradient(self.raw[name], self.time)
        return filling_step(self.inputs[:, at.INPUTS.index(name)], slope, self.recording.period)

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """The signals that a model's output is compared with."""
        r = self.recording
        if r.imposed == "motion":
            return ("force",)
        compared = tuple(c for c in r.kind.compared if c != "p2" or r.chamber_2 != "open")
        known = {*self.raw, "v"} if "x" in self.raw else set(self.raw)
        return tuple(c for c in (*compared, *r.kind.beside) if c in known)

    @cached_property
    def smear(self) -> float:
        """The time in s on either side of a stop or a break-away in which neither smoothing nor sampling tells it."""
        smoother = self.fusion or self.smoothers.get("x")
        return self.recording.period + (SMEARING * smoother.memory if smoother else 0.0)

    @cached_property
    def extent(self) -> Extent:
        """The largest command, pressure, force and speed, the range of x, and the sampling period."""

        def largest(*columns: int) -> float:
            mine = [c for c in columns if at.INPUTS[c] in self.raw]
            return float(np.abs(self.inputs[:, mine]).max()) if mine else 0.0

        x = self.inputs[:, at.IN_X] if "x" in self.raw else np.zeros(1)
        speed = float(np.abs(self.inputs[:, at.IN_V]).max())
        command = float(self.flags[at.U_MAX]) if {"u", "u2"} & self.raw.keys() else 0.0
        pressure = largest(at.IN_SUPPLY, at.IN_P1, at.IN_P2)
        bounds = float(x.min()), float(x.max())
        return Extent(command, pressure, largest(at.IN_FORCE), speed, *bounds, self.recording.period)

    def measured(self, channel: str) -> Array:
        """Return the measured channel, filtered where the comparison asks for it.

        NaN where it was not measured, and a force where an imposed motion turns: dry friction may have either sign.
        """
        seen = self._seen(channel)
        return np.where(self.turning, np.nan, seen) if channel == "force" and self.recording.imposed else seen

    def _seen(self, channel: str) -> Array:
        if channel == "force" and "force" not in self.recording:
            return self.filtered(self.net_pressure_force())
        if channel == "v" and "v" not in self.raw:
            return self.filtered(self.inputs[:, at.IN_V])
        whole = self.raw[channel] is self.recording.signals.get(channel)
        seen = self.filtered(self.raw[channel])
        return seen if whole else np.where(np.isnan(self.recording[channel]), np.nan, seen)

    @cached_property
    def turning(self) -> NDArray[np.bool_]:
        """At which samples (n,) the measured motion does not tell its direction."""
        return turning(self)

    def net_pressure_force(self) -> Array:
        """Return the force of the measured pressures on the piston, toward +x, in N."""
        a1, a2 = self.rig.areas
        ambient = np.full(self.time.size, self.rig.ambient_pressure)
        p1, p2 = self.raw.get("p1", ambient), self.raw.get("p2", ambient)
        return np.asarray(a1 * (p1 - ambient) - a2 * (p2 - ambient))

    def net_pressure_noise(self, noise: Mapping[str, Array]) -> Array:
        """Return what the pressures' noise adds to that force."""
        a1, a2 = self.rig.areas
        zero = np.zeros(self.time.size)
        return np.asarray(a1 * noise.get("p1", zero) - a2 * noise.get("p2", zero))

    def filtered(self, values: Array, wider: float = 1.0) -> Array:
        """Return values low-passed, where the comparison asks for it (at ``wider`` times its frequency).

        A Butterworth filter of second order, forward and backward: no phase shift, half the amplitude at its frequency.
        """
        nyquist = 0.5 / self.recording.period
        if self.low_pass is None or wider * self.low_pass >= nyquist:
            return values
        sections = butter(2, wider * self.low_pass / nyquist, output="sos")
        return np.asarray(sosfiltfilt(sections, values))

    def active(self, effects: tuple[Effect, ...]) -> list[str]:
        """Return the names of the effects whose part stands on this bench."""
        return [e.name for e in effects if e.part in self.parts]

    def draw_noise(self, rng: np.random.Generator) -> dict[str, Array]:
        """Return one realisation of every sensor's noise."""
        return _draw(self.noise, self.time, rng)

    def read_again(self, noise: Mapping[str, Array]) -> Array:
        """Return the inputs (n, 8) that other readings of the same run would give: smoothed, with noise, smoothed.

        Windows are chosen anew, since their choice follows the noise; the motion's least squares is linear.
        """
        inputs = self.inputs + smooth(noise, self.smoothers, self.fusion, self.time)
        for name in self.smoothers.keys() - {"x"}:
            column = at.INPUTS.index(name)
            reading = self.inputs[:, column] + noise[name]
            inputs[:, column] = local_fits(reading, self.noise[name], self.recording.period)(reading)
        inputs[np.abs(inputs[:, at.IN_V]) < self.still, at.IN_V] = 0.0
        return inputs

    def readings(self, draws: int, seed: int) -> Iterable[tuple[dict[str, Array], Array]]:
        """Return noise and inputs (n, 8) of other readings of the same run, for as many ``draws``.

        They do not depend on a model: those of a short recording are kept, since smoothing takes longest.
        """
        drawn = ((noise, self.read_again(noise)) for noise in self.noises(draws, seed))
        return kept(self._readings, (draws, seed), drawn, draws * (len(self.raw) + len(at.INPUTS)) * self.time.size)

    def noises(self, draws: int, seed: int) -> Iterator[dict[str, Array]]:
        """Yield as many realisations of every sensor's noise."""
        rng = np.random.default_rng(seed)
        return (self.draw_noise(rng) for _ in range(draws))

    @cached_property
    def _readings(self) -> dict[tuple[int, int], list[tuple[dict[str, Array], Array]]]:
        return {}

    def with_restarts(self, horizon: float | None) -> Experiment:
        """Return the experiment with the model restarted every ``horizon`` s (None: at the start alone)."""
        return replace(self, restarts=restarts(self.time, horizon, SHORTEST * self.smear))


def prepare(recording: Recording, rig: Rig, horizon: float | None, low_pass: float | None = None) -> Experiment:
    """Make a recording ready: fill gaps, smooth, choose restarts (every ``horizon`` s; None: one at the start)."""
    raw = {name: filled(recording.time, values) for name, values in recording.signals.items()}
    noise = {n: recording.noise.get(n) or estimate(recording.time, recording[n]) for n in raw}
    enough = recording.time.size >= SMOOTHED_FROM
    smoothers = {
        n: local_fits(raw[n], noise[n], recording.period) for n in (*PRESSURES, "x", "force") if n in raw and enough
    }
    fusion = None
    if enough and "x" in raw and "a" in raw:
        sure = {n: max(noise[n].rms, share * float(np.std(raw[n])) or STILL[n]) for n, share in FINEST.items()}
        fusion = Kinematics(recording.time, sure["x"], sure["a"])
        if late := lateness(raw["x"], raw["a"], recording.period, fusion.memory):
            raw["a"] = np.append(raw["a"][late:], np.full(late, raw["a"][-1]))
    inputs = smooth(raw, smoothers, fusion, recording.time)
    still = 0.0
    if "x" in raw:
        drawn = _draw(noise, recording.time, np.random.default_rng(0))
        still = RESTING * float(np.std(smooth_motion(drawn, smoothers, fusion, recording.time)[1]))
        inputs[np.abs(inputs[:, at.IN_V]) < still, at.IN_V] = 0.0
    if rig.sense(recording.chamber) < 0.0:
        inputs[:, at.IN_U] = 2.0 * rig.valve_null - inputs[:, at.IN_U]
    stand_in(inputs, recording, rig)
    flags, once = flags_of(recording, rig, raw, noise), restarts(recording.time, None)
    ready = Experiment(recording, rig, raw, noise, smoothers, fusion, inputs, once, flags, low_pass, still)
    return ready.with_restarts(horizon)


def _draw(noise: Mapping[str, NoiseModel], time: Array, rng: np.random.Generator) -> dict[str, Array]:
    return {name: model.draw(time, rng) for name, model in noise.items()}


def smooth(
    raw: Mapping[str, Array], smoothers: Mapping[str, LocalFits], fusion: Kinematics | None, time: Array
) -> Array:
    """Return the kernel's inputs (n, 8) from raw signals, which may be readings or draws of their noise."""
    inputs = np.zeros((time.size, len(at.INPUTS)))
    for column, name in enumerate(at.INPUTS):
        if name in raw:
            inputs[:, column] = smoothers[name](raw[name]) if name in smoothers else raw[name]
    if "x" in raw:
        inputs[:, at.IN_X], inputs[:, at.IN_V] = smooth_motion(raw, smoothers, fusion, time)
    return inputs


def restarts(time: Array, horizon: float | None, shortest: float = 0.0) -> NDArray[np.int64]:
    """Return the samples at which the model starts anew: every ``horizon`` s, and after each gap in the record.

    A horizon below the ``shortest`` (s) counts as that.
    """
    period = float(np.median(np.diff(time)))
    gaps = 1 + np.flatnonzero(np.diff(time) > GAP * period)
    grid = np.arange(0.0, time[-1] - time[0], max(horizon, shortest)) if horizon else np.zeros(1)
    return np.unique(np.concatenate([np.searchsorted(time, time[0] + grid - 1e-9), gaps])).astype(np.int64)


def filled(time: Array, values: Array) -> Array:
    """Return values with NaN filled by interpolation over time."""
    known = ~np.isnan(values)
    return values if known.all() else np.interp(time, time[known], values[known])


KEPT = 16 << 20  # bytes, of one recording
Drawn = TypeVar("Drawn")


def kept(
    known: dict[tuple[int, int], list[Drawn]], key: tuple[int, int], drawn: Iterable[Drawn], numbers: int
) -> Iterable[Drawn]:
    """Return what was drawn under a key before, else what is ``drawn`` now, kept if so many ``numbers`` fit."""
    if key in known:
        return known[key]
    return known.setdefault(key, list(drawn)) if 8 * numbers <= KEPT else drawn


class Extent(NamedTuple):
    """How far one recording's signals go, SI: what a rig's scales are worked out from; 0 for what was not recorded."""

    command: float
    pressure: float
    force: float
    speed: float
    low: float
    high: float
    period: float
