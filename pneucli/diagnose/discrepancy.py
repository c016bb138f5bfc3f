"""The discrepancy that no named effect explains: its channel, size and time constant, and the signal that it depends
on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from pneucli.arrays import Array
from pneucli.diagnose.adequacy import MIN_TRIMMED_RATIO, LackOfFit
from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.equivalence import CHANCE_COST_RATIO
from pneucli.diagnose.spline_regression import SmoothTerm
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.residuals import ResidualModel
from pneucli.messages.diagnose import Discrepancy
from pneucli.simulate import layout as at
from pneucli.simulate.model import Model

MIN_PERIODIC_SHARE = 0.3  # of the squared residual
BAND_RATIO = 1.1  # of a band's edge to its centre: a decaying oscillation has no sharp line
FREQUENCY_RESOLUTION = 0.5  # cycles over the range that distinguish two periods
MIN_CYCLES = 2.0  # over the range; fewer cannot be distinguished from a drift
MAX_CYCLES = 250.0
MIN_SAMPLES_PER_CYCLE = 16
MIN_SAMPLES = 100  # residuals of a recording, to estimate a period
MAX_SAMPLES = 4000
BINS = int(MIN_SAMPLES_PER_CYCLE * MAX_CYCLES)  # of the range
CYCLE_STEP, FINE_STEPS = 0.125, 21  # grid step in cycles, and points of the fine grid about the best


class PeriodicTerm(NamedTuple):
    """The signal over which a residual repeats, its period (s or m), and the share of the squares that it holds."""

    variable: str
    length: float
    share: float


def describe_discrepancies(data: DiagnosisData, fit: Fit, lacks: Sequence[LackOfFit]) -> list[Discrepancy]:
    """Return the channels in which a fit leaves more than noise, the largest share first."""
    lack_by_channel = {(r.kind, r.channel): r for r in reversed(lacks) if r.ratio > MIN_TRIMMED_RATIO}
    residuals = {key: _residuals(fit.model, data.residual_models, *key) for key in lack_by_channel}
    excess = {
        key: sum(max(float(r @ r) - np.count_nonzero(r), 0.0) for r, _ in residuals[key]) for key in lack_by_channel
    }
    signals = [describe_lack_of_fit(data, fit, r).variable for r in lack_by_channel.values()]
    total = max(sum(excess.values()), 1e-9)
    found = [
        Discrepancy(r.kind.title, r.channel, r.ratio, _correlation_time(residuals[key]), over, excess[key] / total)
        for (key, r), over in zip(lack_by_channel.items(), signals, strict=True)
    ]
    return sorted(found, key=lambda d: -d.share)


def _residuals(
    model: Model, residual_models: Sequence[ResidualModel], kind: type[ResidualModel], channel: str
) -> list[tuple[Array, float]]:
    """Return the residuals (n,) in units of noise and the sampling period (s) of each recording."""
    members = [v for v in residual_models if type(v) is kind and channel in v.channels]
    return [(v.residual(model)[channel] / v.noise[channel], v.experiment.recording.period) for v in members]


def _correlation_time(residuals: Sequence[tuple[Array, float]]) -> float | None:
    """Return the time in s in which the pooled autocorrelation falls to 1/e of its value at one sample."""
    if not residuals:
        return None
    period = min(p for _, p in residuals)
    covariances = [_autocovariance(r) for r, p in residuals if p == period]
    length = min(c.size for c in covariances)
    pooled = np.sum([c[:length] for c in covariances], axis=0)
    if length < 3 or not pooled[1] > 0.0:
        return None
    decayed = np.flatnonzero(pooled[1:] < pooled[1] / np.e)
    return float(decayed[0] * period) if decayed.size else None


def _autocovariance(values: Array) -> Array:
    """Return the sums of products of values (n,) at lags 0 to n // 2."""
    power = np.abs(np.fft.rfft(values, 2 * values.size)) ** 2
    return np.asarray(np.fft.irfft(power)[: values.size // 2])


MIN_EXPLAINED_SHARE = 0.05  # of the squares: a function of a signal that explains less is not reported
DiscrepancyKind = Literal[
    "free-run",  # only the free run fails; each subsystem fits by itself
    "shapeless",  # the residual is no function of any signal
    "irregular",  # a smooth function of a signal explains a minor part
    "smooth",  # a smooth function of a signal
    "periodic",  # the residual repeats over time or position
]


@dataclass(frozen=True)
class UnexplainedResidual:
    """The residual that no effect explains: its channel, its ratio to noise, and the signal that it depends on.

    ``share`` is the part of the squares that a function of the ``variable`` explains in left-out recordings; for a
    periodic one it may be that in the fitted ones. ``acts_as`` has the quantities as which it may act, the best first.
    ``simple_shape`` is a key of SIMPLE_SHAPES that explains about as much, ``other_signals`` explain about as much as
    the variable. ``period`` is in s or m. ``smooth_term`` is the function itself.
    """

    subsystem: str
    channel: str
    ratio: float
    kind: DiscrepancyKind
    variable: str | None = None
    acts_as: tuple[str, ...] = ()
    period: float | None = None
    simple_shape: str | None = None
    share: float | None = None
    other_signals: tuple[str, ...] = ()
    smooth_term: SmoothTerm | None = None


def describe_lack_of_fit(data: DiagnosisData, fit: Fit, worst: LackOfFit) -> UnexplainedResidual:
    """Describe a significant lack of fit."""
    where = UnexplainedResidual(worst.kind.title, worst.channel, worst.ratio, "free-run")
    members = [m for m in data.train if type(m) is worst.kind and worst.channel in m.channels]
    if not members:
        return where
    channel = data.spline_regression(fit, worst.kind, worst.channel)
    ranked = channel.ranked_terms(fit)
    periodic = find_period(fit.model, members, worst.channel)
    best = ranked[0] if ranked and ranked[0].share > MIN_EXPLAINED_SHARE else None
    if periodic is not None and (best is None or periodic.variable == best.signal or periodic.share > best.share):
        return _periodic(where, periodic, best if best is not None and best.signal == periodic.variable else None)
    if best is None:
        return replace(where, kind="shapeless")
    found = replace(where, variable=best.signal, share=best.share, smooth_term=best, acts_as=(best.acts_as,))
    found = replace(found, simple_shape=channel.simplest_shape(fit, best))
    if CHANCE_COST_RATIO * (1.0 - best.share) > 1.0:
        return replace(found, kind="irregular")
    close = [one for one in ranked if 1.0 - one.share < CHANCE_COST_RATIO * (1.0 - best.share)]
    acts_as = dict.fromkeys([best.acts_as, *(one.acts_as for one in close if one.signal == best.signal)])
    others = tuple(name for name in dict.fromkeys(one.signal for one in close) if name != best.signal)
    return replace(found, kind="smooth", acts_as=tuple(acts_as), other_signals=others)


def _periodic(where: UnexplainedResidual, periodic: PeriodicTerm, smooth: SmoothTerm | None) -> UnexplainedResidual:
    return replace(
        where,
        kind="periodic",
        variable=periodic.variable,
        acts_as=() if smooth is None else (smooth.acts_as,),
        period=periodic.length,
        share=periodic.share if smooth is None else max(smooth.share, periodic.share),
        smooth_term=smooth,
    )


def find_period(model: Model, residual_models: Sequence[ResidualModel], channel: str) -> PeriodicTerm | None:
    """Return the period that holds most of a channel's squares, None where none holds MIN_PERIODIC_SHARE."""
    residuals = [
        (residual_model, residual_model.residual(model)[channel] / residual_model.noise[channel])
        for residual_model in residual_models
    ]
    residuals = [(residual_model, r) for residual_model, r in residuals if np.count_nonzero(r) >= MIN_SAMPLES]
    candidates = [_over_time(residuals), _over_position([(v, r) for v, r in residuals if "x" in v.experiment.raw])]
    return max(
        (p for p in candidates if p is not None and p.share > MIN_PERIODIC_SHARE), key=lambda p: p.share, default=None
    )


def _over_time(residuals: Sequence[tuple[ResidualModel, Array]]) -> PeriodicTerm | None:
    """Return the centre of the narrow frequency band that holds most of the power."""
    powers = [_powers(residual_model, r) for residual_model, r in residuals]
    lowest = min((MIN_CYCLES * f[1] for f, _ in powers), default=np.inf)
    highest = max((f[-1] * 2.0 / MIN_SAMPLES_PER_CYCLE for f, _ in powers), default=0.0)
    if not lowest < highest:
        return None
    middles = np.geomspace(lowest, highest, 1 + round(np.log(highest / lowest) / np.log(BAND_RATIO) * 4))
    held_power = sum(
        _cumulative_power(f, p, middles * BAND_RATIO) - _cumulative_power(f, p, middles / BAND_RATIO) for f, p in powers
    )
    total_power = sum(float(r @ r) for _, r in residuals)
    best = int(np.argmax(held_power))
    if not np.asarray(held_power)[best] > 0.0:
        return None
    within = [(f, np.where(np.abs(f - middles[best]) < (BAND_RATIO - 1.0) * middles[best], p, 0.0)) for f, p in powers]
    mean = sum(float(f @ p) for f, p in within) / sum(float(p.sum()) for _, p in within)
    return PeriodicTerm("time", 1.0 / mean, float(np.asarray(held_power)[best]) / total_power)


def _powers(residual_model: ResidualModel, residual: Array) -> tuple[Array, Array]:
    """Return frequencies in Hz and the power at each, 0 at multiples of the restart frequency.

    An error that grows between restarts has their period; it comes from the comparison, not from the rig.
    """
    e, n = residual_model.experiment, residual.size
    frequency = np.asarray(np.fft.rfftfreq(n, e.recording.period), dtype=np.float64)
    power = np.abs(np.fft.rfft(residual)) ** 2 * 2.0 / n
    if residual_model.is_simulated and e.restarts.size > 1:
        restart_frequency = 1.0 / float(np.median(np.diff(e.time[e.restarts])))
        distance = np.abs(frequency - restart_frequency * np.maximum(np.round(frequency / restart_frequency), 1.0))
        power[distance < FREQUENCY_RESOLUTION * frequency[1]] = 0.0
    return frequency, np.asarray(power)


def _cumulative_power(frequency: Array, power: Array, edges: Array) -> Array:
    """Return the power below each of some frequencies."""
    return np.asarray(np.concatenate([[0.0], np.cumsum(power)])[np.searchsorted(frequency, edges)])


def _over_position(residuals: Sequence[tuple[ResidualModel, Array]]) -> PeriodicTerm | None:
    """Return the sine over position, of one length for all recordings, that holds most of the power."""
    pairs = [(residual_model.experiment.inputs[r != 0.0, at.IN_X], r[r != 0.0]) for residual_model, r in residuals]
    pairs = [(x, r - r.mean()) for x, r in pairs if np.ptp(x) > 0.0]
    if not pairs:
        return None
    span = max(float(np.ptp(x)) for x, _ in pairs)
    power = sum(_periodogram(x, r, span) / r.size for x, r in pairs)
    cycles = CYCLE_STEP * np.arange(round(MAX_CYCLES / CYCLE_STEP))
    admissible = (cycles >= MIN_CYCLES) & (cycles <= max(x.size for x, _ in pairs) / MIN_SAMPLES_PER_CYCLE)
    fine_cycles = cycles[admissible][np.argmax(np.asarray(power)[admissible])] + np.linspace(
        -CYCLE_STEP, CYCLE_STEP, FINE_STEPS
    )
    held_power = sum(_explained_squares(x, r, fine_cycles / span) for x, r in pairs)
    best = int(np.argmax(held_power))
    return PeriodicTerm(
        "x", span / float(fine_cycles[best]), float(np.asarray(held_power)[best]) / sum(float(r @ r) for _, r in pairs)
    )


def _periodogram(x: Array, r: Array, span: float) -> Array:
    """Return the power of a sine of each number of cycles over the span, up to a factor.

    It uses sums over narrow bins of x, because readings are not evenly spaced over x.
    """
    bin_index = np.minimum(((x - x.min()) * (BINS / span)).astype(np.int64), BINS - 1)
    sums = np.bincount(bin_index, weights=r, minlength=BINS)
    return np.asarray(np.abs(np.fft.rfft(sums, round(BINS / CYCLE_STEP))[: round(MAX_CYCLES / CYCLE_STEP)]) ** 2)


def _explained_squares(x: Array, r: Array, frequency: Array) -> Array:
    """Return the squares that a sine of each frequency (1/m) explains."""
    thinned = slice(None, None, max(x.size // MAX_SAMPLES, 1))
    phase = 2.0 * np.pi * np.multiply.outer(frequency, x[thinned])
    waves = np.stack([np.cos(phase), np.sin(phase)], axis=1)  # as scipy.signal.lombscargle, which is slow to import
    projected = waves @ r[thinned]
    amplitudes = np.linalg.solve(waves @ waves.transpose(0, 2, 1), projected[..., None])[..., 0]
    shares = np.sum(projected * amplitudes, axis=1) / float(r[thinned] @ r[thinned])
    return np.asarray(shares * float(r @ r))
