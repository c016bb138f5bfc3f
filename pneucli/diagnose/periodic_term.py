"""Whether what is left over repeats: over time, with or without keeping its phase, or over position."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lombscargle

from pneucli.identify.residuals import ResidualModel
from pneucli.simulate import layout as at
from pneucli.simulate.model import Model

Array = NDArray[np.float64]

MIN_PERIODIC_SHARE = 0.3  # share of the squared residual that one period must hold
BAND_RATIO = 1.1  # between the edge of a band and its middle: a swing that dies out has no line
FREQUENCY_RESOLUTION = 0.5  # cycles over a range, by which two periods can be told apart
MIN_CYCLES = 2.0  # over the range; fewer cannot be told from a drift
MAX_CYCLES = 250.0
MIN_SAMPLES_PER_CYCLE = 16  # in a cycle
MIN_SAMPLES = 100  # readings of a view that say anything of a period
MAX_SAMPLES = 4000
BINS = int(MIN_SAMPLES_PER_CYCLE * MAX_CYCLES)  # of the range
CYCLE_STEP, FINE_STEPS = 0.125, 21  # cycles between two that are tried, and how many are tried about the best


class PeriodicTerm(NamedTuple):
    """Over which signal a residual repeats, with which period (s or m), and which share of its squares does."""

    variable: str
    length: float
    share: float


def find_period(model: Model, views: Sequence[ResidualModel], channel: str) -> PeriodicTerm | None:
    """Return the period that holds most of the squares of a channel, None where none holds much."""
    left = [(view, view.residual(model)[channel] / view.noise[channel]) for view in views]
    left = [(view, r) for view, r in left if np.count_nonzero(r) >= MIN_SAMPLES]
    found = [_over_time(left), _over_position([(v, r) for v, r in left if "x" in v.experiment.raw])]
    return max(
        (p for p in found if p is not None and p.share > MIN_PERIODIC_SHARE), key=lambda p: p.share, default=None
    )


def _over_time(left: Sequence[tuple[ResidualModel, Array]]) -> PeriodicTerm | None:
    """Return the middle of the narrow band of frequencies that holds most of the power."""
    powers = [_powers(view, r) for view, r in left]
    lowest = min((MIN_CYCLES * f[1] for f, _ in powers), default=np.inf)
    highest = max((f[-1] * 2.0 / MIN_SAMPLES_PER_CYCLE for f, _ in powers), default=0.0)
    if not lowest < highest:
        return None
    middles = np.geomspace(lowest, highest, 1 + round(np.log(highest / lowest) / np.log(BAND_RATIO) * 4))
    held = sum(
        _cumulative_power(f, p, middles * BAND_RATIO) - _cumulative_power(f, p, middles / BAND_RATIO) for f, p in powers
    )
    total = sum(float(r @ r) for _, r in left)
    best = int(np.argmax(held))
    if not np.asarray(held)[best] > 0.0:
        return None
    within = [(f, np.where(np.abs(f - middles[best]) < (BAND_RATIO - 1.0) * middles[best], p, 0.0)) for f, p in powers]
    mean = sum(float(f @ p) for f, p in within) / sum(float(p.sum()) for _, p in within)
    return PeriodicTerm("time", 1.0 / mean, float(np.asarray(held)[best]) / total)


def _powers(view: ResidualModel, residual: Array) -> tuple[Array, Array]:
    """Return frequencies in Hz and what each holds of the squares; nothing at those of the restarts.

    What grows from restart to restart has their period: it is the comparison's, not the rig's.
    """
    e, n = view.experiment, residual.size
    frequency = np.asarray(np.fft.rfftfreq(n, e.recording.period), dtype=np.float64)
    power = np.abs(np.fft.rfft(residual)) ** 2 * 2.0 / n
    if view.is_simulated and e.restarts.size > 1:
        each = 1.0 / float(np.median(np.diff(e.time[e.restarts])))
        away = np.abs(frequency - each * np.maximum(np.round(frequency / each), 1.0))
        power[away < FREQUENCY_RESOLUTION * frequency[1]] = 0.0
    return frequency, np.asarray(power)


def _cumulative_power(frequency: Array, power: Array, edges: Array) -> Array:
    """Return what is held below each of some frequencies."""
    return np.asarray(np.concatenate([[0.0], np.cumsum(power)])[np.searchsorted(frequency, edges)])


def _over_position(left: Sequence[tuple[ResidualModel, Array]]) -> PeriodicTerm | None:
    """Return the sine over position that holds most, of the same length in all views."""
    pairs = [(view.experiment.inputs[r != 0.0, at.IN_X], r[r != 0.0]) for view, r in left]
    pairs = [(x, r - r.mean()) for x, r in pairs if np.ptp(x) > 0.0]
    if not pairs:
        return None
    reach = max(float(np.ptp(x)) for x, _ in pairs)
    power = sum(_periodogram(x, r, reach) / r.size for x, r in pairs)
    cycles = CYCLE_STEP * np.arange(round(MAX_CYCLES / CYCLE_STEP))
    able = (cycles >= MIN_CYCLES) & (cycles <= max(x.size for x, _ in pairs) / MIN_SAMPLES_PER_CYCLE)
    near = cycles[able][np.argmax(np.asarray(power)[able])] + np.linspace(-CYCLE_STEP, CYCLE_STEP, FINE_STEPS)
    held = sum(_explained_squares(x, r, near / reach) for x, r in pairs)
    best = int(np.argmax(held))
    return PeriodicTerm(
        "x", reach / float(near[best]), float(np.asarray(held)[best]) / sum(float(r @ r) for _, r in pairs)
    )


def _periodogram(x: Array, r: Array, reach: float) -> Array:
    """Return how strong a sine of each number of cycles over the reach is, up to a factor.

    Of sums over narrow bins of x: readings over x are no even samples.
    """
    place = np.minimum(((x - x.min()) * (BINS / reach)).astype(np.int64), BINS - 1)
    sums = np.bincount(place, weights=r, minlength=BINS)
    return np.asarray(np.abs(np.fft.rfft(sums, round(BINS / CYCLE_STEP))[: round(MAX_CYCLES / CYCLE_STEP)]) ** 2)


def _explained_squares(x: Array, r: Array, frequency: Array) -> Array:
    """Return what sines of each frequency (1/m) hold of the squares."""
    few = slice(None, None, max(x.size // MAX_SAMPLES, 1))
    shares = lombscargle(x[few], r[few], 2.0 * np.pi * frequency, normalize=True)
    return np.asarray(shares * float(r @ r))
