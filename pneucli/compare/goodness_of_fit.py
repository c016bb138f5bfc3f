"""The one judgement of a model: does its printed error, or its free run, exceed that of a correct model?

``compare`` and ``diagnose`` state it as ``lack_of_fit``; every sentence, tile, next step and exit code follows from it.

The printed error is that of segments between restarts, a horizon apart, in which a slow error stays small: a model may
follow every second of a recording and miss all of it. The free run, over a whole recording, is therefore judged too.

Errors of segments beside a break-away, and beyond the range of what was fitted, say nothing of the model. Whether a
piston breaks away before a restart or after it decides on the error of all that follows, up to the next one: it may be
a hundred times that of any other segment, and a few draws of the noise hold too few such segments to know how frequent
and how large they are. All that is known is that the segments of a correct model and those of its draws are alike, in
whatever order of size. Where a restart falls on the break-away itself its velocity is not even known.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import takewhile
from typing import NamedTuple

import numpy as np

from pneucli.arrays import Array, Mask
from pneucli.compare.channel_errors import compare, overall_error
from pneucli.compare.expected_error import (
    MOTION_CHANNELS,
    TAIL,
    ErrorDistribution,
    ExpectedError,
    combined_distribution,
    expected_errors,
    noise_error,
)
from pneucli.figure import named
from pneucli.messages.compare import (
    BAD_ERROR_RATIO,
    GOOD_ERROR_RATIO,
    GOOD_TEST_ERROR_RATIO,
    ChannelResult,
    LackOfFit,
    WorstChannel,
)
from pneucli.recording import Recording
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.outputs import simulate_outputs

SegmentSquares = Mapping[str, Array]  # by channel, the part of each segment in the mean square error, SI


class Excused(NamedTuple):
    """What tells nothing of the model adds to the mean square error of each channel of each recording, SI.

    ``segments``: how many segments beside a break-away are among it.
    """

    squares: Sequence[Mapping[str, float]]
    segments: int


def most_by_chance(observed: int, drawn: int, tail: float = TAIL) -> int:
    """Return how many of the largest of all segments may by chance be observed ones, rather than drawn ones.

    The probability that the k largest are all among the observed ones is that of drawing them without replacement.

    >>> most_by_chance(observed=30, drawn=180), most_by_chance(observed=10, drawn=2000)
    (2, 0)
    """
    count, chance = 0, 1.0
    while count < observed:
        chance *= (observed - count) / (observed + drawn - count)
        if chance < tail:
            break
        count += 1
    return count


def excused_segments(observed: Sequence[SegmentSquares], expected: Sequence[ExpectedError]) -> list[Mask]:
    """Return, for each recording, the segments (S,) whose motion tells nothing of the model.

    They are those that start at an unknown velocity, and those that err more than any drawn one, as chance may have it.
    Where there are more of these than chance allows none is excused: the model, or its state at restarts, is wrong.

    Args:
        observed: Squares of the segments of each recording.
        expected: Error of a correct model in each recording.
    """
    pairs = list(zip(observed, expected, strict=True))
    beyond = [_beyond_population(squares, one) & ~one.undetermined for squares, one in pairs]
    drawn = [next(iter(one.squares.values())) for squares, one in pairs if _motion_channels(squares, one)]
    allowed = most_by_chance(sum(one.shape[1] for one in drawn), sum(one.size for one in drawn))
    are_chance = sum(map(np.count_nonzero, beyond)) <= allowed
    return [(found & are_chance) | one.undetermined for found, one in zip(beyond, expected, strict=True)]


def excused_error(
    observed: Sequence[SegmentSquares], beyond_fitted: Sequence[Mapping[str, float]], expected: Sequence[ExpectedError]
) -> Excused:
    """Return by how much what tells nothing of the model raises errors above those of all other samples.

    Args:
        observed: Squares of the segments of each recording.
        beyond_fitted: What samples beyond the fitted range add, by channel of each recording, SI.
        expected: Error of a correct model in each recording.
    """
    segments = excused_segments(observed, expected)
    squares = [
        {channel: max(_excess(own, those), beyond.get(channel, 0.0)) for channel, own in found.items()}
        for found, those, beyond in zip(observed, segments, beyond_fitted, strict=True)
    ]
    return Excused(squares, int(sum(map(np.count_nonzero, segments))))


def _excess(squares: Array, excused: Mask) -> float:
    those = np.broadcast_to(excused, squares.shape)
    if not those.any() or those.all():
        return 0.0
    return max(float(np.sum(squares[those]) - np.mean(squares[~those]) * np.count_nonzero(those)), 0.0)


def _beyond_population(squares: SegmentSquares, expected: ExpectedError) -> Mask:
    """Return the segments (S,) whose motion errs more than that of all segments of a correct model."""
    channels = _motion_channels(squares, expected)
    if not channels:
        return np.zeros(1, dtype=bool)
    relative = np.mean([squares[c] * squares[c].size / expected.rms[c] ** 2 for c in channels], axis=0)
    return np.asarray(relative > np.mean([expected.population[c] for c in channels], axis=0).max())


def _motion_channels(squares: SegmentSquares, expected: ExpectedError) -> list[str]:
    return [c for c in MOTION_CHANNELS if c in squares and c in expected.population and expected.rms[c] > 0.0]


IMMATERIAL = {"train": GOOD_ERROR_RATIO, "test": GOOD_TEST_ERROR_RATIO}
SEED = 20262
Squares = Sequence[Mapping[str, float]]  # for each recording, by channel


def judge_fit(
    results: Sequence[Sequence[ChannelResult]],
    expected: Sequence[ExpectedError],
    parameter_squares: Callable[[], Squares],
    excused: Excused,
) -> LackOfFit | None:
    """Judge the errors of a model.

    Args:
        results: Errors of the channels of each recording.
        expected: Error of a correct model in each recording.
        parameter_squares: Returns the mean square error (SI) that the uncertainty of the parameters causes; called
            only where noise does not explain the errors.
        excused: What tells nothing of the model.

    Returns:
        The judgement; None where nothing was compared.
    """
    flat = [one for rows in results for one in rows]
    use = "train" if overall_error(flat, "test") is None else "test"
    error = overall_error(flat, use)
    if error is None:
        return None
    certain = [one._replace(noise_error={}) for one in expected]
    noise_alone = judged = _Family(results, certain, use, error, [{} for _ in results], excused.squares)
    if noise_alone.p < TAIL:
        judged = replace(noise_alone, expected=expected, parameter_squares=parameter_squares())
    lacks = judged.p < TAIL
    large = judged.with_excess(BAD_ERROR_RATIO)
    undetermined = noise_alone.p < TAIL and not lacks and error > large
    limit = min(judged.limit, max(noise_alone.limit, large))
    worst = worst_channel(judged.worst) if lacks and judged.worst else None
    return LackOfFit(lacks, judged.p, undetermined, use, error, limit, excused.segments, worst)


def worst_channel(result: ChannelResult) -> WorstChannel:
    """Return the error of a channel as the judgement has it."""
    return WorstChannel(**named(result, "recording channel ratio_to_noise"))


class _Channel(NamedTuple):
    """The error of a channel, that of a correct model, and what parameters and excused samples add to its square."""

    result: ChannelResult
    expected: ExpectedError
    parameter_square: float
    excess: float

    @property
    def error(self) -> float:
        """The error over noise without what is excused."""
        return math.sqrt(max(self.result.ratio_to_noise**2 - self.excess, 0.0))


@dataclass(frozen=True)
class _Family:
    """The tests of one judgement: the printed error, and each pressure or force of any recording.

    The motion of one recording is not tested; its part of the printed error is. ``excess``: what excused
    samples add to the mean square error of each channel, SI.
    """

    results: Sequence[Sequence[ChannelResult]]
    expected: Sequence[ExpectedError]
    use: str
    error: float
    parameter_squares: Squares
    excess: Squares

    @cached_property
    def recordings(self) -> list[list[_Channel]]:
        """The channels of each recording."""
        rows = zip(self.results, self.expected, self.parameter_squares, self.excess, strict=True)
        return [
            [
                _Channel(r, one, squares.get(r.channel, 0.0) / r.noise**2, excess.get(r.channel, 0.0) / r.noise**2)
                for r in found
                if is_judged(r, one)
            ]
            for found, one, squares, excess in rows
        ]

    @cached_property
    def overall_excess(self) -> float:
        """What excused samples add to the square of the printed error."""
        return float(np.mean([c.excess for rows in self.recordings for c in rows if c.result.use == self.use] or [0.0]))

    def with_excess(self, error: float) -> float:
        """Return the printed error that has the excess of excused samples besides ``error``."""
        return math.sqrt(error**2 + self.overall_excess)

    @cached_property
    def distribution(self) -> ErrorDistribution | None:
        """The distribution of the printed error."""
        mine = [rows for rows in self.recordings if rows and rows[0].result.use == self.use]
        whole = combined_distribution(
            [
                (rows[0].expected.distribution([c.result.channel for c in rows], certain_noise=True), len(rows))
                for rows in mine
            ]
        )
        squares = [c.parameter_square for rows in mine for c in rows]
        if whole is None:
            return None
        of_noise = noise_error([(rows[0].expected, [c.result.channel for c in rows]) for rows in mine])
        return whole.with_uncertain_parameters(float(np.mean(squares))).with_uncertain_noise(of_noise)

    @property
    def limit(self) -> float:
        """The printed error below which a model counts as correct; a small excess is immaterial."""
        small = IMMATERIAL[self.use]
        return self.with_excess(small if self.distribution is None else max(small, self.distribution.limit(TAIL / 2)))

    @cached_property
    def channels(self) -> list[tuple[float, ChannelResult]]:
        """The p value of each channel, that of an immaterial error being 1, the most improbable one first."""
        found = [c for rows in self.recordings for c in rows if c.result.channel not in MOTION_CHANNELS]
        rated = [(_p_value(c), c.result) for c in found]
        return sorted(rated, key=lambda one: (one[0], -one[1].ratio_to_noise))

    @cached_property
    def p(self) -> float:
        """The p value of all tests together (Bonferroni)."""
        single = len(self.channels) * self.channels[0][0] if self.channels else 1.0
        error = math.sqrt(max(self.error**2 - self.overall_excess, 0.0))
        whole = None if error <= IMMATERIAL[self.use] else self.distribution
        printed = 1.0 if whole is None else whole.p_value(error)
        return min(2 * min(single, printed), 1.0)

    @property
    def worst(self) -> ChannelResult | None:
        """The channel that is least probable, or else the one with the largest error."""
        if self.channels and self.channels[0][0] < 1.0:
            return self.channels[0][1]
        return max((c.result for rows in self.recordings for c in rows), key=lambda r: r.ratio_to_noise, default=None)


def is_judged(result: ChannelResult, expected: ExpectedError) -> bool:
    """Whether the error of a channel has a distribution to be compared with."""
    return result.noise > 0.0 and bool(np.isfinite(result.ratio_to_noise)) and result.channel in expected.population


def _p_value(channel: _Channel) -> float:
    """Return the probability of a channel's error if the model were correct; 1 where the error is immaterial."""
    if channel.error <= BAD_ERROR_RATIO:
        return 1.0
    whole = channel.expected.distribution([channel.result.channel])
    return whole.with_uncertain_parameters(channel.parameter_square).p_value(channel.error)


def parameter_error_squares(model: Model, drawn: Sequence[Model], experiments: Sequence[Experiment]) -> Squares:
    """Return the mean square error (SI) that the uncertainty of the parameters causes, by channel.

    Args:
        model: The model.
        drawn: Models whose parameters are drawn from the uncertainty of its own. In held-out recordings, whose
            commands may lie between those of the fit, the areas of their valves err as far as a map interpolates.
        experiments: The experiments.

    Returns:
        One mapping for each experiment; empty without draws.
    """
    normal = np.random.default_rng(SEED).standard_normal(len(drawn))
    new_commands = [_with_other_areas(other, number) for other, number in zip(drawn, normal, strict=True)]
    found = []
    for experiment in experiments:
        nominal = simulate_outputs(model, experiment)
        squares: dict[str, list[float]] = {}
        for other in new_commands if experiment.recording.use == "test" else drawn:
            for channel, values in simulate_outputs(other, experiment).items():
                squares.setdefault(channel, []).append(float(np.nanmean((values - nominal[channel]) ** 2)))
        found.append({channel: float(np.mean(s)) for channel, s in squares.items() if np.isfinite(s).all()})
    return found


def _with_other_areas(model: Model, deviation: float) -> Model:
    """Return a model whose valves err by so many standard uncertainties at commands between those of the fit."""
    first, *others = [one.scaled(1.0 + deviation * one.interpolation_uncertainty) for one in model.valves]
    return replace(model, valve=first, valve_2=others[0] if others else None)


MIN_HORIZON = 0.5  # s, in which the readings of most axes and valve tests change by most of their range
MIN_HORIZON_SAMPLES = 5  # samples within a horizon
RESPONSE_SHARE = 0.63  # of a reading's range: one time constant of a first-order response
MIN_RANGE_RATIO = 10.0  # of a reading's range over its noise; pure noise has 8 in 100,000 samples
STEPS = (1.0, 2.0, 5.0)  # of each power of ten


def free_runs(
    model: Model, experiments: Sequence[Experiment], drawn: Callable[[], Sequence[Model]]
) -> list[ChannelResult]:
    """Return the errors of a model that restarts only after gaps of a recording.

    Args:
        model: The model.
        experiments: Experiments; those whose motion is imposed have no state to start from, and no free run.
        drawn: Returns models whose parameters are drawn from the uncertainty of its own; called only where noise does
            not explain the errors.

    Returns:
        The error of each channel of each recording. Of a hundred correct models one exceeds its ``ratio_limit`` in any
        of the pressures and forces. Motion has no limit: a late break-away moves all that follows.
    """
    whole = [e.with_restarts(None) for e in experiments if e.recording.imposed is None]
    expected = expected_errors(model, whole)
    results = [compare(model, e, one.rms).results for e, one in zip(whole, expected, strict=True)]
    tail = TAIL / max(sum(map(len, results)), 1)
    noise_alone = [_with_limit(r, one, 0.0, tail) for rows, one in zip(results, expected, strict=True) for r in rows]
    if not any(exceeds_limit(r) for r in noise_alone):
        return noise_alone
    squares = parameter_error_squares(model, drawn(), whole)
    return [
        _with_limit(r, one, of_parameters.get(r.channel, 0.0), tail)
        for rows, one, of_parameters in zip(results, expected, squares, strict=True)
        for r in rows
    ]


def _with_limit(result: ChannelResult, expected: ExpectedError, square: float, tail: float) -> ChannelResult:
    """Return an error with its limit, where the parameters' uncertainty adds the mean square ``square``, SI."""
    if not is_judged(result, expected) or result.channel in MOTION_CHANNELS:
        return result
    distribution = expected.distribution([result.channel]).with_uncertain_parameters(square / result.noise**2)
    return replace(result, ratio_limit=max(distribution.limit(tail), BAD_ERROR_RATIO))


def exceeds_limit(result: ChannelResult) -> bool:
    """Return whether an error is larger than noise and the uncertainty of the parameters explain."""
    return result.ratio_limit is not None and result.ratio_to_noise > result.ratio_limit


def judge_with_free_runs(judged: LackOfFit | None, found: Sequence[ChannelResult]) -> LackOfFit | None:
    """Return the judgement of a model's error with that of its free runs; one beyond its limit is a lack of fit."""
    beyond = [r for r in found if exceeds_limit(r)]
    if judged is None or judged.present or not beyond:
        return judged
    worst = max(beyond, key=lambda r: r.ratio_to_noise / (r.ratio_limit or 1.0))
    return replace(judged, p=min(judged.p, TAIL), present=True, undetermined=False, worst=worst_channel(worst))


def default_horizon(recordings: Sequence[Recording]) -> float:
    """Return the horizon where the pipeline file states none.

    It is the longest time of the series 0.5, 1, 2, 5, ... s within which no reading changes by ``RESPONSE_SHARE`` of
    its range in any recording: the fastest response decides, because it restarts often enough for all others.

    Args:
        recordings: The recordings.

    Returns:
        The horizon in s, at least ``MIN_HORIZON`` and ``MIN_HORIZON_SAMPLES`` sampling periods.
    """
    free = [r for r in recordings if r.imposed is None]
    readings = [(y, r.period) for r in free for y in _readings(r)]
    horizon = max([MIN_HORIZON, *(MIN_HORIZON_SAMPLES * r.period for r in free)])
    if not readings:
        return horizon
    lags = _series(min(period for _, period in readings), max(y.size * period for y, period in readings))
    unresponsive = takewhile(lambda lag: not any(_responds_within(y, round(lag / p)) for y, p in readings), lags)
    return max([horizon, *unresponsive])


def _series(shortest: float, longest: float) -> Iterator[float]:
    """Yield the times of the series from ``shortest`` to ``longest``; in one of them a sine of any period responds."""
    for power in range(int(np.floor(np.log10(shortest))), int(np.floor(np.log10(longest))) + 1):
        yield from (step * 10.0**power for step in STEPS if shortest <= step * 10.0**power <= longest)


def _readings(recording: Recording) -> Iterator[Array]:
    """Yield the readings that respond; a constant, pure noise and derivatives of the position tell no time scale."""
    for name in ("p1", "p2", "temperature", "x" if "x" in recording else "v"):
        if name in recording:
            y = recording[name][np.isfinite(recording[name])]
            noise = recording.noise_rms(name)
            if y.size and np.ptp(y) > MIN_RANGE_RATIO * noise:
                yield y


def _responds_within(y: Array, lag: int) -> bool:
    """Whether a reading changes by ``RESPONSE_SHARE`` of its range over so many samples."""
    if not 0 < lag < y.size:
        return False
    return bool(np.max(np.abs(y[lag:] - y[:-lag])) >= RESPONSE_SHARE * np.ptp(y))
