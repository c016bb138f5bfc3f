"""Where errors concentrate: ranges of signals with more of the error than of the samples, and beyond the fit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pneucli.arrays import Array, Mask
from pneucli.compare.channel_errors import Comparison
from pneucli.messages.compare import BeyondFitted, ChannelResult, Region
from pneucli.quantities import RESIDUAL_VARIABLES, SIGNALS
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment

LOCATOR_BINS = 20
MIN_CONCENTRATION = 2.0  # times its share of the samples
MIN_SHARED_ERROR = 0.5  # of a region's error within another one: both are one event
MAX_REGIONS = 40


@dataclass(frozen=True)
class _RegionSamples:
    """A region with its samples (n,), the channel's squared error (n,), and its weight."""

    region: Region
    inside: Mask
    squared: Array
    weight: float

    def contains_error_of(self, other: _RegionSamples) -> bool:
        """Return whether most of another region's error lies within this one."""
        return bool(
            other.squared[self.inside & other.inside].sum() >= MIN_SHARED_ERROR * other.squared[other.inside].sum()
        )

    def is_same_event(self, other: _RegionSamples) -> bool:
        """Return whether both hold the same error: most of one lies within the other."""
        return self.region.recording == other.region.recording and (
            self.contains_error_of(other) or other.contains_error_of(self)
        )


def locator_signals(e: Experiment) -> dict[str, Array]:
    """Return the signals over which an error may concentrate.

    Args:
        e: The experiment.

    Returns:
        Signals as measured and smoothed, each (n,).
    """
    inputs = e.inputs
    signals: dict[str, Array] = {"time": e.time}
    for name, column in (("u", at.IN_U), ("p1", at.IN_P1), ("p2", at.IN_P2), ("x", at.IN_X), ("v", at.IN_V)):
        if name in e.raw or (name == "v" and e.motion_is_known):
            signals[name] = inputs[:, column]
    if "a" in e.raw:
        signals["a"] = e.raw["a"]
    if "v" in signals:
        standstill = 1e-3 * float(np.max(np.abs(signals["v"])) or 1.0)
        signals["direction"] = np.where(np.abs(signals["v"]) < standstill, 0.0, np.sign(signals["v"]))
    if {"u", "p1"} <= signals.keys() and not e.recording.valve_shut:
        filling = signals["u"] > 0
        ratio = np.where(filling, signals["p1"] / inputs[:, at.IN_SUPPLY], e.rig.ambient_pressure / signals["p1"])
        signals["p_ratio"] = np.where(signals["u"] == 0, np.nan, ratio)
    return {name: signals[name] for name in RESIDUAL_VARIABLES if name in signals}


def find_error_regions(comparisons: Sequence[Comparison], min_ratio_to_noise: float = 1.2) -> list[Region]:
    """Return the regions that hold at least twice their share of the error, worst first.

    Args:
        comparisons: Comparisons of a model with experiments.
        min_ratio_to_noise: Channels with a smaller error over noise, or one within its limit, have no regions.

    Returns:
        At most ``MAX_REGIONS`` regions.
    """
    regions = [
        region
        for c in comparisons
        for r in c.results
        if r.ratio_to_noise >= max(min_ratio_to_noise, r.ratio_limit or 0.0)
        for region in _regions_of_channel(c, r)
    ]
    return _number_events(sorted(regions, key=lambda s: -s.weight)[:MAX_REGIONS])


def _number_events(candidates: Sequence[_RegionSamples]) -> list[Region]:
    """Return the regions with the number of their event, which is that of the worst region with the same error."""
    leads: list[_RegionSamples] = []
    regions = []
    for one in candidates:
        event = next((i for i, lead in enumerate(leads) if lead.is_same_event(one)), len(leads))
        if event == len(leads):
            leads.append(one)
        regions.append(replace(one.region, event=event))
    return regions


def _regions_of_channel(comparison: Comparison, result: ChannelResult) -> Iterator[_RegionSamples]:
    """Yield the worst range of each signal over which the error of one channel is uneven, of all compared samples."""
    squared = comparison.residual(result.channel) ** 2
    compared, squared = np.isfinite(squared), np.nan_to_num(squared)
    weight = (result.ratio_to_noise - 1.0) * result.ratio_to_noise
    for signal, values in locator_signals(comparison.experiment).items():
        concentration = error_concentration(values[compared], squared[compared])
        if concentration is not None:
            low, high, error, samples = concentration
            unit = SIGNALS[signal].unit if signal in SIGNALS else "1"
            region = Region(result.recording, result.channel, signal, low, high, unit, error, samples)
            yield _RegionSamples(region, (values >= low) & (values <= high), squared, weight * (error - samples))


def error_concentration(values: Array, squared: Array) -> tuple[float, float, float, float] | None:
    """Return the range of a signal in which a squared error is most concentrated.

    The range maximises the sum of (share of error - share of samples) over neighbouring bins (Kadane's algorithm).

    Args:
        values: Signal, shape (n,).
        squared: Squared error, shape (n,).

    Returns:
        Lower and upper limit, share of the error, share of the samples; None where the error is spread evenly.
    """
    measured = np.isfinite(values)
    low, high = (float(np.min(values[measured])), float(np.max(values[measured]))) if measured.any() else (0.0, 0.0)
    total = float(squared.sum())
    if high <= low or total <= 0:
        return None
    edges = np.linspace(low, high, LOCATOR_BINS + 1)
    place = np.clip(np.digitize(values[measured], edges) - 1, 0, LOCATOR_BINS - 1)
    error = np.bincount(place, squared[measured], LOCATOR_BINS) / total
    samples = np.bincount(place, minlength=LOCATOR_BINS) / values.size
    first, last = _max_sum_run(error - samples)
    share, count = float(error[first : last + 1].sum()), float(samples[first : last + 1].sum())
    if share < MIN_CONCENTRATION * count:
        return None
    return float(edges[first]), float(edges[last + 1]), share, count


def _max_sum_run(gain: Array) -> tuple[int, int]:
    best, run, start, span = -np.inf, 0.0, 0, (0, 0)
    for i, g in enumerate(gain):
        if run <= 0:
            run, start = 0.0, i
        run += g
        if run > best:
            best, span = run, (start, i)
    return span


EXTRAPOLATED_SIGNALS = ("u", "v", "p1", "p2")
MIN_DISTANCE = 0.05  # of the fitted range, beyond it: so far a smooth law may be continued


def beyond_fitted(comparisons: Sequence[Comparison]) -> tuple[list[BeyondFitted], float | None]:
    """Return where held-out recordings go beyond the fitted ones.

    Args:
        comparisons: Comparisons of a model with all recordings.

    Returns:
        The recordings and signals, the largest share of the error first, and the error of the held-out samples within
        the fitted ranges, over noise: the root mean square over all channels. None where nothing is beyond, or all.
    """
    ranges = _fitted_ranges([c.experiment for c in comparisons if c.experiment.recording.use == "train"])
    held_out = [c for c in comparisons if c.experiment.recording.use == "test"]
    found, ratios = list[BeyondFitted](), list[float]()
    for comparison in held_out:
        beyond = _samples_beyond(comparison.experiment, ranges)
        within = ~np.any([np.zeros(comparison.experiment.time.size, dtype=bool), *beyond.values()], axis=0)
        found += [_described(comparison, name, ranges[name], samples) for name, samples in beyond.items()]
        ratios += [float(np.nanmean(s[within])) for s in _squares(comparison) if np.isfinite(s[within]).any()]
    if not found or not ratios:
        return found, None
    return sorted(found, key=lambda one: -one.share_of_error), float(np.sqrt(np.mean(ratios)))


def excess_beyond_fitted(comparisons: Sequence[Comparison]) -> list[dict[str, float]]:
    """Return by how much samples beyond the fitted range raise the mean square error above that of the others, SI.

    The result has a mapping by channel for each comparison; empty where nothing is beyond, or all.
    """
    ranges = _fitted_ranges([c.experiment for c in comparisons if c.experiment.recording.use == "train"])
    return [_excess(c, ranges) if c.experiment.recording.use == "test" else {} for c in comparisons]


def _excess(comparison: Comparison, ranges: Mapping[str, tuple[float, float]]) -> dict[str, float]:
    samples, found = _samples_beyond(comparison.experiment, ranges), {}
    if samples:
        beyond = np.any([*samples.values()], axis=0)
        for channel in (r.channel for r in comparison.results):
            squares = comparison.residual(channel) ** 2
            known = np.isfinite(squares)
            if (known & beyond).any() and (known & ~beyond).any():
                within = float(np.mean(squares[known & ~beyond]))
                found[channel] = max(float(np.mean(squares[known])) - within, 0.0)
    return found


def _fitted_ranges(experiments: Sequence[Experiment]) -> dict[str, tuple[float, float]]:
    """Return the range of each signal over the fitted recordings."""
    seen = [locator_signals(e) for e in experiments]
    values = {name: [s[name] for s in seen if name in s] for name in EXTRAPOLATED_SIGNALS}
    ends = {n: (min(map(np.nanmin, found)), max(map(np.nanmax, found))) for n, found in values.items() if found}
    return {name: (float(low), float(high)) for name, (low, high) in ends.items() if high > low}


def _samples_beyond(e: Experiment, ranges: Mapping[str, tuple[float, float]]) -> dict[str, Mask]:
    """Return by signal the samples (n,) beyond its range, and those after them up to the next restart."""
    signals, found = locator_signals(e), {}
    for name in ranges.keys() & signals.keys():
        low, high = ranges[name]
        distance = MIN_DISTANCE * (high - low)
        outside = (signals[name] < low - distance) | (signals[name] > high + distance)
        if outside.any():
            counted = np.concatenate([[0], np.cumsum(outside)])
            found[name] = counted[1:] > counted[e.restarts][e.segments]
    return found


def _described(comparison: Comparison, name: str, fitted: tuple[float, float], samples: Mask) -> BeyondFitted:
    values = locator_signals(comparison.experiment)[name]
    (low, high), reached = fitted, (float(np.nanmin(values)), float(np.nanmax(values)))
    end, to = (low, reached[0]) if low - reached[0] > reached[1] - high else (high, reached[1])
    squares = np.nansum(_squares(comparison), axis=0)
    return BeyondFitted(
        recording=comparison.experiment.recording.name,
        signal=name,
        share=float(np.mean(samples)),
        from_=end,
        to=to,
        unit=SIGNALS[name].unit,
        share_of_error=float(np.sum(squares[samples]) / max(float(np.sum(squares)), 1e-300)),
    )


def _squares(comparison: Comparison) -> list[Array]:
    """Return the squared error over noise of each channel, each (n,); NaN where nothing was measured."""
    judged = [r for r in comparison.results if r.noise > 0.0]
    return [comparison.residual(r.channel) ** 2 / r.noise**2 for r in judged]
