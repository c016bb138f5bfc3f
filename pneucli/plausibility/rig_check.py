"""What all checks look at, the one rule by which a finding is a doubt or a contradiction, and what follows from it."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.special import betainccinv

from pneucli.arrays import Array
from pneucli.messages.ingest import Implausible, Weight
from pneucli.plausibility.blocks import Blocks, resolved_blocks
from pneucli.recording import Calibration, Recording, Rig

MIN_BLOCKS = 8  # blocks
FALSE_ALARM_PROBABILITY = 1e-6  # that white noise seems to move, at one width of blocks

# standard uncertainties by which something is outside: of 10 jackknifed stretches, Student's t with 9 degrees of
# freedom exceeds the first in 1 of 130 and the second in 1 of 10,000
MIN_DOUBT, MIN_CONTRADICTION = 3.0, 6.0
MAX_EXCESS = 1e9  # that is told: more says no more
# standard uncertainty of what states no calibration: the usual sizes of pressure-offset, pressure-scale and
# pressure-lag in the catalogue
PRESSURE_ZERO = 0.01  # of the highest pressure
PRESSURE_GAIN = 0.03  # of the pressure above ambient
LAG = 0.03  # of the time in which the piston crosses the range of x at its top speed
POSITION_GAIN = 0.01  # of a distance: the scale of a sensor and what a stroke is rounded to
# the middle between "as stated" and "wrong by a power of ten", such as mm for cm: no effect of the catalogue changes a
# quantity this much but an extra mass
UNIT_SLIP_FACTOR = float(np.sqrt(10.0))
# the middle between "right" and "off by ambient pressure", over ambient pressure
AMBIENT_SLIP_SHARE = 0.5
# times a sensor's noise, that a change must have to be no noise: two samples of white noise differ by 8 at most
MIN_SIGNAL_TO_NOISE = 10.0
# of the moving time, that each direction must have to tell friction from a constant force
MIN_DIRECTION_SHARE = 0.1
PRESSURES = ("p_supply", "p1", "p2")


@dataclass(frozen=True)
class RigCheck:
    """Recordings in SI, the rig, and what the file states.

    ``stated`` has, by recording, the names of the signals that the file states as held, ``calibrations`` the
    calibrations of signals that state one.
    """

    recordings: Sequence[Recording]
    rig: Rig
    stated: Mapping[str, Collection[str]]
    calibrations: Mapping[str, Calibration] = field(default_factory=dict)

    def is_inactive(self, recording: Recording, signal: str) -> bool:
        """Whether a signal of a recording is constant or nothing but noise."""
        key = (recording.name, signal)
        if key not in self._rests:
            self._rests[key] = is_inactive(recording[signal])
        return self._rests[key]

    def active_signals(self, recording: Recording, *signals: str) -> list[str]:
        """Return those of ``signals`` that a recording has and that do something in it."""
        return [name for name in signals if name in recording and not self.is_inactive(recording, name)]

    def volume(self, chamber: int, x: Array) -> Array | None:
        """Return a chamber's volume in m^3 at positions x in m; None where the file does not say it."""
        rig = self.rig
        area = rig.piston_areas[chamber - 1]
        if not rig.has_cylinder:
            return None
        if chamber == 1:
            return None if rig.dead_volume_1 is None else rig.dead_volume_1 + area * x
        if rig.dead_volume_2 is None or rig.stroke is None:
            return None
        return np.asarray(rig.dead_volume_2 + area * (rig.stroke - x))

    def forces(self, recording: Recording, signals: Mapping[str, Array], ambient: float) -> dict[str, Array]:
        """Return the forces in N that drive the piston, by the signal of each; ``signals`` are of any one shape."""
        areas = dict(zip(("p1", "p2"), (self.rig.piston_areas[0], -self.rig.piston_areas[1]), strict=True))
        known = [name for name in areas if name in recording and self.rig.has_cylinder]
        parts = {name: np.asarray(areas[name] * (signals[name] - ambient)) for name in known}
        return {"force": signals["force"], **parts} if "force" in recording else parts

    def net_force(self, recording: Recording, signals: Mapping[str, Array]) -> Array | None:
        """Return the sum of :meth:`forces`; None where there are none."""
        parts = self.forces(recording, signals, self.rig.ambient_pressure)
        return np.asarray(sum(parts.values())) if parts else None

    def pressure_error(self, recording: Recording, signal: str, pressure: float) -> float:
        """Return the standard uncertainty in Pa of a reading of ``pressure``, or of the stated supply pressure."""
        noise = recording.noise_rms(signal)
        own = self.calibrations.get(signal)
        if own is None:
            highest = max([float(np.nanmax(recording[p])) for p in PRESSURES if p in recording])
            own = Calibration(PRESSURE_ZERO * max(highest, self.rig.supply_pressure or 0.0), PRESSURE_GAIN)
        return math.hypot(noise, own.zero, own.gain * (pressure - self.rig.ambient_pressure))

    def blocks(self, recording: Recording, signal: str, order: int) -> Blocks | None:
        """Return :func:`resolved_blocks`, found once for all checks."""
        key = (recording.name, signal, order)
        if key not in self._blocks:
            self._blocks[key] = resolved_blocks(recording, signal, order)
        return self._blocks[key]

    @cached_property
    def _rests(self) -> dict[tuple[str, str], bool]:
        return {}

    @cached_property
    def _blocks(self) -> dict[tuple[str, str, int], Blocks | None]:
        return {}


@dataclass(frozen=True)
class Finding(Implausible):
    """What a check finds, which it tells where :meth:`judged` yields it."""

    def judged(self, *, physics: bool = False) -> Iterator[Finding]:
        """Yield the finding where it is far enough outside; with ``physics`` it may be a contradiction.

        ``physics``: what the file states and a law of physics rule it out, and no number that rigs usually have.
        """
        if self.excess >= MIN_DOUBT:
            weight: Weight = "contradiction" if physics and self.excess >= MIN_CONTRADICTION else "doubt"
            told = min(self.excess, MAX_EXCESS)
            yield Finding(self.check, self.signal, self.recording, self.found, self.mend, told, self.share, weight)


def excess(outside: float, *uncertainties: float) -> float:
    """Return how far outside a limit something is, in units of the sum of independent standard uncertainties.

    >>> excess(10.0, 3.0, 4.0)
    2.0
    """
    return float(outside / max(math.hypot(*uncertainties), 1e-300))


def is_inactive(values: Array) -> bool:
    """Whether ``values``, shape ``(n,)``, are constant or nothing but white noise, as far as enough were measured.

    F test of the means of blocks of 4, 16, 64, ... samples against the scatter within them: of white noise no sample
    knows its neighbour, while of anything that moves, or of coloured noise, it does.
    """
    finite = values[np.isfinite(values)]
    if finite.size < 4 * MIN_BLOCKS:
        return False
    if np.ptp(finite) == 0.0:
        return True
    width = 4
    while finite.size // width >= MIN_BLOCKS:
        count = finite.size // width
        block = finite[: count * width].reshape(count, width)
        within = float(block.var(axis=1, ddof=1).mean())
        between = width * float(block.mean(axis=1).var(ddof=1))
        if between > within * _f_quantile(count - 1, count * (width - 1)):
            return False
        width *= 4
    return True


def _f_quantile(between: int, within: int) -> float:
    """Return what F, of so many degrees of freedom between and within blocks, exceeds in false alarms only."""
    share = float(betainccinv(0.5 * between, 0.5 * within, FALSE_ALARM_PROBABILITY))
    return share * within / ((1.0 - share) * between)


# by kind of repair: what would mend the recording, or say how it is to be read
_MENDS = {
    "mark": "state missing = [...] in [signals] {signal}, or missing = [] where these numbers were measured",
    "saturated": "use a sensor of larger range, or take another stretch with from and to in [[recordings]] {recording}",
    "plateau": "check the range of the sensor; where it ends there, cut with from and to in [[recordings]] {recording}",
    "roll-over": "state offset in [signals] {signal} where x = 0 is not where chamber 1 is smallest",
    "jumps": "state what the position is, or cut the recording with from and to in [[recordings]] {recording}",
    "frozen": "look at the logger and the sensor of {signal}",
    "held": "state hold = true in [signals] {signal} if its value really stays between the samples",
    "spread": "export the stamps with more digits",
    "jitter": 'stamp the samples where they are taken; of an even logger write time = {{ expression = "row / RATE" }}',
    "words": "check what these cells should hold, in the file of [[recordings]] {recording}",
    "gap": "where the gap parts two runs, cut there with from and to in [[recordings]] {recording}",
    "counter": "export the stamps with more digits, or from a clock that does not wrap",
}
REPAIRS = frozenset(_MENDS)  # checks of these names say how a recording was read
GAPS = frozenset({"missing", "motionless", "sampling", "samples"})  # less than could have been recorded, nothing false
DERIVATIVES = frozenset({"v", "a"})  # follow from x: a dead one is left out alone


def contradictions(findings: Iterable[Implausible]) -> list[Implausible]:
    """Return the findings that stop what depends on their recording, of the answer of ``ingest``.

    >>> contradictions([Implausible("speed", "x", "run", "x jumps", "check it", 4.0)])
    []
    """
    return [one for one in findings if one.weight == "contradiction"]


def contradicted_parts(findings: Iterable[Implausible]) -> list[tuple[str, str | None]]:
    """Return what contradictions leave out: pairs of recording and signal, which is None for all of its signals.

    >>> contradicted_parts([Implausible("silent", "a", "run", "a stays", "leave it out", 7.0, weight="contradiction")])
    [('run', 'a')]
    """
    found = contradictions(findings)
    alone = [one.check == "silent" and one.signal in DERIVATIVES for one in found]
    dead = {(one.recording, one.signal if is_alone else None) for one, is_alone in zip(found, alone, strict=True)}
    return sorted(dead, key=lambda part: (part[0], part[1] or ""))


def rank(finding: Implausible) -> int:
    """Return the place of a finding: contradictions, doubts that could change an answer, and what only notes a loss.

    The last say how a recording was read or what it lacks.
    """
    return 0 if finding.weight == "contradiction" else 1 if finding.check not in REPAIRS | GAPS else 2


def repair_findings(repairs: Iterable[tuple[str, str, str, str, int, float]]) -> Iterator[Finding]:
    """Yield a finding for each repair that bears on what a recording says; its excess is its count.

    Args:
        repairs: recording, signal, kind, message, count, and share of the samples, of each repair.

    """
    for recording, signal, kind, message, count, share in repairs:
        if kind in _MENDS:
            mend = _MENDS[kind].format(signal=signal, recording=recording)
            yield Finding(kind, signal, recording, message, mend, float(count), share)
