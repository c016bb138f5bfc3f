"""The free run: the model over a whole recording, started once.

Between restarts, a horizon apart, a slow error stays small. A model may follow every second of a recording and miss
all of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import takewhile

import numpy as np

from pneucli.arrays import Array
from pneucli.compare.channel_errors import compare
from pneucli.compare.expected_error import MOTION_CHANNELS, TAIL, ExpectedError, expected_errors
from pneucli.compare.goodness_of_fit import is_judged, parameter_error_squares, worst_channel
from pneucli.messages.compare import BAD_ERROR_RATIO, ChannelResult, LackOfFit
from pneucli.recording import Recording
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model

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
