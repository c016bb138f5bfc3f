"""Of effects that explain the data alike: which one to name, and which are told beside it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pneucli.diagnose.data import Candidate, DiagnosisData, FittedModel
from pneucli.diagnose.evidence import offset_from_null, score_gain
from pneucli.diagnose.hypothesis_tests import ALPHA, NOISE_COST_RATIO, min_relevant_reduction
from pneucli.diagnose.smooth_term import SmoothTerm, SplineRegression
from pneucli.identify.estimation.fit import Fit
from pneucli.physics.declaration import Effect

CHI2_95_ONE_PARAMETER = 3.84  # chi-square of one degree of freedom, exceeded by chance once in 20
NEGLIGIBLE_SHARE = 0.05  # of the cost, and of what an effect takes of it


def best_candidate(bench: DiagnosisData, trials: Sequence[Candidate]) -> Candidate:
    """Return the trial that leaves least, or the simplest of those that leave as little.

    Of equals a sensor's fault comes last: sensors are calibrated, rigs are not. Bounds of a force hold as well as the
    law of it, and say little of how the piston moves: that must replay as well.
    """
    best = min(trials, key=lambda t: t.full.cost)
    alike = [t for t in trials if not_inferior(t.full, best.full) or is_simpler(t, best)]
    alike.sort(key=lambda t: (len(t.effect.main_parameters), _is_sensor_fault(t), t.full.cost))
    return next(t for t in alike if not any(_set_valued_and_diverges(bench, t, other) for other in alike))


def _set_valued_and_diverges(bench: DiagnosisData, trial: Candidate, other: Candidate) -> bool:
    """Whether a trial states bounds of a force and replays far worse than another does."""
    return trial.effect.is_set_valued and bench.free_run_error_diverges(other.full, trial.full)


def _is_sensor_fault(trial: Candidate) -> bool:
    return trial.effect.part == "sensor"


def not_inferior(state: FittedModel, best: FittedModel) -> bool:
    """Whether the data cannot tell that ``state`` explains them less well than ``best``.

    It costs no more for certain or, in units of the variance that is left, no more than one parameter takes up by
    chance: twins differ by the last digits of their fits, which is certain in every block.
    """
    more = state.cost - best.cost
    within_chance = more < CHI2_95_ONE_PARAMETER * max(best.cost / max(best.residual_count, 1), 1.0)
    return within_chance or not score_gain(state.costs, best.costs).significant


def is_simpler(trial: Candidate, best: Candidate) -> bool:
    """Whether a trial has fewer parameters and leaves no more than does not matter.

    However certain: one parameter more takes up what the true law leaves of the rig's imperfections.
    """
    more = trial.full.cost - best.full.cost
    matters = min(
        min_relevant_reduction(best.full.cost, best.full.residual_count),
        NEGLIGIBLE_SHARE * (trial.reduced.cost - trial.full.cost),
    )
    return len(trial.effect.main_parameters) < len(best.effect.main_parameters) and more < matters


def indistinguishable(rival: Candidate, best: FittedModel) -> bool:
    """Whether the data cannot tell an effect's rival from it, where noise alone is left.

    It is as good, or costs so little more that what is known of the noise and of the state at each restart does not
    decide.
    """
    more, gained = rival.full.cost - best.cost, rival.reduced.cost - rival.full.cost
    return not_inferior(rival.full, best) or more < NEGLIGIBLE_SHARE * min(best.cost, gained + more)


MIN_REMAINING_SHARE = 0.005  # of what there was: what is left beyond noise is not known better
DISCREPANCY_READINGS = 10  # readings, as which what is unknown besides counts (docs/diagnosis.md)
CHANCE_COST_RATIO = math.exp(
    CHI2_95_ONE_PARAMETER / DISCREPANCY_READINGS
)  # the ratio of what two leave that is no more than chance


def _similar_share(left: float, mine: float) -> bool:
    """Whether what one leaves is no more than what another does, and what it takes no less, but for chance."""
    return left < CHANCE_COST_RATIO * mine and CHANCE_COST_RATIO * (1.0 - left) > 1.0 - mine


@dataclass(frozen=True)
class Term:
    """One effect of the last model: ``candidate``, the step to it from the model without, and what passed all tests there
    in its place.
    """

    candidate: Candidate
    rivals: tuple[Candidate, ...]

    def equivalents(self, bench: DiagnosisData, *, complete: bool) -> list[Candidate]:
        """Return the rivals that the data cannot tell from the named effect.

        Where it is not ``complete``, what is left is no noise that would average out, but a few independent readings of
        something unknown: of two that leave about as much of what the named one acts in, and take about as much, the
        one may be ahead by chance. What explains more of something else is no rival there.
        """
        if complete:
            return [t for t in self.rivals if indistinguishable(t, self.candidate.full)]
        mine = self.remaining_share(bench)
        return [t for t in self.rivals if _similar_share(self.remaining_share(bench, t), mine)]

    def is_measured_exclusively(self, bench: DiagnosisData) -> bool:
        """Whether readings show such an effect alone, and show anything of it: a direct reading beats an inference."""
        return bool(self._remaining_shares(bench.exclusive_channel_costs, self.candidate.full))

    def remaining_share(self, bench: DiagnosisData, trial: Candidate | None = None) -> float:
        """Return the part of the squares beyond noise that a trial leaves there, the named one if none is given.

        Of readings that show such an effect alone, where there are such (:meth:`is_measured_exclusively`). Else of what the named
        effect acts in. Of the fitted recordings or of those held out, of which it leaves more: a stand-in takes up the
        ones and not the others.
        """
        after = (trial or self.candidate).full
        left = self._remaining_shares(bench.exclusive_channel_costs, after) or self._remaining_shares(
            bench.sensitive_costs, after
        )
        return min(max([MIN_REMAINING_SHARE, *left]), 1.0 / MIN_REMAINING_SHARE) if left else 1.0

    def _remaining_shares(
        self, parts: Callable[[FittedModel, Effect], Sequence[tuple[float, float]]], after: FittedModel
    ) -> list[float]:
        """Return what a state leaves of each part in which more than noise was."""
        pairs = zip(
            parts(self.candidate.reduced, self.candidate.effect), parts(after, self.candidate.effect), strict=True
        )
        return [(end - n) / (start - n) for (start, n), (end, _) in pairs if start > NOISE_COST_RATIO * n]


Array = NDArray[np.float64]


def nonparametric_rival(bench: DiagnosisData, place: Term) -> SmoothTerm | None:
    """Return a law of one signal that stands better in the place of an effect; None where none surely does.

    In the channel of which the effect takes most the law leaves less, as surely as if it were one effect more and by as
    much as matters, and beside it next to nothing is left for the effect. A law of which the effect is a part says
    nothing against it: a sensor with a curved characteristic has a scale, too.
    """
    channel = _most_affected_channel(bench, place)
    return None if channel is None else _SmoothRivalTest(channel, place).better_rival()


@dataclass(frozen=True)
class _SmoothRivalTest:
    """An effect in its place against laws, in one channel."""

    channel: SplineRegression
    term: Term

    def better_rival(self) -> SmoothTerm | None:
        """Return the law that wins: it explains what the model without the effect leaves, and better than this does."""
        ranked = self.channel.ranked_terms(self._before)
        laws = [*ranked, *(self.channel.simple_terms(self._before, ranked[0]) if ranked else ())]
        there, named = float(self.channel.block_costs(self._before).sum()), float(self._cost_with_effect.sum())
        able = [law for law in laws if there * (1.0 - law.share) < named]
        return next((law for law in able if not self._contains_effect(law) and self._better(law, len(laws))), None)

    def _contains_effect(self, law: SmoothTerm) -> bool:
        """Whether the effect, to first order, is a part of what a law may be; not known of one that has no null.

        Beside the derivatives of the model without it: friction that grows with the pressure is so many times the dry
        friction, whose own derivative has the effect in it where that is in the model.
        """
        away = offset_from_null(self._after, self.term.candidate.effect)
        return (
            away is not None
            and self.channel.unrepresented_share(self._before, law, self._after.jacobian @ away) < NEGLIGIBLE_SHARE
        )

    def _better(self, law: SmoothTerm, tried: int) -> bool:
        left, named = self.channel.held_out_costs(self._before, law), float(self._cost_with_effect.sum())
        better = score_gain(self._cost_with_effect, left)
        sure = better.significant and better.p_value * tried < ALPHA
        if not (sure and better.total > min_relevant_reduction(named, self.channel.residual_count(self._after))):
            return False
        beside = float((left - self.channel.held_out_costs(self._after, law)).sum())
        return beside < NEGLIGIBLE_SHARE * (self.channel.cost_after_adjustment(self._before) - named)

    @property
    def _before(self) -> Fit:
        return self.term.candidate.reduced.fit

    @property
    def _after(self) -> Fit:
        return self.term.candidate.full.fit

    @cached_property
    def _cost_with_effect(self) -> Array:
        return self.channel.block_costs(self._after)


def _most_affected_channel(bench: DiagnosisData, place: Term) -> SplineRegression | None:
    """Return the channel of which an effect takes most; None where it takes nothing of any."""
    before, after, effect = place.candidate.reduced.fit, place.candidate.full.fit, place.candidate.effect
    where = dict.fromkeys((type(v), name) for v in bench.train if v.is_sensitive_to(effect) for name in v.channels)
    channels = [bench.spline_regression(after, *each) for each in where]
    taken = [float((c.block_costs(before) - c.block_costs(after)).sum()) for c in channels]
    return channels[int(np.argmax(taken))] if taken and max(taken) > 0.0 else None
