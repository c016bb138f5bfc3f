"""The noise of a sensor, white and first-order coloured, with mains lines and quantisation, and its estimation.

Source: docs/method.md, cost and initial state: a Whittle fit below jumps, an F test of lines.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg.lapack import dtbtrs

from pneucli.arrays import Array, Mask
from pneucli.noise.spectrum import NoiseFloor, hann, noise_floor

STANDARD_ERRORS = 2.0  # of a 95 % interval
NORMAL_MAD = 1.4826  # standard deviation over median absolute value, of a normal distribution


@dataclass(frozen=True)
class NoiseModel:
    """White and first-order coloured noise, sinusoidal lines and quantisation, in the unit of the signal.

    Attributes:
        white: Standard deviation of the white part.
        coloured: Standard deviation of the coloured part.
        pole: AR(1) coefficient of the coloured part per ``period``.
        period: Sampling period in s.
        lines: Pairs of frequency in Hz and amplitude.
        step: Quantisation step; 0: none.
        interval: Least and most rms of white and coloured noise that the recording leaves possible (95 %); None where
            they are stated, or absent.
    """

    white: float
    coloured: float = 0.0
    pole: float = 0.0
    period: float = 1e-3
    lines: tuple[tuple[float, float], ...] = ()
    step: float = 0.0
    interval: tuple[float, float] | None = None

    @property
    def rms(self) -> float:
        """Root mean square of all parts, at least step / sqrt(12) (interface, section 3).

        >>> NoiseModel(white=3.0, coloured=4.0).rms
        5.0
        """
        return self._with_lines_and_step(float(np.hypot(self.white, self.coloured)))

    @property
    def rms_interval(self) -> tuple[float, float] | None:
        """Least and most :attr:`rms` that the recording leaves possible (95 %); None where it is not estimated.

        >>> NoiseModel(white=1.0, step=34.7, interval=(0.1, 11.0)).rms_interval  # doctest: +ELLIPSIS
        (10.01702..., 11.0)
        """
        return None if self.interval is None else tuple(map(self._with_lines_and_step, self.interval))  # type: ignore[return-value]

    @property
    def relative_error(self) -> float:
        """Standard error of :attr:`rms` over it, from the logarithm of the interval's ends; 0 where it is stated.

        >>> round(NoiseModel(white=1.0, interval=(0.8, 1.25)).relative_error, 3)
        0.112
        """
        if self.rms_interval is None or not self.rms_interval[0] > 0.0:
            return 0.0
        low, high = self.rms_interval
        return math.log(high / low) / (2.0 * STANDARD_ERRORS)

    def _with_lines_and_step(self, rms: float) -> float:
        power = rms**2 + sum(a * a / 2 for _, a in self.lines)
        return float(max(np.sqrt(power), self.step / np.sqrt(12)))

    def draw(self, time: Array, rng: np.random.Generator) -> Array:
        """Draw one realisation.

        Args:
            time: Time stamps in s, taken as equidistant, shape (n,).
            rng: Generator of random numbers.

        Returns:
            Noise, shape (n,).
        """
        n = time.size
        white = max(self.white, 0.0 if self.coloured or self.lines else self.rms)
        noise = white * rng.standard_normal(n)
        if self.coloured:
            innovations = np.sqrt(1 - self.pole**2) * rng.standard_normal(n)
            state = self.pole * rng.standard_normal()
            innovations[0] += state
            recursion = np.vstack([np.ones(n), np.full(n, -self.pole)])  # y_k - pole y_(k-1) = innovation, by diagonals
            noise += self.coloured * dtbtrs(recursion, innovations, uplo="L", diag="U")[0]
        for frequency, amplitude in self.lines:
            noise += amplitude * np.sin(2 * np.pi * (frequency * time + rng.random()))
        return np.asarray(noise, dtype=np.float64)


MAINS_FREQUENCIES = (50.0, 60.0)  # Hz
MAINS_TOLERANCE = 0.3  # Hz, by which they may differ
LINE_SIGNIFICANCE = 1e-4  # probability of a false line
PADDING = 8  # lengths of the signal that its spectrum is padded to
MIN_FAST_LENGTH = 1 << 18  # samples of a padded spectrum; below it any length takes milliseconds
MIN_INDEPENDENT_BINS = 4.0  # around a line, from which its background can be estimated
BACKGROUND_HALF_BAND = 8.0  # Hz on each side of a line, in which its background is estimated
MAX_ROUNDING = 0.3  # of a converter's step, to which its readings may be rounded where they are written
MIN_SINGLE_STEPS = 8  # gaps of one step that tell it
POLE_BOUNDS = (0.2, 0.98)  # of coloured noise: below, it is white; above, the signal's own content
# corner of coloured noise over the lowest frequency of the spectrum, down to which the spectrum shows it
MIN_CORNER_SHARE = 0.27
MAX_ROLL_OFF, MIN_ROLL_OFF = 12.0, 4.0  # a smooth signal's power falls at least like that of a bend, omega^-4
MAX_BIC_DIFFERENCE = 6.0  # of models that the data do not reject: 20 times less likely than the best
# 1 + 2 (4/9 + 1/36): squared correlations of the bins of a Hann spectrum with their neighbours
BIN_CORRELATION = 1.94
# the same of third differences, 1 + 2 (15^2 + 6^2 + 1) / 20^2, over the 37 % that a median is worth, over 2
DIFFERENCE_VARIANCE = 3.1
MAX_LOG_VARIANCE = 9.0  # of a log of a power that nothing tells
UNKNOWN = 1e-6  # information of a parameter that nothing tells
GAP_PERIODS = 2.5  # a longer step between stamps is a gap
MAX_JITTER, MIN_UNEVEN_SHARE = 0.2, 0.01  # of a period, and of the steps that miss it by more where a clock is uneven
LOG_ZERO_POWER = -60.0  # log of a power that is absent


def estimate_noise(
    time: Array,
    values: Array,
    command_jumps: Mask | None = None,
    signal_jumps: Mask | None = None,
    *,
    is_motion: bool = False,
) -> NoiseModel:
    """Estimate the noise of one channel of one recording.

    A Whittle fit to the spectrum of the quiet segments separates white noise, AR(1) noise and the signal's own content,
    whose power falls at least like omega^-4 (AR(1): omega^-2). BIC selects white, coloured, or both. Lines are mains
    hum. Below about 80 samples only white noise is estimated, from third-order differences: colour and content of this
    speed cannot be distinguished from white noise there; the same where a clock is uneven, and differences divided by
    its stamps are smaller than those of the rows.

    Args:
        time: Time stamps in s, shape (n,).
        values: Signal, NaN where a sample is missing, shape (n,).
        command_jumps: Samples at which a command jumps, which bends the signal, shape (n,).
        signal_jumps: Samples at which the signal itself jumps, shape (n,).
        is_motion: Whether the signal is a position that no accelerometer confirms. Its slow content is then motion,
            and its noise is white unless segments at rest show a colour.

    Returns:
        The noise in the unit of the signal.

    References:
        P. Whittle, Ark. Mat. 2 (1953) 423-434; G. Schwarz, Ann. Stat. 6 (1978) 461-464.

    >>> time = 1e-3 * np.arange(5000)
    >>> estimate = estimate_noise(time, 2.0 * np.random.default_rng(1).standard_normal(time.size))
    >>> abs(estimate.rms - 2.0) < 0.1
    True
    """
    steps = np.diff(time)
    period = float(np.median(steps)) if steps.size else 1e-3
    step = quantisation_step(values)
    if not step and np.median(np.abs(np.diff(values))) == 0:
        return NoiseModel(white=0.0, period=period)  # a command, constant between its jumps
    gaps = np.diff(time, prepend=time[:1]) > GAP_PERIODS * period
    command_jumps = gaps if command_jumps is None else command_jumps | gaps
    floor = noise_floor(values, period, command_jumps, signal_jumps)
    rest = noise_floor(values, period, command_jumps, signal_jumps, at_rest=True) if is_motion else floor
    if floor is None or _stamps_tell_more(time, period, values):
        return replace(_from_differences(values, time), period=period, step=step)
    min_power = max(step**2 / 1200, float(np.finfo(float).tiny) ** 0.5)
    lines = detect_mains_lines(values, period)
    spectrum = _without_lines(rest or floor, lines, period, min_power)
    model = _whittle(spectrum, period, may_be_coloured=rest is not None)
    return replace(model, lines=lines, step=step)


def _stamps_tell_more(time: Array, period: float, values: Array) -> bool:
    """Return whether a clock is uneven, and its stamps are those of the samples: jitter of the stamps alone is not."""
    uneven = np.count_nonzero(np.abs(np.diff(time) - period) > MAX_JITTER * period)
    if uneven <= MIN_UNEVEN_SHARE * time.size:
        return False
    by_stamps, by_rows = _from_differences(values, time).interval, _from_differences(values).interval
    return by_stamps is not None and by_rows is not None and by_stamps[1] < by_rows[0]


def pool_noise(models: Sequence[NoiseModel]) -> NoiseModel:
    """Pool the noise of one sensor over several recordings.

    The median power is that of all recordings, so that one recording full of motion has no influence. White and
    coloured shares and lines are means of the powers; the pole is a mean weighted by the coloured power.

    Args:
        models: Estimates of the same sensor.

    Returns:
        The noise of the sensor.

    >>> pool_noise([NoiseModel(1.0), NoiseModel(1.0), NoiseModel(5.0)]).white
    1.0
    """
    white = np.array([m.white**2 for m in models])
    coloured = np.array([m.coloured**2 for m in models])
    total, shared = float(np.median(white + coloured)), float(np.sum(white + coloured))
    scale = np.sqrt(total * len(models) / shared) if shared else 0.0
    pole = float(np.average([m.pole for m in models], weights=coloured)) if coloured.any() else 0.0
    steps = [m.step for m in models if m.step]
    return NoiseModel(
        white=float(scale * np.sqrt(white.mean())),
        coloured=float(scale * np.sqrt(coloured.mean())),
        pole=pole,
        period=float(np.median([m.period for m in models])),
        lines=_pooled_lines(models),
        step=min(steps, default=0.0),
        interval=_pooled_interval(models, math.sqrt(total)),
    )


def _pooled_interval(models: Sequence[NoiseModel], rms: float) -> tuple[float, float] | None:
    """Return the interval of the pooled rms: independent estimates, as wide in the logarithm as each says."""
    known = [(one.interval, math.hypot(one.white, one.coloured)) for one in models if one.interval]
    if not known or not all(least > 0.0 and own > 0.0 for (least, _), own in known):
        return None
    below = math.sqrt(sum(math.log(own / least) ** 2 for (least, _), own in known)) / len(known)
    above = math.sqrt(sum(math.log(most / own) ** 2 for (_, most), own in known)) / len(known)
    return rms * math.exp(-below), rms * math.exp(above)


def _pooled_lines(models: Sequence[NoiseModel]) -> tuple[tuple[float, float], ...]:
    nominal = sorted({round(f / 10) * 10 for m in models for f, _ in m.lines})
    pooled = []
    for centre in nominal:
        matches = [[(f, a) for f, a in m.lines if abs(f - centre) < 5] for m in models]
        hits = [line for lines in matches for line in lines]
        if 2 * sum(map(bool, matches)) >= len(models):
            power = sum(a * a for _, a in hits) / len(models)
            pooled.append((float(np.mean([f for f, _ in hits])), float(np.sqrt(power))))
    return tuple(pooled)


def _from_differences(values: Array, time: Array | None = None) -> NoiseModel:
    """Return white noise from third differences, divided by the stamps (n,) where these are given, of values (n,)."""
    finite = np.isfinite(values)
    known = values[finite]
    order = min(3, known.size - 1)
    if order < 1:
        return NoiseModel(0.0)
    windows = np.lib.stride_tricks.sliding_window_view(
        np.arange(known.size) if time is None else time[finite], order + 1
    )
    distances = windows[:, :, None] - windows[:, None, :] + np.eye(order + 1)
    weights = 1.0 / np.prod(distances, axis=2)
    weights /= np.linalg.norm(weights, axis=1, keepdims=True)
    differences = np.sum(weights * np.lib.stride_tricks.sliding_window_view(known, order + 1), axis=1)
    robust = NORMAL_MAD * float(np.median(np.abs(differences)))
    rms = min(robust, float(np.sqrt(np.mean(differences**2))))
    reach = math.exp(STANDARD_ERRORS * math.sqrt(DIFFERENCE_VARIANCE / differences.size))
    return NoiseModel(white=rms, interval=(rms / reach, rms * reach))


def _without_lines(
    floor: NoiseFloor, lines: tuple[tuple[float, float], ...], period: float, min_power: float
) -> NoiseFloor:
    keep = np.ones(floor.omega.size, dtype=bool)
    width = 2.5 * (floor.omega[1] - floor.omega[0])
    for frequency, _ in lines:
        keep &= np.abs(floor.omega - 2 * np.pi * frequency * period) > width
    return NoiseFloor(floor.omega[keep], np.maximum(floor.power[keep], min_power), floor.weight)


def _whittle(floor: NoiseFloor, period: float, *, may_be_coloured: bool) -> NoiseModel:
    upper = floor.power[floor.power.size // 2 :]
    level, most = float(np.log(np.median(upper))), float(np.max(upper))
    # per model: start and bounds of log white, log coloured power, pole
    some_white, some_coloured = (level, (level - 8, level + 8)), (level + 1, (level - 8, level + 8))
    absent, no_pole = _fixed(LOG_ZERO_POWER), _fixed(0.0)
    bounds = (POLE_BOUNDS[0], max(POLE_BOUNDS[1], float(np.exp(-MIN_CORNER_SHARE * floor.omega[0]))))
    choices = [[some_white, absent, no_pole]]
    if may_be_coloured:
        choices += [[part, some_coloured, (pole, bounds)] for part in (absent, some_white) for pole in (0.5, 0.9)]
    fits = [_fit(floor, choice) for choice in choices]
    best, (log_white, log_coloured, pole, *_) = min(fits, key=lambda fit: fit[0])
    white, coloured = (float(np.exp(log / 2)) if log > LOG_ZERO_POWER else 0.0 for log in (log_white, log_coloured))
    intervals = [_interval(floor, p, most) for bic, p in fits if bic - best < MAX_BIC_DIFFERENCE]
    least, most = min(low for low, _ in intervals), max(high for _, high in intervals)
    return NoiseModel(white=white, coloured=coloured, pole=float(pole), period=period, interval=(least, most))


def _interval(floor: NoiseFloor, p: Array, most: float) -> tuple[float, float]:
    """Return the 95 % interval of the rms of white and coloured noise together, from the information of the spectrum.

    White noise alone is at most what the upper half of the spectrum shows: ``most`` is its largest power.
    """
    present = p[:2] > LOG_ZERO_POWER
    if not present.any():
        return 0.0, math.sqrt(most)
    power, slopes = _power(floor.omega, p)
    free = np.array([*present, present[1], True, True])
    relative = slopes[free] / power
    information = floor.weight / BIN_CORRELATION * relative @ relative.T
    parts = np.exp(p[:2]) * present
    share = np.zeros(5)
    share[:2] = parts / parts.sum()
    variance = share[free] @ np.linalg.solve(information + UNKNOWN * np.eye(information.shape[0]), share[free])
    reach = math.exp(0.5 * STANDARD_ERRORS * math.sqrt(min(float(variance), MAX_LOG_VARIANCE)))
    rms = math.sqrt(float(parts.sum()))
    return rms / reach, rms * reach if present[1] else max(rms, min(rms * reach, math.sqrt(most)))


def _fixed(value: float) -> tuple[float, tuple[float, float]]:
    return value, (value, value)


def _fit(floor: NoiseFloor, choice: list[tuple[float, tuple[float, float]]]) -> tuple[float, Array]:
    """Return the BIC and the parameters (log white, log coloured power, pole, log content, its roll-off)."""
    from scipy.optimize import minimize  # noqa: PLC0415 - slow to import, and only ingest estimates noise

    low = float(np.log(floor.power[0]))
    start = np.array([s for s, _ in choice] + [low, 6.0])
    bounds = [b for _, b in choice] + [(low - 40, low + 5), (MIN_ROLL_OFF, MAX_ROLL_OFF)]

    def deviance(p: Array) -> tuple[float, Array]:
        model, slopes = _power(floor.omega, p)
        change = floor.weight * (1.0 - floor.power / model) / model
        return float(floor.weight * np.sum(np.log(model) + floor.power / model)), slopes @ change

    best = minimize(deviance, start, method="L-BFGS-B", jac=True, bounds=bounds)
    free = sum(low < high for low, high in bounds)
    return 2 * float(best.fun) + free * float(np.log(floor.omega.size * floor.weight)), best.x


def _power(omega: Array, p: Array) -> tuple[Array, Array]:
    """Return the power (n,) at angular frequencies a sample ``omega`` (n,), and its derivatives (5, n)."""
    white, pole, fall = np.exp(p[0]), p[2], np.log(np.sin(omega / 2) / np.sin(omega[0] / 2))
    below = 1 - 2 * pole * np.cos(omega) + pole**2
    coloured = np.exp(p[1]) * (1 - pole**2) / below
    by_pole = -2 * (np.exp(p[1]) * pole + coloured * (pole - np.cos(omega))) / below
    content = np.exp(p[3] - p[4] * fall)
    slopes = [np.full(omega.size, white), coloured, by_pole, content, -content * fall]
    return np.asarray(white + coloured + content), np.array(slopes)


def detect_mains_lines(values: Array, period: float) -> tuple[tuple[float, float], ...]:
    """Detect mains hum at 50 and 60 Hz and its first two harmonics, which a slow log shows at other frequencies.

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
    seen = {aliased(n * mains, 1.0 / period) for mains in MAINS_FREQUENCIES for n in (1, 2, 3)}
    nominals = sorted(one for one in seen if BACKGROUND_HALF_BAND < one < 0.5 / period - MAINS_TOLERANCE)
    if not nominals:
        return ()
    whitened = np.diff(finite, 2)
    taper = hann(whitened.size)
    length = padded_length(whitened.size)
    spectrum = np.fft.rfft(whitened * taper, length)
    resolution = 1 / (whitened.size * period)
    reach = BACKGROUND_HALF_BAND + 3 * resolution + max(MAINS_TOLERANCE, 0.5 * resolution)
    lines: dict[float, float] = {}
    for nominal in nominals:
        first = max(0, int((nominal - reach) * length * period))
        bins = np.arange(first, min(spectrum.size, int((nominal + reach) * length * period) + 2))
        frequency = np.asarray(bins * (1.0 / (length * period)), dtype=np.float64)
        gain = np.maximum(4 * np.sin(np.pi * frequency * period) ** 2, 1e-12)
        amplitude = 2 * np.abs(spectrum[bins[0] : bins[-1] + 1]) / taper.sum()
        line = _line(frequency, amplitude / gain, nominal, resolution)
        lines |= dict([line]) if line else {}
    return tuple(lines.items())


def aliased(frequency: float, rate: float) -> float:
    """Return the frequency in Hz at which samples taken at a rate in Hz show a line.

    >>> aliased(50.0, 1000.0), aliased(50.0, 99.0), aliased(50.0, 60.0)
    (50.0, 49.0, 10.0)
    """
    return abs(frequency - round(frequency / rate) * rate)


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
    inside = np.flatnonzero(np.abs(frequency - nominal) <= max(MAINS_TOLERANCE, 0.5 * resolution))
    peak = inside[np.argmax(amplitude[inside])]
    distance = np.abs(frequency - frequency[peak])
    around = (distance > 2 * resolution) & (distance < BACKGROUND_HALF_BAND + 2 * resolution)
    independent = float(around.sum()) / PADDING / 1.5
    if independent < MIN_INDEPENDENT_BINS:
        return None
    background = float(np.mean(amplitude[around] ** 2))
    tests = max(1.0, 2.0 * MAINS_TOLERANCE / resolution)  # number of bins searched for the peak
    # quantile of the F distribution with 2 and 2 * independent degrees of freedom
    limit = independent * ((LINE_SIGNIFICANCE / tests) ** (-1.0 / independent) - 1.0)
    power = float(amplitude[peak] ** 2)
    if power <= limit * background:
        return None
    return float(frequency[peak]), float(np.sqrt(power - background))


def quantisation_step(values: Array) -> float:
    """Return the quantisation step of a signal: the largest step of which all differences are multiples.

    A command that holds few levels has no step: 24 levels are needed, or a change in every twentieth sample.

    Args:
        values: Signal, shape (n,).

    Returns:
        The step in the unit of the signal; 0 where there is none.

    >>> noise = np.random.default_rng(1).standard_normal(1000)
    >>> round(quantisation_step(0.25 * np.round(noise / 0.25)), 6)
    0.25
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
        narrow = gaps[gaps < 50 * step]  # wide gaps carry rounding errors
        if narrow.size >= 3 and np.all(np.abs(narrow / step - np.round(narrow / step)) < 0.02):
            return float(np.median(narrow / np.round(narrow / step)))
    return _rounded_step(levels, gaps)


def _rounded_step(levels: Array, gaps: Array) -> float:
    """Return the step of a converter whose readings are written with few digits; 0 where there is none.

    Steps of 0.12875 written with two digits are gaps of 0.12 and 0.13: no level is a multiple of a step, but each is
    one within the rounding.
    """
    single = gaps[gaps < 1.5 * gaps.min()] if gaps.size else gaps
    rounding = float(np.ptp(single)) if single.size else 0.0
    if single.size < MIN_SINGLE_STEPS or not 0.0 < rounding < MAX_ROUNDING * float(single.min()):
        return 0.0
    step = float(single.mean())
    for _ in range(3):
        count = np.round((levels - levels[0]) / step)
        step = float(np.sum(count * (levels - levels[0])) / np.sum(count**2))
    left = np.abs(levels - levels[0] - np.round((levels - levels[0]) / step) * step)
    return step if float(left.max()) <= 1.001 * rounding else 0.0
