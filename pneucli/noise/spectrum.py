"""The noise floor's spectrum: what stays below jumps and motion, mains lines, and the step of quantisation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal.windows import hann
from scipy.stats import f as f_distribution

Array = NDArray[np.float64]

MAX_SEGMENT_DURATION = (
    0.3  # s of a segment: many times what colours a sensor's noise, and a stretch in which motion may be quiet
)
MIN_LONG_SEGMENT_SAMPLES, MIN_SEGMENT_SAMPLES = (
    256,
    16,
)  # samples of a segment that is as long as need be, and of the shortest
FLOOR_QUANTILE = 0.25  # order statistic that stands for the floor: jumps and motion may fill the segments above it
MAINS_FREQUENCIES = (50.0, 60.0)  # Hz
LINE_SIGNIFICANCE = 1e-4  # probability of a false line
MIN_RELATIVE_JUMP = 0.1  # of a command's range in one sample: it kinks what it drives
MIN_JUMP_FREE_SEGMENTS = 8  # segments without such a jump that tell the floor by themselves
MAX_REST_SHAPE = 3.0  # of the power of line and parabola over the remainder: 1 for the slowest colour, 100 for motion
BACKGROUND_HALF_BAND = 8.0  # Hz either side of a line that tell its background


@dataclass(frozen=True)
class NoiseFloor:
    """One-sided power per bin, shape ``(m,)``, in units of variance: white noise of variance s^2 has ``power = s^2``.

    ``omega`` is the angular frequency in rad per sample; ``weight`` the number of independent averages of a bin.
    """

    omega: Array
    power: Array
    weight: float


def segment_length(samples: int, period: float) -> int:
    """Return the power of two that leaves about ten half-overlapping segments; 0 where there are too few samples."""
    longest = min(samples // 5, max(int(MAX_SEGMENT_DURATION / period), MIN_LONG_SEGMENT_SAMPLES))
    return 0 if longest < MIN_SEGMENT_SAMPLES else 2 ** int(np.log2(longest))


def detect_jumps(commands: Sequence[Array], samples: int) -> NDArray[np.bool_]:
    """Return at which of the ``samples`` one of the ``commands`` (samples,) jumps: a step, a switching valve."""
    jumps = np.zeros(samples, dtype=bool)
    for u in commands:
        jumps |= np.abs(np.diff(u, prepend=u[:1])) > MIN_RELATIVE_JUMP * np.ptp(u)
    return jumps


def jump_free_segments(jumps: NDArray[np.bool_], period: float) -> NDArray[np.bool_] | None:
    """Return which segments are free of ``jumps`` (n,); None where too few are to tell the floor by themselves."""
    length = segment_length(jumps.size, period)
    return _jump_free(jumps, length) if length else None


def _jump_free(jumps: NDArray[np.bool_], length: int) -> NDArray[np.bool_] | None:
    free = ~np.lib.stride_tricks.sliding_window_view(jumps, length)[:: length // 2].any(axis=1)
    return np.asarray(free) if np.count_nonzero(free) >= MIN_JUMP_FREE_SEGMENTS else None


def _segments_between_jumps(jumps: NDArray[np.bool_], length: int) -> tuple[int, NDArray[np.bool_] | None]:
    """Return the length, at most that given, of segments of which enough are free of ``jumps`` (n,); and which are.

    As short as that takes; where no length does, that given, and None.
    """
    for halved in range(length.bit_length()):
        short = length >> halved
        if short >= MIN_SEGMENT_SAMPLES and (free := _jump_free(jumps, short)) is not None:
            return short, free
    return length, None


def noise_floor(
    values: Array,
    period: float,
    command_jumps: NDArray[np.bool_] | None = None,
    signal_jumps: NDArray[np.bool_] | None = None,
    *,
    at_rest: bool = False,
) -> NoiseFloor | None:
    """Return the spectrum of the quiet segments, per bin, or None where ``values`` are too few for one.

    ``period`` is that of the sampling, in s.

    Each segment loses its parabola and is tapered (Hann). Per bin the ``FLOOR_QUANTILE`` order statistic, divided by its
    expectation for exponentially distributed periodograms, stands for the mean: a jump or a burst of motion in some
    segments does not enter. NaN segments are left out, and those in which a command ``command_jumps`` (n,) where enough are
    free of it: where most have a kink, as behind a switching valve, even the lower quartile is the signal's own.
    Of a signal that jumps by itself where ``signal_jumps`` (n,) says so, segments are as short as it takes to lie between.
    ``at_rest``: only segments count whose line and parabola may be noise of the segment's own colour.
    """
    length = segment_length(values.size, period)
    if not length:
        return None
    free = None if command_jumps is None else _jump_free(command_jumps, length)
    if signal_jumps is not None:
        length, free = _segments_between_jumps(signal_jumps, length)
    segments = np.lib.stride_tricks.sliding_window_view(values, length)[:: length // 2]
    segments = segments[np.isfinite(segments).all(axis=1) & (True if free is None else free)]
    if segments.shape[0] < 4:
        return None
    basis = np.linalg.qr(np.vander(np.linspace(-1, 1, length), 3, increasing=True))[0]
    remainder = segments - segments @ basis @ basis.T
    if at_rest:
        remainder = remainder[_at_rest(segments @ basis, remainder)]
        if remainder.shape[0] < MIN_JUMP_FREE_SEGMENTS:
            return None
    taper = hann(length, sym=False)
    tapered = remainder * taper
    periodograms = np.abs(np.fft.rfft(tapered, axis=1)) ** 2 / np.sum(taper**2)
    count = periodograms.shape[0]
    rank = max(1, round(FLOOR_QUANTILE * count))
    expected = np.sum(1.0 / (count - np.arange(rank)))
    power = np.sort(periodograms, axis=0)[rank - 1] / expected
    bins = np.arange(3, length // 2)  # the parabola takes the lowest; the last is real-valued
    # the lower quartile has a third of the mean's efficiency; half-overlapping Hann segments are worth 0.75
    return NoiseFloor(2 * np.pi * bins / length, power[bins], max(1.0, 0.25 * count))


def _at_rest(shape: Array, remainder: Array) -> NDArray[np.bool_]:
    """Return which segments (k,) hold no motion, from their parabolas' orthonormal coefficients (k, 3)."""
    return np.asarray(np.sum(shape[:, 1:] ** 2, axis=1) <= MAX_REST_SHAPE * np.sum(remainder**2, axis=1))


def detect_mains_lines(values: Array, period: float) -> tuple[tuple[float, float], ...]:
    """Return (frequency in Hz, amplitude) of mains hum and its first two harmonics that stand out of their background.

    F test of one bin against the bins around it in the Hann spectrum of the whole signal, after its second
    difference, which takes slow content away (the difference's gain is divided out again).
    """
    finite = values[np.isfinite(values)]
    if finite.size < 0.5 / period or finite.size != values.size:
        return ()
    whitened = np.diff(finite, 2)
    taper = hann(whitened.size, sym=False)
    amplitude = 2 * np.abs(np.fft.rfft(whitened * taper, 8 * whitened.size)) / taper.sum()
    frequency = np.asarray(np.fft.rfftfreq(8 * whitened.size, period), dtype=np.float64)
    gain = np.maximum(4 * np.sin(np.pi * frequency * period) ** 2, 1e-12)
    resolution = 1 / (whitened.size * period)
    found = []
    for mains in MAINS_FREQUENCIES:
        for nominal in (mains, 2 * mains, 3 * mains):
            line = _line(frequency, amplitude / gain, nominal, resolution, 0.5 / period)
            found += [line] if line else []
    return tuple(found)


def _line(
    frequency: Array, amplitude: Array, nominal: float, resolution: float, nyquist: float
) -> tuple[float, float] | None:
    if nominal + BACKGROUND_HALF_BAND > nyquist:
        return None
    inside = np.flatnonzero(np.abs(frequency - nominal) <= max(0.3, 0.5 * resolution))
    peak = inside[np.argmax(amplitude[inside])]
    distance = np.abs(frequency - frequency[peak])
    around = (distance > 2 * resolution) & (distance < BACKGROUND_HALF_BAND + 2 * resolution)
    background = float(np.mean(amplitude[around] ** 2))
    independent = around.sum() / 8 / 1.5
    tries = max(1.0, 0.6 / resolution)  # the peak was searched for
    limit = f_distribution.isf(LINE_SIGNIFICANCE / tries, 2, 2 * independent)
    power = float(amplitude[peak] ** 2)
    if power <= limit * background or independent < 4:
        return None
    return float(frequency[peak]), float(np.sqrt(power - background))


def quantisation_step(values: Array) -> float:
    """Return the largest step that all values are multiples of (up to an offset), 0 where there is none.

    A command that holds few levels shows no step: it needs 24 levels, or a change in every twentieth sample.
    """
    finite = values[np.isfinite(values)]
    levels = np.unique(finite)
    changes = np.count_nonzero(np.diff(finite))
    if levels.size < 4 or (levels.size < 24 and changes < 0.05 * finite.size):
        return 0.0
    gaps = np.diff(levels)
    gaps = gaps[gaps > 1e-9 * max(np.ptp(levels), float(np.abs(levels).max()) * 1e-4)]
    for parts in range(1, 9):
        step = float(gaps.min()) / parts
        near = gaps[gaps < 50 * step]  # far gaps say little about the step and carry rounding errors
        if near.size >= 3 and np.all(np.abs(near / step - np.round(near / step)) < 0.02):
            return float(np.median(near / np.round(near / step)))
    return 0.0
