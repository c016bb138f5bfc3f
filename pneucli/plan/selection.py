"""Choose manoeuvres one after the other: the one that lowers the expected entropy most for its time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from operator import add

import numpy as np
from numpy.typing import NDArray

from pneucli.plan.bench import Bench
from pneucli.plan.entropy import expected_entropy
from pneucli.plan.information import Information
from pneucli.plan.limits import Violation
from pneucli.plan.manoeuvre import Manoeuvre
from pneucli.plan.sizes import MIN_SIZE_ERROR, EffectSize

Array = NDArray[np.float64]

CHANGE_OVER_TIME = 2.0  # s of machine time between two manoeuvres, to save a file and start the next
MIN_GAIN = 0.002  # of the objective at the start: less is not worth another manoeuvre
MIN_TEST_GAIN = 0.02  # of the objective of held-out recordings: less is not worth another one
TEST_SHARE = 0.3  # of the machine time that is kept for recordings that are held out

Objective = Callable[[Information], float]


@dataclass(frozen=True)
class Evaluated:
    """A candidate with what it tells."""

    manoeuvre: Manoeuvre
    information: Information


@dataclass(frozen=True)
class Refused:
    """A candidate that could exceed a limit: the model with which it does, and the limits."""

    manoeuvre: Manoeuvre
    model: str
    violations: tuple[Violation, ...]


@dataclass(frozen=True)
class Chosen:
    """A chosen manoeuvre, and the objective after it and all before it."""

    manoeuvre: Manoeuvre
    information: Information
    objective: float


def entropy_objective(prior: Sequence[float], size_errors: Sequence[float], covariance: Array) -> Objective:
    """Return the expected entropy in bits of "which effect" after a plan.

    Args:
        prior: Prior weights of the best model and of each rival.
        size_errors: Relative standard errors of the effects' sizes.
        covariance: Covariance of the parameters of the best model before the plan.
    """
    return lambda told: expected_entropy(told.between_rivals(covariance), prior, size_errors)


def width_objective(covariance: Array, positions: Sequence[int]) -> Objective:
    """Return the mean log10 of the standard errors of some parameters after a plan (Ds-optimality).

    Args:
        covariance: Covariance of the parameters before the plan, shape (p, p).
        positions: Positions of the parameters in question.
    """

    def objective(told: Information) -> float:
        after = told.parameter_covariance(covariance)
        return float(np.mean([0.5 * np.log10(max(after[i, i], 1e-300)) for i in positions]))

    return objective


def size_objective(sizes: Sequence[EffectSize], covariance: Array) -> Objective:
    """Return the mean log10 of the relative standard errors of the effects' sizes after a plan.

    Args:
        sizes: The sizes, each effect alone beside the best model.
        covariance: Covariance of the parameters of the best model before the plan, shape (p, p).
    """

    def objective(told: Information) -> float:
        return float(np.mean([np.log10(max(one.error_after(told, covariance), MIN_SIZE_ERROR)) for one in sizes]))

    return objective


def choose_sequence(
    candidates: Sequence[Evaluated],
    objective: Objective,
    seconds: float,
    is_safe: Callable[[Manoeuvre], bool],
    least: int = 1,
) -> list[Chosen]:
    """Choose manoeuvres greedily, within a machine time that leaves room for held-out recordings.

    Args:
        candidates: The candidates with their information.
        objective: What to lower.
        seconds: Machine time in s, held-out recordings included.
        is_safe: Whether a manoeuvre keeps all limits in every rival; asked only of what would be chosen.
        least: Number of manoeuvres to choose even where the objective hardly falls.

    Returns:
        The chosen manoeuvres, in their order; the last ones are to be held out.
    """
    if not candidates:
        return []
    nothing = replace(candidates[0].information, matrix=0.0 * candidates[0].information.matrix)
    start = reached = objective(nothing)
    told, left = nothing, (1.0 - TEST_SHARE) * seconds
    chosen: list[Chosen] = []
    open_candidates = list(candidates)
    while open_candidates:
        fitting = [c for c in open_candidates if c.manoeuvre.duration + CHANGE_OVER_TIME <= left]
        ranked = sorted(
            ((objective(told + c.information), c) for c in fitting),
            key=lambda one: (one[0] - reached) / _cost(one[1].manoeuvre),
        )
        safe = next(((value, c) for value, c in ranked if is_safe(c.manoeuvre)), None)
        if safe is None or (len(chosen) >= least and reached - safe[0] < MIN_GAIN * max(abs(start), 1.0)):
            break
        value, best = safe
        told, reached, left = told + best.information, value, left - best.manoeuvre.duration - CHANGE_OVER_TIME
        chosen.append(Chosen(best.manoeuvre, best.information, value))
        refused = {id(c) for _, c in ranked[: ranked.index(safe)]}
        open_candidates = [c for c in open_candidates if c is not best and id(c) not in refused]
    used = sum(_cost(c.manoeuvre) for c in chosen)
    return chosen + _held_out(chosen, open_candidates, objective, seconds - used, is_safe)


def _cost(manoeuvre: Manoeuvre) -> float:
    return manoeuvre.duration + CHANGE_OVER_TIME


def _held_out(
    chosen: Sequence[Chosen],
    rest: Sequence[Evaluated],
    objective: Objective,
    seconds: float,
    is_safe: Callable[[Manoeuvre], bool],
) -> list[Chosen]:
    """Return test recordings: one for each bench, then more as long as they tell more.

    The diagnosis wants an effect confirmed by recordings that it does not fit, so that they have to show it as well.
    Each is a remaining manoeuvre of a bench that is set up; a repetition where none fits into the time.
    """
    drives = {(c.manoeuvre.bench.name, c.manoeuvre.bench.drive) for c in chosen}
    others = [e for e in rest if (e.manoeuvre.bench.name, e.manoeuvre.bench.drive) in drives]
    tests = _Tests(objective, seconds, is_safe)
    for bench in dict.fromkeys(c.manoeuvre.bench.name for c in chosen):
        repetitions = [Evaluated(c.manoeuvre, c.information) for c in chosen if c.manoeuvre.bench.name == bench]
        if not tests.add([e for e in others if e.manoeuvre.bench.name == bench]):
            tests.add(repetitions)
    while tests.add(others, MIN_TEST_GAIN):
        pass
    return tests.chosen


@dataclass
class _Tests:
    """Test recordings so far, the time in s that is left for others, and the objective that they reach together."""

    objective: Objective
    seconds: float
    is_safe: Callable[[Manoeuvre], bool]
    chosen: list[Chosen] = field(default_factory=list)
    reached: float = np.inf

    def add(self, group: Sequence[Evaluated], min_gain: float = -np.inf) -> bool:
        """Add the safe manoeuvre of a group that lowers the objective most; return whether one lowers it enough."""
        told = [c.information for c in self.chosen]
        used = {id(one) for one in told}
        fitting = [e for e in group if _cost(e.manoeuvre) <= self.seconds and id(e.information) not in used]
        ranked = sorted(
            ((self.objective(reduce(add, told, e.information)), e) for e in fitting), key=lambda one: one[0]
        )
        best = next(((value, e) for value, e in ranked if self.is_safe(e.manoeuvre)), None)
        if best is None or not self.reached - best[0] >= min_gain * max(abs(self.reached), 1.0):
            return False
        self.reached, one = best
        self.seconds -= _cost(one.manoeuvre)
        self.chosen.append(Chosen(replace(one.manoeuvre, use="test"), one.information, np.nan))
        return True


def grouped_by_setup(chosen: Sequence[Chosen], benches: Sequence[Bench]) -> list[Chosen]:
    """Return recordings in the order of the benches and of how each is driven, those by hand last on each.

    Nothing is then set up twice.

    Args:
        chosen: The chosen recordings.
        benches: The benches in their order, one for each way in which it is driven.
    """
    order = list(dict.fromkeys(bench.setup for bench in benches))
    return sorted(chosen, key=lambda c: (order.index(c.manoeuvre.bench.setup), c.manoeuvre.by_hand))


def total_information(chosen: Sequence[Chosen]) -> Information:
    """Return what all fitted recordings of a plan tell together."""
    return reduce(add, [c.information for c in chosen if c.manoeuvre.use == "train"])
