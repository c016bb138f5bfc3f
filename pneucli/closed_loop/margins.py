"""Margins of the exported loop: gain, phase and delay, and its poles, at operating points along the stroke.

The return ratio L of a loop that is cut with all others closed gives the gain and the delay at which it oscillates
(Nyquist). The cuts are at each valve's command and at the reading of the position. Margins are small-signal statements
about a sliding piston; a sticking piston, or a valve within its overlap, does not follow small signals.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.closed_loop.linearisation import LinearisedLoop, linearise, without_nonsmooth_effects
from pneucli.closed_loop.simulation import ClosedLoopSetup
from pneucli.controller.parameters import Controller
from pneucli.simulate.model import Model

Complex = NDArray[np.complex128]

STROKE_FRACTIONS = (0.3, 0.5, 0.7)  # of the stroke
FREQUENCY_COUNT = 1200
MIN_FREQUENCY_RATIO = 0.05  # of the position loop's corner: what is slower is the way that the piston makes meanwhile
REAL_AXIS_TOLERANCE = 0.02  # rad off the real axis: at half the sampling rate, and at the low end, a ratio is real
COMMAND_LOOPS, POSITION_LOOP = ("command", "command 2"), "position"


@dataclass(frozen=True)
class Margins:
    """Margins of one loop.

    Attributes:
        gain_up: Factor by which the gain may rise; infinite: any.
        gain_down: Factor by which the gain may fall; 0: any.
        phase: Phase margin in rad.
        delay: Additional delay in s; infinite: any.
        modulus: Least distance of L from -1.
        crossover: Highest frequency in rad/s with ``|L| = 1``; NaN: none.

    """

    gain_up: float
    gain_down: float
    phase: float
    delay: float
    modulus: float
    crossover: float


@dataclass(frozen=True)
class LoopCut:
    """A cut loop at one operating point: place of the cut, return ratio over frequencies (rad/s), margins."""

    loop: str
    x: float
    speed: float
    frequency: Array
    ratio: Complex
    margins: Margins


@dataclass(frozen=True)
class MarginAnalysis:
    """All cuts, the closed-loop poles (1/s) at each operating point (x, speed), and what was excluded.

    Attributes:
        sticking_points: Operating points (x, direction) without steady sliding, which have no margins.
        excluded_effects: Titles of effects without a small-signal response.

    """

    cuts: tuple[LoopCut, ...]
    poles: dict[tuple[float, float], Complex]
    sticking_points: tuple[tuple[float, float], ...]
    excluded_effects: tuple[str, ...]
    slow_pole_limit: float

    def is_unstable(self, point: tuple[float, float]) -> bool:
        """Whether the loop grows at an operating point faster than the piston leaves it."""
        return bool(np.max(self.poles[point].real) > self.slow_pole_limit)


def analyse_margins(
    model: Model,
    controller: Controller,
    setup: ClosedLoopSetup,
    corner: float,
) -> MarginAnalysis:
    """Return margins and poles at PLACES of the stroke in both directions; ``corner`` of the position loop in rad/s."""
    smoothed, left = without_nonsmooth_effects(model)
    cuts: list[LoopCut] = []
    poles, stuck = {}, []
    points = [(share * controller.values["C_STROKE"], way) for share in STROKE_FRACTIONS for way in (1.0, -1.0)]
    for x, way in points:
        if (one := linearise(smoothed, controller, setup, corner, x, way)) is None:
            stuck.append((x, way))
            continue
        cuts += cut_loops(one, MIN_FREQUENCY_RATIO * corner)
        poles[x, one.speed] = closed_loop_poles(one)
    return MarginAnalysis(tuple(cuts), poles, tuple(stuck), left, MIN_FREQUENCY_RATIO * corner)


def cut_loops(one: LinearisedLoop, lowest: float) -> list[LoopCut]:
    """Return the loop cut at each command and at the reading of the position, from ``lowest`` (rad/s) on."""
    frequency = np.geomspace(lowest, math.pi / one.period, FREQUENCY_COUNT)
    z = np.exp(1j * frequency * one.period)
    P, C = one.axis.transfer_matrix(z), one.controller.transfer_matrix(z)
    ratios = {name: return_ratio(-C @ P, i) for i, name in enumerate(COMMAND_LOOPS[: C.shape[1]])} | {
        POSITION_LOOP: return_ratio(-P @ C, 0)
    }
    return [LoopCut(n, one.x, one.speed, frequency, L, stability_margins(frequency, L)) for n, L in ratios.items()]


def return_ratio(loops: NDArray[Any], i: int) -> Complex:
    """Return the return ratio of loop i of several (n, m, m) with the others closed: ``1 + L = det / det of these``."""
    whole, others = np.eye(loops.shape[1]) + loops, np.delete(np.arange(loops.shape[1]), i)
    return np.asarray(np.linalg.det(whole) / np.linalg.det(whole[:, others][:, :, others]) - 1.0)


def stability_margins(frequency: Array, L: Complex) -> Margins:
    """Return the margins of a return ratio over frequencies (rad/s), with linear interpolation."""
    size, angle = np.log(np.abs(L)), np.unwrap(np.angle(-L))  # of -L, which is 0 where L lies on the negative axis
    at_one = _crossings(size)
    phases = np.array([_interpolate(angle, i, w) for i, w in at_one])
    speeds = np.array([_interpolate(frequency, i, w) for i, w in at_one])
    sizes = np.exp([_interpolate(size, i, w) for i, w in _phase_crossovers(angle)])
    near = (phases + math.pi) % (2.0 * math.pi) - math.pi
    return Margins(
        gain_up=float(np.min(1.0 / sizes[sizes < 1.0], initial=math.inf)),
        gain_down=float(np.max(1.0 / sizes[sizes >= 1.0], initial=0.0)),
        phase=float(np.min(np.abs(near), initial=math.pi)),
        delay=float(np.min(phases % (2.0 * math.pi) / speeds, initial=math.inf)),
        modulus=float(np.min(np.abs(1.0 + L))),
        crossover=float(np.max(speeds)) if speeds.size else math.nan,
    )


def _phase_crossovers(angle: Array) -> list[tuple[int, float]]:
    """Return where L crosses the negative axis, or an end of the band that is close to it."""
    turn = 2.0 * math.pi
    first, last = int(angle.min() // turn), int(angle.max() // turn) + 1
    found = [place for k in range(first, last + 1) for place in _crossings(angle - turn * k)]
    ends = ((0, 0.0, angle[0]), (angle.size - 2, 1.0, angle[-1]))
    return found + [(i, w) for i, w, a in ends if abs(math.remainder(a, turn)) < REAL_AXIS_TOLERANCE]


def _crossings(values: Array) -> list[tuple[int, float]]:
    """Return where values cross 0: the sample before, and the fraction to the next."""
    places = np.flatnonzero((values[:-1] < 0.0) != (values[1:] < 0.0))
    return [(int(i), float(values[i] / (values[i] - values[i + 1]))) for i in places]


def _interpolate(values: Array, i: int, share: float) -> float:
    return float(values[i] + share * (values[i + 1] - values[i]))


def closed_loop_matrix(one: LinearisedLoop) -> Array:
    """Return the matrix of the closed loop: states of the axis, then those of the controller."""
    axis, law = one.axis, one.controller
    return np.block([[axis.A + axis.B @ law.D @ axis.C, axis.B @ law.C], [law.B @ axis.C, law.A]])


def closed_loop_poles(one: LinearisedLoop) -> Complex:
    """Return the closed-loop poles in 1/s, slowest first, without those that decay within a sample."""
    z = np.linalg.eigvals(closed_loop_matrix(one)).astype(complex)
    s = np.log(z[np.abs(z) > math.exp(-math.pi)]) / one.period
    return np.asarray(s[np.argsort(np.abs(s))])
