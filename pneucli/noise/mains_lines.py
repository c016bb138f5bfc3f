"""Mains hum in a signal: lines at 50 and 60 Hz and their harmonics."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pneucli.noise.spectrum import hann

Array = NDArray[np.float64]

MAINS_FREQUENCIES = (50.0, 60.0)  # Hz
LINE_SIGNIFICANCE = 1e-4  # probability of a false line
PADDING = 8  # lengths of the signal that its spectrum is padded to
MIN_FAST_LENGTH = 1 << 18  # samples of a padded spectrum; below it any length takes milliseconds
MIN_INDEPENDENT_BINS = 4.0  # around a line, from which its background can be estimated
BACKGROUND_HALF_BAND = 8.0  # Hz on each side of a line, in which its background is estimated


def detect_mains_lines(values: Array, period: float) -> tuple[tuple[float, float], ...]:
    """Detect mains hum at 50 and 60 Hz and its first two harmonics.

    An F test compares one bin with the bins around it in the Hann spectrum of the whole signal. A second difference
    removes slow content beforehand; its gain is divided out again.

    Args:
        values: Signal without missing samples, at least 0.5 s, shape (n,).
        period: Sampling period in s.

    Returns:
        Pairs of frequency in Hz and amplitude.

    >>> time = 1e-3 * np.arange(5000)
    >>> noise = 0.1 * np.random.default_rng(1).standard_normal(time.size)
    >>> [(f, a)] = detect_mains_lines(np.sin(2 * np.pi * 50.0 * time) + noise, 1e-3)
    >>> round(f, 1), round(a, 1)
    (50.0, 1.0)
    """
    finite = values[np.isfinite(values)]
    if finite.size < 0.5 / period or finite.size != values.size:
        return ()
    nominals = [n * mains for mains in MAINS_FREQUENCIES for n in (1, 2, 3)]
    nominals = [nominal for nominal in nominals if nominal + BACKGROUND_HALF_BAND <= 0.5 / period]
    if not nominals:
        return ()
    whitened = np.diff(finite, 2)
    taper = hann(whitened.size)
    length = padded_length(whitened.size)
    spectrum = np.fft.rfft(whitened * taper, length)
    resolution = 1 / (whitened.size * period)
    reach = BACKGROUND_HALF_BAND + 3 * resolution + max(0.3, 0.5 * resolution)
    lines = []
    for nominal in nominals:
        first = max(0, int((nominal - reach) * length * period))
        bins = np.arange(first, min(spectrum.size, int((nominal + reach) * length * period) + 2))
        frequency = np.asarray(bins * (1.0 / (length * period)), dtype=np.float64)
        gain = np.maximum(4 * np.sin(np.pi * frequency * period) ** 2, 1e-12)
        amplitude = 2 * np.abs(spectrum[bins[0] : bins[-1] + 1]) / taper.sum()
        line = _line(frequency, amplitude / gain, nominal, resolution)
        lines += [line] if line else []
    return tuple(lines)


def padded_length(samples: int) -> int:
    """Return the length to which a spectrum is padded with zeros: the bins are then an eighth of the resolution apart.

    A long spectrum gets a length of small factors, since a large prime factor makes it many times slower.

    Args:
        samples: Number of samples of the signal.

    Returns:
        Length in samples, at least eight times ``samples``.

    >>> padded_length(1001), padded_length(262_142)
    (8008, 2097152)
    """
    length = PADDING * samples
    if length < MIN_FAST_LENGTH:
        return length
    from scipy.fft import next_fast_len  # noqa: PLC0415 - slow to import, and few recordings are so long

    return int(next_fast_len(length, real=True))


def _line(frequency: Array, amplitude: Array, nominal: float, resolution: float) -> tuple[float, float] | None:
    inside = np.flatnonzero(np.abs(frequency - nominal) <= max(0.3, 0.5 * resolution))
    peak = inside[np.argmax(amplitude[inside])]
    distance = np.abs(frequency - frequency[peak])
    around = (distance > 2 * resolution) & (distance < BACKGROUND_HALF_BAND + 2 * resolution)
    independent = float(around.sum()) / PADDING / 1.5
    if independent < MIN_INDEPENDENT_BINS:
        return None
    background = float(np.mean(amplitude[around] ** 2))
    tests = max(1.0, 0.6 / resolution)  # number of bins searched for the peak
    # quantile of the F distribution with 2 and 2 * independent degrees of freedom
    limit = independent * ((LINE_SIGNIFICANCE / tests) ** (-1.0 / independent) - 1.0)
    power = float(amplitude[peak] ** 2)
    if power <= limit * background:
        return None
    return float(frequency[peak]), float(np.sqrt(power - background))
