"""The free-run error of ``compare`` for every model of the selection."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, TypeVar

from pneucli.compare import ChannelResult, Comparison, compare, overall_error
from pneucli.compare.error_regions import excess_beyond_fitted
from pneucli.compare.expected_error import ExpectedError, combined_distribution, expected_errors
from pneucli.compare.goodness_of_fit import (
    SegmentSquares,
    Squares,
    excused_error,
    free_runs,
    is_judged,
    judge_fit,
    judge_with_free_runs,
    parameter_error_squares,
)
from pneucli.diagnose.score import ErrorsByUse
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.intervals import draw_parameters
from pneucli.messages.compare import LackOfFit
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model, with_parameters

T = TypeVar("T")
Results = tuple[ChannelResult, ...]


class _Compared(NamedTuple):
    """Errors of one recording; the squares of segments, and what samples beyond the fitted range add, SI."""

    results: Results
    segments: SegmentSquares
    beyond_fitted: Mapping[str, float]


@dataclass(frozen=True)
class FreeRunErrors:
    """The free-run errors of models in units of the error of a correct model, as ``compare`` states them.

    That error depends on the model: a damper in it, and trajectories err less. Two models are therefore compared in
    units of one of them, the ``reference``; otherwise a model whose errors fall in mm and bar may seem to rise.

    Both the simulation of a model and the Monte Carlo simulation of its noise are done once for each model.
    """

    experiments: Sequence[Experiment]
    _compared: list[tuple[Model, list[_Compared]]] = field(default_factory=list)
    _expected: list[tuple[Model, list[ExpectedError]]] = field(default_factory=list)
    _free_runs: list[tuple[Model, list[ChannelResult]]] = field(default_factory=list)

    def __call__(self, model: Model, reference: Model | None = None) -> ErrorsByUse:
        """Return the model's errors {"train": ..., "test": ...}; None where no recording has that use."""
        results = self.channels(model, reference)
        return {use: overall_error(results, use) for use in ("train", "test")}

    def channels(self, model: Model, reference: Model | None = None) -> list[ChannelResult]:
        """Return the model's error in every channel of every recording."""
        return [result for results in self._errors(model, reference)[0] for result in results]

    def comparisons(self, model: Model) -> list[Comparison]:
        """Return the comparison of the model with each recording."""
        expected = self._errors(model)[1]
        return [compare(model, e, one.rms) for e, one in zip(self.experiments, expected, strict=True)]

    def limits(self, model: Model) -> ErrorsByUse:
        """Return the errors that a correct model exceeds once in a hundred times, in units of its expected error."""
        found: dict[str, float | None] = {}
        for use in ("train", "test"):
            judged = [
                (one, [r.channel for r in results if r.use == use and is_judged(r, one)])
                for results, one in zip(*self._errors(model), strict=True)
            ]
            whole = combined_distribution([(one.distribution(names), len(names)) for one, names in judged if names])
            found[use] = None if whole is None else whole.limit()
        return found

    def judge(self, fitted: Fit) -> LackOfFit | None:
        """Judge the errors of a fitted model by the uncertainty of its parameters; None where nothing is compared."""
        model, (own, expected) = fitted.model, self._errors(fitted.model)
        found = self._results_of(model, expected)
        excused = excused_error([one.segments for one in found], [one.beyond_fitted for one in found], expected)

        def squares() -> Squares:
            return parameter_error_squares(model, _drawn_models(fitted), self.experiments)

        return judge_with_free_runs(judge_fit(own, expected, squares, excused), self.free_runs(fitted))

    def free_runs(self, fitted: Fit) -> list[ChannelResult]:
        """Return the errors of a fitted model over whole recordings."""

        def compute(model: Model) -> list[ChannelResult]:
            return free_runs(model, self.experiments, lambda: _drawn_models(fitted))

        return _once(self._free_runs, fitted.model, compute)

    def _errors(self, model: Model, reference: Model | None = None) -> tuple[list[Results], list[ExpectedError]]:
        """Return the errors of each experiment, and those if the reference were correct."""
        expected = _once(
            self._expected,
            model if reference is None else reference,
            lambda correct: expected_errors(correct, self.experiments),
        )

        own = self._results_of(model, expected)
        in_units = [
            tuple(result.in_units_of(one.rms[result.channel]) for result in found.results)
            for found, one in zip(own, expected, strict=True)
        ]
        return in_units, expected

    def _results_of(self, model: Model, expected: Sequence[ExpectedError]) -> list[_Compared]:
        """Return the errors of a model in each experiment, in any units."""

        def compared(model: Model) -> list[_Compared]:
            found = [compare(model, e, one.rms) for e, one in zip(self.experiments, expected, strict=True)]
            beyond = excess_beyond_fitted(found)
            return [_Compared(c.results, c.segment_squares, b) for c, b in zip(found, beyond, strict=True)]

        return _once(self._compared, model, compared)


def _drawn_models(fitted: Fit) -> list[Model]:
    """Return models whose parameters are drawn from the uncertainty of a fit."""
    return [with_parameters(fitted.model, values) for values in draw_parameters(fitted)]


def _once(known: list[tuple[Model, T]], model: Model, compute: Callable[[Model], T]) -> T:
    """Return what is known of this very model, else compute it and keep it."""
    for known_model, value in known:
        if known_model is model:
            return value
    known.append((model, compute(model)))
    return known[-1][1]


def held_out_error(errors: ErrorsByUse) -> float | None:
    """Return the error on held-out recordings; on fitted ones where none is held out."""
    return errors["train"] if errors["test"] is None else errors["test"]


def relative_error(first: ErrorsByUse, last: ErrorsByUse) -> float | None:
    """Return the last held-out error over the first, both in the same units; None where one is unknown or zero."""
    before, after = held_out_error(first), held_out_error(last)
    return after / before if before and after is not None else None


def remaining_error_share(first: ErrorsByUse, last: ErrorsByUse) -> float | None:
    """Return the remaining part of the squared error in excess of noise; None where an error is unknown."""
    before, after = held_out_error(first), held_out_error(last)
    if before is None or after is None:
        return None
    if before <= 1.0:
        return 0.0
    return min(max((after**2 - 1.0) / (before**2 - 1.0), 0.0), 1.0)


def removed_error_share(first: ErrorsByUse, last: ErrorsByUse) -> float | None:
    """Return the removed part of the squared error in excess of noise; None where there is no such error."""
    before, remaining = held_out_error(first), remaining_error_share(first, last)
    return None if before is None or before <= 1.0 or remaining is None else 1.0 - remaining
