"""Equivalence: effects that explain the data equally well, and which of them is named."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pneucli.diagnose.candidate import Candidate
from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.evidence import offset_from_null, score_gain
from pneucli.diagnose.hypothesis_tests import ALPHA, NOISE_COST_RATIO, min_relevant_reduction
from pneucli.diagnose.score import FittedModel
from pneucli.diagnose.smooth_term import SmoothTerm
from pneucli.diagnose.spline_regression import SplineRegression
from pneucli.identify.estimation.fit import Fit

CHI2_95_ONE_PARAMETER = 3.84  # 0.95 quantile of chi-square with one degree of freedom
NEGLIGIBLE_SHARE = 0.05  # of the cost, and of its reduction by an effect


def best_candidate(data: DiagnosisData, candidates: Sequence[Candidate]) -> Candidate:
    """Return the candidate with the lowest cost, or the simplest of those that explain the data equally well.

    Among equals a sensor fault comes last, because sensors are calibrated. A set-valued friction law predicts an
    interval of force, which fits as well as the correct law and says little about the motion: it must also not diverge
    in a free run.
    """
    best = min(candidates, key=lambda c: c.full.cost)
    equals = [c for c in candidates if not_inferior(c.full, best.full) or is_simpler(c, best)]
    equals.sort(key=lambda c: (len(c.effect.main_parameters), _is_sensor_fault(c), c.full.cost))
    return next(c for c in equals if not any(_set_valued_and_diverges(data, c, other) for other in equals))


def _set_valued_and_diverges(data: DiagnosisData, candidate: Candidate, other: Candidate) -> bool:
    """Whether a candidate with a set-valued law has a much larger free-run error than another one."""
    return candidate.effect.is_set_valued and data.free_run_error_diverges(other.full, candidate.full)


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


def is_simpler(candidate: Candidate, best: Candidate) -> bool:
    """Whether a candidate has fewer parameters and an immaterially higher cost, however significant.

    One more parameter would take up a part of the rig's imperfections that the correct effect leaves.
    """
    excess = candidate.full.cost - best.full.cost
    material = min(
        min_relevant_reduction(best.full.cost, best.full.residual_count),
        NEGLIGIBLE_SHARE * (candidate.reduced.cost - candidate.full.cost),
    )
    return len(candidate.effect.main_parameters) < len(best.effect.main_parameters) and excess < material


def indistinguishable(rival: Candidate, best: FittedModel) -> bool:
    """Whether the data cannot distinguish a rival from the best model, with a white residual.

    The excess cost is insignificant, or within the errors of the noise levels and of the initial states.
    """
    excess, reduction = rival.full.cost - best.cost, rival.reduced.cost - rival.full.cost
    return not_inferior(rival.full, best) or excess < NEGLIGIBLE_SHARE * min(best.cost, reduction + excess)


DISCREPANCY_READINGS = 10  # independent readings that an unmodelled effect is worth (docs/method.md)
CHANCE_COST_RATIO = math.exp(
    CHI2_95_ONE_PARAMETER / DISCREPANCY_READINGS
)  # ratio of two remaining variances that is within chance


def _similar_variance(remaining: float, own: float) -> bool:
    """Whether a remaining variance is no larger, and what it removes no smaller, than another but for chance."""
    return remaining < CHANCE_COST_RATIO * own and CHANCE_COST_RATIO * (1.0 - remaining) > 1.0 - own


def _log_variance(costs: Sequence[tuple[float, float]]) -> float:
    """Return the sum of n log s^2 over recordings, from their costs in units of noise and numbers n of residuals.

    s^2 is the maximum-likelihood variance of the residuals of a recording, noise and discrepancy together, and no less
    than the noise. The sum is -2 log of their predictive density but for a constant.
    """
    return math.fsum(n * math.log(max(cost / n, 1.0)) for cost, n in costs)


@dataclass(frozen=True)
class Term:
    """One effect of the last model: ``candidate`` is the step to it, ``rivals`` pass in its place."""

    candidate: Candidate
    rivals: tuple[Candidate, ...]

    def equivalents(self, data: DiagnosisData, *, complete: bool) -> list[Candidate]:
        """Return the rivals that the data cannot distinguish from the term's effect.

        With an unmodelled effect present (not ``complete``) the residual is not noise that averages out, but a few
        independent readings of that effect. Rivals that leave and remove about the same variance, in the residuals that
        the term's effect influences, may then differ by chance. A rival that explains another part of
        the residual is none.
        """
        if complete:
            return [c for c in self.rivals if indistinguishable(c, self.candidate.full)]
        own = self.remaining_variance(data)
        return [c for c in self.rivals if _similar_variance(self.remaining_variance(data, c), own)]

    def is_measured_exclusively(self, data: DiagnosisData) -> bool:
        """Whether the effect has exclusive channels with a cost in excess of noise: a direct reading beats an
        inference.
        """
        costs = data.exclusive_channel_costs(self.candidate.reduced, self.candidate.effect)
        return any(cost > NOISE_COST_RATIO * n for cost, n in costs)

    def remaining_variance(self, data: DiagnosisData, candidate: Candidate | None = None) -> float:
        """Return the ratio of the residuals' variances with and without a candidate (default: the term's own).

        It is the geometric mean over all readings, those not fitted included, each with the variance of its recording:
        exp(-2 / n) to the power of the gain of the log density. Squares themselves would count what one recording shows
        as much more as its residuals are larger. The residuals are those of the effect's exclusive channels where it
        has such (:meth:`is_measured_exclusively`), else those that it influences.
        """
        parts = data.exclusive_channel_costs if self.is_measured_exclusively(data) else data.recording_costs
        before, after = (
            [(cost, n) for cost, n in parts(fitted, self.candidate.effect) if n]
            for fitted in (self.candidate.reduced, (candidate or self.candidate).full)
        )
        count = math.fsum(n for _, n in before)
        return math.exp((_log_variance(after) - _log_variance(before)) / count) if count else 1.0


Array = NDArray[np.float64]


def nonparametric_rival(data: DiagnosisData, term: Term) -> SmoothTerm | None:
    """Return a smooth function of one signal that explains significantly more than the effect; None where none does.

    It must leave less in the channel on which the effect acts most, with the significance and materiality that are
    required of an effect, and the effect must add next to nothing to it. A function that contains the effect is no
    rival: a sensor with a curved characteristic has a scale, too.
    """
    channel = _most_affected_channel(data, term)
    return None if channel is None else _SmoothRivalTest(channel, term).better_rival()


@dataclass(frozen=True)
class _SmoothRivalTest:
    """The comparison of a term with smooth functions in one channel."""

    channel: SplineRegression
    term: Term

    def better_rival(self) -> SmoothTerm | None:
        """Return the first smooth function that explains the residual without the effect significantly better."""
        ranked = self.channel.ranked_terms(self._before)
        smooth_terms = [*ranked, *(self.channel.simple_terms(self._before, ranked[0]) if ranked else ())]
        reduced_cost, full_cost = (
            float(self.channel.block_costs(self._before).sum()),
            float(self._cost_with_effect.sum()),
        )
        competing = [
            smooth_term for smooth_term in smooth_terms if reduced_cost * (1.0 - smooth_term.share) < full_cost
        ]
        return next(
            (
                smooth_term
                for smooth_term in competing
                if not self._contains_effect(smooth_term) and self._better(smooth_term, len(smooth_terms))
            ),
            None,
        )

    def _contains_effect(self, smooth_term: SmoothTerm) -> bool:
        """Whether the effect, linearised, is in the span of a smooth function; unknown for an effect without a null.

        The derivatives of the model without the effect are projected out. Those of the model with it would contain the
        effect: friction that grows with the pressure is a multiple of the Coulomb friction.
        """
        distance = offset_from_null(self._after, self.term.candidate.effect)
        return (
            distance is not None
            and self.channel.unrepresented_share(self._before, smooth_term, self._after.jacobian @ distance)
            < NEGLIGIBLE_SHARE
        )

    def _better(self, smooth_term: SmoothTerm, tested_count: int) -> bool:
        remaining, full_cost = (
            self.channel.held_out_costs(self._before, smooth_term),
            float(self._cost_with_effect.sum()),
        )
        gain = score_gain(self._cost_with_effect, remaining)
        is_certain = gain.significant and gain.p_value * tested_count < ALPHA
        if not (
            is_certain and gain.total > min_relevant_reduction(full_cost, self.channel.residual_count(self._after))
        ):
            return False
        further_reduction = float((remaining - self.channel.held_out_costs(self._after, smooth_term)).sum())
        return further_reduction < NEGLIGIBLE_SHARE * (self.channel.cost_after_adjustment(self._before) - full_cost)

    @property
    def _before(self) -> Fit:
        return self.term.candidate.reduced.fit

    @property
    def _after(self) -> Fit:
        return self.term.candidate.full.fit

    @cached_property
    def _cost_with_effect(self) -> Array:
        return self.channel.block_costs(self._after)


def _most_affected_channel(data: DiagnosisData, term: Term) -> SplineRegression | None:
    """Return the channel whose cost an effect reduces most; None where it reduces none."""
    reduced, full, effect = term.candidate.reduced.fit, term.candidate.full.fit, term.candidate.effect
    keys = dict.fromkeys((type(v), name) for v in data.train if v.is_sensitive_to(effect) for name in v.channels)
    channels = [data.spline_regression(full, *key) for key in keys]
    reductions = [float((c.block_costs(reduced) - c.block_costs(full)).sum()) for c in channels]
    return channels[int(np.argmax(reductions))] if reductions and max(reductions) > 0.0 else None
