"""Whether what is left over repeats: over time, with or without keeping its phase, or over position."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lombscargle

from pneucli.identify.residuals import View
from pneucli.simulate import layout as at
from pneucli.simulate.model import Model

Array = NDArray[np.float64]

PERIODIC = 0.3  # share of the squared residual that one period must hold
WIDTH = 1.1  # between the edge of a band and its middle: a swing that dies out has no line
RESOLVED = 0.5  # cycles over a range, by which two periods can be told apart
FEWEST_CYCLES = 2.0  # over the range; fewer cannot be told from a drift
MOST_CYCLES = 250.0
FEWEST_SAMPLES = 16  # in a cycle
FEWEST = 100  # readings of a view that say anything of a period
MOST_SAMPLES = 4000
BINS = int(FEWEST_SAMPLES * MOST_CYCLES)  # of the range
STEP, FINE = 0.125, 21  # cycles between two that are tried, and how many are tried about the best


class Period(NamedTuple):
    """Over which signal a residual repeats, with which period (s or m), and which share of its squares does."""

    variable: str
    length: float
    share: float


def period(model: Model, views: Sequence[View], channel: str) -> Period | None:
    """Return the period that holds most of the squares of a channel, None where none holds much."""
    left = [(view, view.residual(model)[channel] / view.noise[channel]) for view in views]
    left = [(view, r) for view, r in left if np.count_nonzero(r) >= FEWEST]
    found = [_over_time(left), _over_position([(v, r) for v, r in left if "x" in v.experiment.raw])]
    return max((p for p in found if p is not None and p.share > PERIODIC), key=lambda p: p.share, default=None)


def _over_time(left: Sequence[tuple[View, Array]]) -> Period | None:
    """Return the middle of the narrow band of frequencies that holds most of the power."""
    powers = [_powers(view, r) for view, r in left]
    lowest = min((FEWEST_CYCLES * f[1] for f, _ in powers), default=np.inf)
    highest = max((f[-1] * 2.0 / FEWEST_SAMPLES for f, _ in powers), default=0.0)
    if not lowest < highest:
        return None
    middles = np.geomspace(lowest, highest, 1 + round(np.log(highest / lowest) / np.log(WIDTH) * 4))
    held = sum(_below(f, p, middles * WIDTH) - _below(f, p, middles / WIDTH) for f, p in powers)
    total = sum(float(r @ r) for _, r in left)
    best = int(np.argmax(held))
    if not np.asarray(held)[best] > 0.0:
        return None
    within = [(f, np.where(np.abs(f - middles[best]) < (WIDTH - 1.0) * middles[best], p, 0.0)) for f, p in powers]
    mean = sum(float(f @ p) for f, p in within) / sum(float(p.sum()) for _, p in within)
    return Period("time", 1.0 / mean, float(np.asarray(held)[best]) / total)


def _powers(view: View, residual: Array) -> tuple[Array, Array]:
    """Return frequencies in Hz and what each holds of the squares; nothing at those of the restarts.

    What grows from restart to restart has their period: it is the comparison's, not the rig's.
    """
    e, n = view.experiment, residual.size
    frequency = np.asarray(np.fft.rfftfreq(n, e.recording.period), dtype=np.float64)
    power = np.abs(np.fft.rfft(residual)) ** 2 * 2.0 / n
    if view.replayed and e.restarts.size > 1:
        each = 1.0 / float(np.median(np.diff(e.time[e.restarts])))
        away = np.abs(frequency - each * np.maximum(np.round(frequency / each), 1.0))
        power[away < RESOLVED * frequency[1]] = 0.0
    return frequency, np.asarray(power)


def _below(frequency: Array, power: Array, edges: Array) -> Array:
    """Return what is held below each of some frequencies."""
    return np.asarray(np.concatenate([[0.0], np.cumsum(power)])[np.searchsorted(frequency, edges)])


def _over_position(left: Sequence[tuple[View, Array]]) -> Period | None:
    """Return the sine over position that holds most, of the same length in all views."""
    pairs = [(view.experiment.inputs[r != 0.0, at.IN_X], r[r != 0.0]) for view, r in left]
    pairs = [(x, r - r.mean()) for x, r in pairs if np.ptp(x) > 0.0]
    if not pairs:
        return None
    reach = max(float(np.ptp(x)) for x, _ in pairs)
    power = sum(_periodogram(x, r, reach) / r.size for x, r in pairs)
    cycles = STEP * np.arange(round(MOST_CYCLES / STEP))
    able = (cycles >= FEWEST_CYCLES) & (cycles <= max(x.size for x, _ in pairs) / FEWEST_SAMPLES)
    near = cycles[able][np.argmax(np.asarray(power)[able])] + np.linspace(-STEP, STEP, FINE)
    held = sum(_held(x, r, near / reach) for x, r in pairs)
    best = int(np.argmax(held))
    return Period("x", reach / float(near[best]), float(np.asarray(held)[best]) / sum(float(r @ r) for _, r in pairs))


def _periodogram(x: Array, r: Array, reach: float) -> Array:
    """Return how strong a sine of each number of cycles over the reach is, up to a factor.

    Of sums over narrow bins of x: readings over x are no even samples.
    """
    place = np.minimum(((x - x.min()) * (BINS / reach)).astype(np.int64), BINS - 1)
    sums = np.bincount(place, weights=r, minlength=BINS)
    return np.asarray(np.abs(np.fft.rfft(sums, round(BINS / STEP))[: round(MOST_CYCLES / STEP)]) ** 2)


def _held(x: Array, r: Array, frequency: Array) -> Array:
    """Return what sines of each frequency (1/m) hold of the squares."""
    few = slice(None, None, max(x.size // MOST_SAMPLES, 1))
    shares = lombscargle(x[few], r[few], 2.0 * np.pi * frequency, normalize=True)
    return np.asarray(shares * float(r @ r))
