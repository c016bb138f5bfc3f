"""The spectrum of the noise floor below jumps and motion.

Source: P. D. Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70-73, with an order statistic in place of the mean of
the segments.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pneucli.arrays import Array, Mask

# s of a segment: many times the correlation time of a sensor's noise, and a duration in which motion may be quiet
MAX_SEGMENT_DURATION = 0.3
MIN_LONG_SEGMENT_SAMPLES = 256  # samples up to which a segment may be longer than that
MIN_SEGMENT_SAMPLES = 16
FLOOR_QUANTILE = 0.25  # order statistic that estimates the floor: jumps and motion may fill the segments above it
MIN_RELATIVE_JUMP = 0.1  # of a command's range in one sample
MIN_JUMP_FREE_SEGMENTS = 8  # segments without a jump from which the floor can be estimated
# power of line and parabola over the remainder: 1 for the slowest colour, 100 for motion
MAX_REST_SHAPE = 3.0


@dataclass(frozen=True)
class NoiseFloor:
    """One-sided power per frequency bin; white noise of variance s^2 has the power s^2 in every bin.

    Attributes:
        omega: Angular frequency in rad a sample, shape (m,).
        power: Power in the squared unit of the signal, shape (m,).
        weight: Number of independent averages of a bin.
    """

    omega: Array
    power: Array
    weight: float


def segment_length(samples: int, period: float) -> int:
    """Return the length of segments: the power of two that leaves about ten half-overlapping ones.

    Args:
        samples: Number of samples of the signal.
        period: Sampling period in s.

    Returns:
        Length in samples; 0 where there are too few samples.

    >>> segment_length(5000, 1e-3), segment_length(50, 1e-3)
    (256, 0)
    """
    longest = min(samples // 5, max(int(MAX_SEGMENT_DURATION / period), MIN_LONG_SEGMENT_SAMPLES))
    return 0 if longest < MIN_SEGMENT_SAMPLES else 2 ** int(np.log2(longest))


def detect_jumps(commands: Sequence[Array], samples: int) -> Mask:
    """Detect jumps of commands: steps, switching valves.

    Args:
        commands: Commands in V, each of shape (samples,).
        samples: Number of samples.

    Returns:
        Samples at which a command jumps, shape (samples,).

    >>> detect_jumps([np.array([0.0, 0.0, 5.0, 5.0])], 4)
    array([False, False,  True, False])
    """
    jumps = np.zeros(samples, dtype=bool)
    for u in commands:
        jumps |= np.abs(np.diff(u, prepend=u[:1])) > MIN_RELATIVE_JUMP * np.ptp(u)
    return jumps


def jump_free_segments(jumps: Mask, period: float) -> Mask | None:
    """Return which segments of the spectrum contain no jump.

    Args:
        jumps: Samples with a jump, shape (n,).
        period: Sampling period in s.

    Returns:
        One entry for each segment; None where too few segments are free of jumps to determine the floor.

    >>> jump_free_segments(np.zeros(5000, dtype=bool), 1e-3).all()
    np.True_
    """
    length = segment_length(jumps.size, period)
    return _jump_free(jumps, length) if length else None


def _jump_free(jumps: Mask, length: int) -> Mask | None:
    free = ~np.lib.stride_tricks.sliding_window_view(jumps, length)[:: length // 2].any(axis=1)
    return np.asarray(free) if np.count_nonzero(free) >= MIN_JUMP_FREE_SEGMENTS else None


def _segments_between_jumps(jumps: Mask, length: int) -> tuple[int, Mask | None]:
    """Return the longest segment length, at most ``length``, with enough segments free of ``jumps``, and which are.

    Where no length is short enough, return ``length`` and None.
    """
    for halved in range(length.bit_length()):
        short = length >> halved
        if short >= MIN_SEGMENT_SAMPLES and (free := _jump_free(jumps, short)) is not None:
            return short, free
    return length, None


def noise_floor(
    values: Array,
    period: float,
    command_jumps: Mask | None = None,
    signal_jumps: Mask | None = None,
    *,
    at_rest: bool = False,
) -> NoiseFloor | None:
    """Return the spectrum of the quiet segments.

    Each segment is detrended by a parabola and tapered (Hann). In each bin an order statistic (``FLOOR_QUANTILE``),
    divided by its expectation for exponentially distributed periodograms, estimates the mean; jumps or bursts of motion
    in some segments have no influence.

    Args:
        values: Signal, shape (n,); segments with NaN are left out.
        period: Sampling period in s.
        command_jumps: Samples at which a command jumps, shape (n,). Segments are then short enough to lie between the
            jumps, if that is possible: where most have a bend, even the lower quartile is signal.
        signal_jumps: Samples at which the signal itself jumps, shape (n,); they count in place of the command's.
        at_rest: Whether only segments count whose line and parabola may be noise of the segment's own colour.

    Returns:
        The floor; None where there are too few samples.

    >>> floor = noise_floor(np.random.default_rng(1).standard_normal(5000), 1e-3)
    >>> bool(abs(np.mean(floor.power) - 1.0) < 0.1)
    True
    """
    length = segment_length(values.size, period)
    if not length:
        return None
    jumps = command_jumps if signal_jumps is None else signal_jumps
    length, free = (length, None) if jumps is None else _segments_between_jumps(jumps, length)
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
    taper = hann(length)
    tapered = remainder * taper
    periodograms = np.abs(np.fft.rfft(tapered, axis=1)) ** 2 / np.sum(taper**2)
    count = periodograms.shape[0]
    rank = max(1, round(FLOOR_QUANTILE * count))
    expected = np.sum(1.0 / (count - np.arange(rank)))
    power = np.sort(periodograms, axis=0)[rank - 1] / expected
    bins = np.arange(3, length // 2)  # the parabola removes the lowest; the last is real-valued
    # efficiency of the lower quartile: a third of the mean's; of half-overlapping Hann segments: 0.75
    return NoiseFloor(2 * np.pi * bins / length, power[bins], max(1.0, 0.25 * count))


def _at_rest(shape: Array, remainder: Array) -> Mask:
    """Return which segments (k,) hold no motion, from their parabolas' orthonormal coefficients (k, 3)."""
    return np.asarray(np.sum(shape[:, 1:] ** 2, axis=1) <= MAX_REST_SHAPE * np.sum(remainder**2, axis=1))


def hann(length: int) -> Array:
    """Return the periodic Hann window.

    Args:
        length: Length in samples.

    Returns:
        The window, shape (length,).

    >>> hann(4)
    array([0. , 0.5, 1. , 0.5])
    """
    return np.asarray(0.5 + 0.5 * np.cos(np.linspace(-np.pi, np.pi, length + 1)[:-1]))
