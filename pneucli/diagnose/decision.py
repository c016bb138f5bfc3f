"""Whether an effect is named: its equivalents, its calibrated probability, and the reason of a refusal.

On clean data a likelihood ratio decides. On a real rig unmodelled effects act as well, some effect of the catalogue
resembles each of them, and the likelihood ratio is overconfident about it. The probability is therefore a logistic
model of the evidence, estimated on exams with known truth. Their rigs share no code with this program
(``python -m benchmarks.diagnosis calibration``). ``calibration.json`` has the weights, the exams and their seeds.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Any, NamedTuple

import numpy as np

from pneucli.diagnose.adequacy import significant_lack_of_fit
from pneucli.diagnose.candidate import Candidate, Decision, Reason
from pneucli.diagnose.constraints import violated_constraint
from pneucli.diagnose.data import DiagnosisData, lack_of_fit
from pneucli.diagnose.evidence import RESAMPLES, SEED, null_contrast, relative_effect_size, score_gain, significance
from pneucli.diagnose.free_run_error import removed_error_share
from pneucli.diagnose.score import FittedModel, RecordingCost
from pneucli.physics.declaration import Effect
from pneucli.quantities import Z95
from pneucli.simulate.rig_quantities import rig_quantities

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


CALIBRATION: Mapping[str, Any] = json.loads(files("pneucli.diagnose").joinpath("calibration.json").read_bytes())
WEIGHTS_WHITE_RESIDUAL = tuple(CALIBRATION["weights"]["white_residual"].values())  # where only noise remains
WEIGHTS_DISCREPANCY = tuple(CALIBRATION["weights"]["discrepancy"].values())  # with an unmodelled effect present
# the frequency on exams with which an effect was present that was refused for a reason and has no evidence
PRESENCE_RATE_BY_REASON: Mapping[str, float] = CALIBRATION["presence_rate_by_reason"]
PRESENCE_RATE_OTHER: float = CALIBRATION["presence_rate_other"]  # of all other reasons together

MIN_NAMED_PROBABILITY = 0.5  # an effect with a lower probability is more probably absent and is not named
MIN_RELATIVE_SIZE = 0.1  # times the typical size: a smaller effect is no less probable with an unmodelled effect
MAX_RELATIVE_SIZE = 1.0  # the same: a larger effect is no more probable


class Evidence(NamedTuple):
    """The evidence for an effect against an unmodelled one that it resembles.

    ``share``: the part of the squared free-run error in excess of noise that the effect removes beside all others, on
    held-out recordings where there are any; None where there is no such error. ``significance``: its size over the
    standard error of its interval. ``size``: its size over the typical size. ``complete``: the model with all selected
    effects leaves only noise.
    ``left``: the variance of the residuals of the channel that the effect explains best, over that without it
    (:meth:`pneucli.diagnose.decision.Term.remaining_variance`).
    """

    share: float | None
    significance: float
    size: float
    complete: bool = False
    left: float = 1.0

    @property
    def features(self) -> tuple[float, ...]:
        """The terms of the logistic model, each clipped to the range of the exams."""
        if self.complete:
            share = 0.5 if self.share is None else min(max(self.share, 0.02), 0.98)
            size = _clipped_log10(self.size, 0.03, MAX_RELATIVE_SIZE)
            return 1.0, _clipped_log10(self.significance, 1.0, 300.0), size, math.log(share / (1.0 - share))
        return (
            1.0,
            _clipped_log10(self.size, MIN_RELATIVE_SIZE, MAX_RELATIVE_SIZE),
            _clipped_log10(self.left, 0.01, 1.0),
        )


def _clipped_log10(value: float, low: float, high: float) -> float:
    return math.log10(min(max(value, low), high))


def probability(evidence: Evidence) -> float:
    """Return the probability that an effect with this evidence, or one of its equivalents, is present.

    With an unmodelled effect present, the significance decides only whether the interval contains the null: beyond
    that it did not improve the probability in worlds left out, nor did the free-run error.
    """
    if not evidence.complete and evidence.significance < Z95:
        return presence_rate("interval-contains-null")
    weights = WEIGHTS_WHITE_RESIDUAL if evidence.complete else WEIGHTS_DISCREPANCY
    logit = sum(w * x for w, x in zip(weights, evidence.features, strict=True))
    return 1.0 / (1.0 + math.exp(-logit))


def presence_rate(reason: Reason) -> float:
    """Return the probability that an effect is present that was refused for a reason and has no evidence."""
    return PRESENCE_RATE_BY_REASON.get(reason, PRESENCE_RATE_OTHER)


def likelihood_shares(fitted: Sequence[FittedModel]) -> list[float]:
    """Return the likelihood of each model over that of all, as a mean over block-bootstrap resamples."""
    costs = np.array([one.costs for one in fitted])
    rng = np.random.default_rng(SEED)
    counts = rng.multinomial(costs.shape[1], np.full(costs.shape[1], 1.0 / costs.shape[1]), RESAMPLES)
    sums = costs @ counts.T
    likelihood = np.exp(-0.5 * (sums - sums.min(axis=0)))
    return [float(share) for share in np.mean(likelihood / likelihood.sum(axis=0), axis=1)]


@dataclass(frozen=True)
class Judgement:
    """The decision about an effect, its evidence, and the probability by this evidence."""

    decision: Decision
    evidence: Evidence
    probability: float


def judge(data: DiagnosisData, term: Term, *, constrained: bool = False, error_may_rise: bool = False) -> Judgement:
    """Judge an effect in the model that a term leads to.

    An effect that is more probably absent is refused; ``constrained``: so is one that violates a hard constraint
    (:mod:`pneucli.diagnose.constraints`), the last of which does not count where ``error_may_rise``.
    """
    candidate = term.candidate
    complete = is_complete(data, candidate.full)
    evidence = _evidence(data, term, complete=complete)
    p = probability(evidence)
    violated = None
    if constrained:
        may_rise = error_may_rise or term.is_measured_exclusively(data)
        violated = violated_constraint(data, candidate, distance=evidence.significance, error_may_rise=may_rise)
    improbable: Reason = "immaterial" if complete else "explained-by-unknown"
    reason = violated or ("supported" if p >= MIN_NAMED_PROBABILITY else improbable)
    return Judgement(Decision(candidate.effect, reason, candidate), evidence, p)


def is_complete(data: DiagnosisData, fitted: FittedModel) -> bool:
    """Whether a model leaves nothing beyond noise and the uncertainty of its parameters."""
    return not significant_lack_of_fit(*lack_of_fit(data, fitted))


def _evidence(data: DiagnosisData, term: Term, *, complete: bool) -> Evidence:
    """Return the evidence for a term's effect or its equivalents; the free run counts where only noise is left."""
    candidate, errors, share = term.candidate, data.free_run_errors, None
    if complete and errors is not None:
        share = removed_error_share(errors(candidate.reduced.model), errors(candidate.full.model))
    deviation, size = _significance_and_size(data, candidate.full, candidate.effect)
    return Evidence(share, deviation, size, complete, term.remaining_variance(data))


def log_odds_among_equivalents(data: DiagnosisData, candidate: Candidate) -> float:
    """Return the log odds of a candidate against its equivalents.

    All equivalents resemble the same unmodelled effect, and an effect of more than its typical size is no more
    probable. The remaining free-run error counts as DISCREPANCY_READINGS independent readings: a force balance contains
    few break-aways, and a trajectory depends on each of them.
    """
    p = judge(data, Term(candidate, ())).probability
    errors = list[float]()
    if data.free_run_errors is not None:
        found = data.free_run_errors(candidate.full.model, candidate.reduced.model)  # all in units of the same model
        errors = [e for e in found.values() if e]
    return math.log(p / (1.0 - p)) - DISCREPANCY_READINGS * (float(np.mean(np.log(errors))) if errors else 0.0)


def _significance_and_size(data: DiagnosisData, fitted: FittedModel, effect: Effect) -> tuple[float, float]:
    """Return the distance of an effect from its absence over the standard error of its interval, and its size."""
    facts = rig_quantities(fitted.model, [residual_model.experiment for residual_model in data.train])
    size = relative_effect_size(fitted.fit, effect, facts, data.train)
    own = null_contrast(fitted.fit, effect)
    rows = np.eye(len(fitted.fit.free))[[f.name.startswith(f"{effect.name}.") for f in fitted.fit.free]]
    rows = rows if own is None else own.contrast
    by_blocks, of_intervals = data.contrast_variances(fitted, rows)
    inflation = float(np.mean(of_intervals / by_blocks)) if np.all(by_blocks > 0.0) and len(rows) else 1.0
    return significance(fitted.fit, effect, data.train) / math.sqrt(inflation), size
