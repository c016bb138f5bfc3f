"""The errors of a model by channel (interface, section 3), and the correlation of its residuals.

The residual of a correct model is independent of the inputs: its correlation with them, and with itself over the lag,
stays within bounds.

References:
    M. S. Bartlett, J. R. Statist. Soc. Suppl. 8 (1946) 27-41.
    G. E. P. Box, G. M. Jenkins, Time Series Analysis (1970), ch. 11.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pneucli.arrays import Array, Integers
from pneucli.compare.expected_error import MOTION_CHANNELS, expected_rms
from pneucli.messages.compare import ChannelResult, Purpose, ToleranceUse
from pneucli.quantities import SIGNALS, Z95
from pneucli.recording import Recording
from pneucli.simulate.end_stops import in_end_contact
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.outputs import simulate_outputs

DEFAULT_SHARE = 0.05  # of the measured range: a fit of 95 %, which control engineers take for a good one


@dataclass(frozen=True)
class Comparison:
    """One experiment: errors of its channels, measured and simulated signals, each (n,)."""

    experiment: Experiment
    results: tuple[ChannelResult, ...]
    measured: dict[str, Array]
    modelled: dict[str, Array]

    def residual(self, channel: str) -> Array:
        """Return measured minus model, NaN where nothing was measured."""
        return self.measured[channel] - self.modelled[channel]

    @cached_property
    def segment_squares(self) -> dict[str, Array]:
        """The part of each segment between restarts in the mean square error of each channel, SI, (segments,)."""
        found: dict[str, Array] = {}
        segments = self.experiment.segments
        for channel in (r.channel for r in self.results):
            squares = self.residual(channel) ** 2
            valid = np.isfinite(squares)
            sums = np.bincount(segments[valid], squares[valid], self.experiment.restarts.size)
            found[channel] = np.asarray(sums / max(int(np.count_nonzero(valid)), 1))
        return found


def compare(model: Model, experiment: Experiment, noise: dict[str, float] | None = None) -> Comparison:
    """Compare a model with one experiment.

    Where an end of the stroke determines the motion, the motion is not compared.

    Args:
        model: The model.
        experiment: The experiment.
        noise: Rms error of a correct model by channel, SI; None: estimated by draws of the noise.

    Returns:
        The comparison.
    """
    noise = expected_rms(model, experiment) if noise is None else noise
    modelled = simulate_outputs(model, experiment)
    measured = {channel: experiment.measured(channel) for channel in experiment.channels}
    if "x" in modelled:
        contact = {c: in_end_contact(experiment, modelled["x"], c) for c in MOTION_CHANNELS if c in measured}
        measured |= {c: np.where(touches, np.nan, measured[c]) for c, touches in contact.items()}
    results = tuple(
        evaluate_channel(experiment, channel, measured[channel], modelled[channel], noise[channel])
        for channel in experiment.channels
        if np.isfinite(measured[channel] - modelled[channel]).any()
    )
    return Comparison(experiment, results, measured, modelled)


def evaluate_channel(experiment: Experiment, channel: str, y: Array, model: Array, noise: float) -> ChannelResult:
    """Return the errors of one channel.

    Args:
        experiment: The experiment.
        channel: Name of the channel.
        y: Measured signal, SI, NaN where it was not measured, shape (n,).
        model: Simulated signal, shape (n,).
        noise: Rms error of a correct model.

    Returns:
        The errors.
    """
    return channel_result(experiment.recording, channel, y, model, noise)


def channel_result(recording: Recording, channel: str, y: Array, model: Array, noise: float) -> ChannelResult:
    """Return the errors of one channel of a recording.

    Args:
        recording: The recording.
        channel: Name of the channel.
        y: Measured signal, SI, NaN where it was not measured, shape (n,).
        model: Signal of the model, shape (n,).
        noise: Rms error of a correct model.

    Returns:
        The errors.
    """
    y, model = _both_known(y, model)
    error = y - model
    rmsd = float(np.sqrt(np.mean(error**2)))
    return ChannelResult(
        recording=recording.name,
        use=recording.use,
        channel=channel,
        unit=SIGNALS[channel].unit,
        rmsd=rmsd,
        percent=100 * rmsd / (float(np.ptp(y)) or np.nan),
        relative_error_percent=100 * float(np.linalg.norm(error) / (np.linalg.norm(y) or np.nan)),
        fit_percent=fit_percent(y, y - error),
        noise=noise,
        ratio_to_noise=rmsd / noise if noise > 0 else np.nan,
        measured_range=float(np.ptp(y)),
    )


def _both_known(measured: Array, modelled: Array) -> tuple[Array, Array]:
    """Return the samples of both signals at which neither is NaN."""
    missing = np.isnan(measured) | np.isnan(modelled)
    return (measured[~missing], modelled[~missing]) if missing.any() else (measured, modelled)


def fit_percent(measured: Array, modelled: Array) -> float:
    """Return the fit 100 (1 - |y - model| / |y - mean y|).

    Args:
        measured: Measured signal, shape (n,); samples with NaN are left out.
        modelled: Simulated signal, shape (n,).

    Returns:
        The fit in per cent; NaN for a constant signal.

    >>> fit_percent(np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0, 2.0]))
    100.0
    """
    y, model = _both_known(measured, modelled)
    spread = float(np.linalg.norm(y - y.mean())) if y.size else 0.0
    return 100 * (1 - float(np.linalg.norm(y - model)) / (spread or np.nan))


def overall_error(results: Sequence[ChannelResult], use: str) -> float | None:
    """Return the root mean square of ``ratio_to_noise`` over channels.

    Args:
        results: Errors of channels.
        use: Use of the recordings, ``train`` or ``test``.

    Returns:
        The ratio; None without a channel of that use.
    """
    ratios = [r.ratio_to_noise for r in results if r.use == use and np.isfinite(r.ratio_to_noise)]
    return float(np.sqrt(np.mean(np.square(ratios)))) if ratios else None


def assess_purpose(results: Sequence[ChannelResult], tolerances: Mapping[str, float]) -> Purpose | None:
    """Compare the rms error of each channel with its tolerance.

    Args:
        results: errors of all channels of all recordings. Test recordings decide where there are any.
        tolerances: the largest rms error by channel (SI). A channel without one takes ``DEFAULT_SHARE`` of its largest
            measured range over all recordings.

    Returns:
        The verdict with its worst channel; None where no channel has both an error and a tolerance.

    """
    ranges: dict[str, float] = {}
    for r in results:
        ranges[r.channel] = float(np.fmax(ranges.get(r.channel, 0.0), r.measured_range))
    limits = {channel: DEFAULT_SHARE * span for channel, span in ranges.items()} | dict(tolerances)
    test = [r for r in results if r.use == "test"]
    used = [
        ToleranceUse(r.recording, r.channel, r.rmsd, limits[r.channel], r.unit)
        for r in test or results
        if np.isfinite(r.rmsd) and limits[r.channel] > 0.0
    ]
    worst = max(used, key=lambda one: one.ratio, default=None)
    return None if worst is None else Purpose(worst.ratio <= 1.0, worst)


MAX_LAGS = 100  # lags up to the horizon
NON_INPUT_SIGNALS = ("x_ref", "p_ref", "flow", "temperature")  # recorded, but no input of the model


@dataclass(frozen=True)
class Correlation:
    """Correlation of one residual with itself (``against`` is its channel) or with an input.

    Attributes:
        lag: Lag in s, shape (k,); at a positive lag the input comes first.
        correlation: Correlation, shape (k,).
        bound: 95 % of the correlations with an independent input lie within plus and minus the bound, given how slowly
            both change; with itself, those of white noise.
    """

    recording: str
    use: str
    channel: str
    against: str
    lag: Array
    correlation: Array
    bound: float


def residual_correlations(comparison: Comparison, max_lag: float) -> Iterator[Correlation]:
    """Yield the correlation of every channel with itself and with each input.

    Samples that were not measured count as the mean. A constant or very short signal has no correlation.

    Args:
        comparison: A comparison of a model with an experiment.
        max_lag: Largest lag in s.

    Returns:
        Iterator over correlations.
    """
    experiment = comparison.experiment
    r = experiment.recording
    inputs = [n for n in experiment.raw if n not in (*experiment.channels, *NON_INPUT_SIGNALS, "time")]
    lags = _lags(max_lag, r.period, r.time.size)
    if not lags.size:
        return
    driving = {name: one for name in inputs if (one := _normalised(experiment.raw[name])) is not None}
    input_autocorrelations = {name: _cross_correlation(one, one) for name, one in driving.items()}
    for channel in experiment.channels:
        residual = _normalised(comparison.residual(channel))
        if residual is None:
            continue
        own = _cross_correlation(residual, residual)
        own_lags = lags[lags >= 0]
        white = Z95 / float(np.sqrt(residual.size))
        yield Correlation(
            r.name, r.use, channel, channel, np.asarray(own_lags * r.period), _at_lags(own, own_lags), white
        )
        for name, other in driving.items():
            cross, edge = (
                _at_lags(_cross_correlation(residual, other), lags),
                confidence_bound(own, input_autocorrelations[name]),
            )
            yield Correlation(r.name, r.use, channel, name, np.asarray(lags * r.period), cross, edge)


def confidence_bound(own: Array, other: Array) -> float:
    """Return the 95 % bound for the correlation of two independent series (Bartlett's formula).

    Where both change slowly there are few independent samples, and the bound is wide. Large lags are tapered.

    Args:
        own: Autocorrelation of one series, shape (2 n - 1,).
        other: Autocorrelation of the other series, shape (2 n - 1,).

    Returns:
        The bound.

    >>> white = np.zeros(199)
    >>> white[99] = 1.0
    >>> round(confidence_bound(white, white), 3)
    0.196
    """
    n = (other.size + 1) // 2
    taper = 1.0 - np.abs(np.arange(1 - n, n)) / n
    return float(Z95 * np.sqrt(max(float(np.sum(taper * own * other)), 1.0) / n))


def _lags(max_lag: float, period: float, samples: int) -> Integers:
    max_samples = min(round(max_lag / period), samples // 4)
    return (
        np.unique(np.linspace(-max_samples, max_samples, 2 * MAX_LAGS + 1).round()).astype(np.int64)
        if max_samples >= 1
        else np.zeros(0, int)
    )


def _normalised(values: Array) -> Array | None:
    """Return a series (n,) of mean 0 and norm 1, 0 where it was not measured; None for a constant series."""
    measured = np.isfinite(values)
    if not measured.any():
        return None
    centred = np.where(measured, values - np.mean(values[measured]), 0.0)
    size = float(np.linalg.norm(centred))
    return centred / size if size > 1e-12 * max(1.0, float(np.abs(values[measured]).max())) else None


def _cross_correlation(first: Array, second: Array) -> Array:
    """Return the full cross-correlation of two series of n samples, at the lags 1 - n to n - 1."""
    from scipy.fft import irfft, next_fast_len, rfft  # noqa: PLC0415 - slow to import

    n = first.size
    length = next_fast_len(2 * n - 1, real=True)
    full = irfft(rfft(first, length) * np.conj(rfft(second, length)), length)
    return np.concatenate([full[length - n + 1 :], full[:n]])


def _at_lags(full: Array, lags: Integers) -> Array:
    return np.asarray(full[full.size // 2 + lags])
