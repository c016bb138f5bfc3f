"""Held-out samples beyond the range of the fitted recordings: there the model extrapolates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pneucli.arrays import Array, Mask
from pneucli.compare.channel_errors import Comparison
from pneucli.compare.error_regions import locator_signals
from pneucli.messages.compare import BeyondFitted
from pneucli.quantities import SIGNALS
from pneucli.simulate.experiment import Experiment

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
