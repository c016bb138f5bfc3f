"""Where errors concentrate: the range of each signal that holds more of the error than of the samples."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pneucli.arrays import Array, Mask
from pneucli.compare.channel_errors import Comparison
from pneucli.messages.compare import ChannelResult, Region
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
