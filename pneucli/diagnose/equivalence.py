"""Equivalence: effects that explain the data equally well, and which of them is named."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from pneucli.diagnose.candidate import Candidate
from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.evidence import score_gain
from pneucli.diagnose.score import FittedModel, RecordingCost

CHI2_95_ONE_PARAMETER = 3.84  # 0.95 quantile of chi-square with one degree of freedom
NOISE_COST_RATIO = 1.05  # times the cost of sensor noise alone: below this a channel shows noise alone


def best_candidate(candidates: Sequence[Candidate]) -> Candidate:
    """Return the candidate with the lowest cost, or the simplest of those that explain the data equally well.

    Among equals a sensor fault comes last, because sensors are calibrated.
    """
    best = min(candidates, key=lambda c: c.full.cost)
    equals = [c for c in candidates if not_inferior(c.full, best.full)]
    return min(equals, key=lambda c: (len(c.effect.main_parameters), _is_sensor_fault(c), c.full.cost))


def _is_sensor_fault(candidate: Candidate) -> bool:
    return candidate.effect.part == "sensor"


def not_inferior(fitted: FittedModel, best: FittedModel) -> bool:
    """Whether the data cannot show that ``fitted`` explains them less well than ``best``.

    Its cost is not significantly higher or, in units of the remaining variance, exceeds the other by no more than one
    parameter takes up by chance: equivalent effects differ by rounding errors of the fit, consistently in every block.
    """
    excess = fitted.cost - best.cost
    within_chance = excess < CHI2_95_ONE_PARAMETER * max(best.cost / max(best.residual_count, 1), 1.0)
    return within_chance or not score_gain(fitted.costs, best.costs).significant


DISCREPANCY_READINGS = 10  # independent readings that an unmodelled effect is worth (docs/method.md)
CHANCE_COST_RATIO = math.exp(
    CHI2_95_ONE_PARAMETER / DISCREPANCY_READINGS
)  # ratio of two remaining variances that is within chance


def _similar_variance(remaining: float, own: float) -> bool:
    """Whether a remaining variance is no larger, and what it removes no smaller, than another but for chance."""
    return remaining < CHANCE_COST_RATIO * own and CHANCE_COST_RATIO * (1.0 - remaining) > 1.0 - own


@dataclass(frozen=True)
class Term:
    """One effect of the last model: ``candidate`` is the step to it, ``rivals`` pass in its place."""

    candidate: Candidate
    rivals: tuple[Candidate, ...]

    def equivalents(self, data: DiagnosisData, *, complete: bool) -> list[Candidate]:
        """Return the rivals that the data cannot distinguish from the term's effect.

        With an unmodelled effect present (not ``complete``) the residual is not noise that averages out, but a few
        independent readings of that effect. Rivals that leave and remove about the same variance, of the channel that
        the term's effect explains best, may then differ by chance. A rival that explains another part of the residual
        is none.
        """
        if complete:
            return [c for c in self.rivals if not_inferior(c.full, self.candidate.full)]
        own = self.remaining_variance(data)
        return [c for c in self.rivals if _similar_variance(self.remaining_variance(data, c), own)]

    def is_measured_exclusively(self, data: DiagnosisData) -> bool:
        """Whether the effect has exclusive channels with a cost in excess of noise: a direct reading beats an
        inference.
        """
        costs = data.exclusive_channel_costs(self.candidate.reduced, self.candidate.effect)
        return any(one.cost > NOISE_COST_RATIO * one.residual_count for one in costs)

    def remaining_variance(self, data: DiagnosisData, candidate: Candidate | None = None) -> float:
        """Return the ratio of the residuals' variances with and without a candidate (default: the term's own).

        It is the geometric mean over all readings of a channel, those not fitted included, each with the variance of
        its recording: exp(-2 / n) to the power of the gain of the log density. Squares themselves would count what one
        recording shows as much more as its residuals are larger. The readings are those of the effect's exclusive
        channels where it has such (:meth:`is_measured_exclusively`), else those of the channel that the term's effect
        explains best: a leak of chamber 1 says nothing of p2.
        """
        own = self._variance_ratios(data, self.candidate)
        if not own:
            return 1.0
        best = min(own, key=lambda channel: own[channel])
        return own[best] if candidate is None else self._variance_ratios(data, candidate).get(best, 1.0)

    def _variance_ratios(self, data: DiagnosisData, candidate: Candidate) -> dict[str, float]:
        """Return the ratio of the variances by channel; exclusive channels, which measure the effect, count as one."""
        effect, exclusive = self.candidate.effect, self.is_measured_exclusively(data)

        def costs_of(fitted: FittedModel) -> dict[str, list[RecordingCost]]:
            if not exclusive:
                return data.recording_costs(fitted, effect)
            return {"exclusive": [c for c in data.exclusive_channel_costs(fitted, effect) if c.residual_count]}

        before, after = costs_of(candidate.reduced), costs_of(candidate.full)
        gains = {name: _log_variance(after.get(name, [])) - _log_variance(costs) for name, costs in before.items()}
        return {
            name: math.exp(gains[name] / math.fsum(c.residual_count for c in costs)) for name, costs in before.items()
        }


def _log_variance(costs: Sequence[RecordingCost]) -> float:
    return math.fsum(c.log_variance() for c in costs)
