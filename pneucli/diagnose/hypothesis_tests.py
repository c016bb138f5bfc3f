"""The tests that a candidate must pass to be supported, and the reason where it fails one."""

from __future__ import annotations

from collections.abc import Sequence

from pneucli.diagnose.adequacy import significant_lack_of_fit
from pneucli.diagnose.candidate import Candidate, Decision, Reason, supported_candidates
from pneucli.diagnose.constraints import violations_of_estimate
from pneucli.diagnose.data import DiagnosisData, lack_of_fit
from pneucli.diagnose.evidence import holm_adjusted
from pneucli.diagnose.score import FittedModel
from pneucli.diagnose.validity import at_any_bound

ALPHA = 0.02  # rate at which a healthy rig yields any name, before the held-out test
ALPHA_RARELY_SHOWN = 1e-4  # the same for effects that act too rarely for a certain held-out test
MIN_EFFECTIVE_BLOCKS = 5.0  # held-out blocks in which an effect acts; with fewer it acts rarely
MIN_COST_SHARE = 0.004  # of the cost: a smaller reduction does not change the error of `compare`
MIN_COST_SHARE_AT_NOISE = 0.02  # the same at the noise floor: base model, smoothing and clock have errors of this size
NOISE_COST_RATIO = 1.05  # times the cost of sensor noise alone: below this the cost is at the noise floor


def apply_tests(data: DiagnosisData, reduced: FittedModel, candidates: Sequence[Candidate]) -> list[Decision]:
    """Decide on each candidate: is it significant in the family of all, material, and confirmed by held-out data?"""
    adjusted = holm_adjusted([c.p_value for c in candidates], max(data.hypothesis_count, len(candidates)))
    return [Decision(c.effect, _reason(data, reduced, c, p), c) for c, p in zip(candidates, adjusted, strict=True)]


def passing_candidates(data: DiagnosisData, reduced: FittedModel, candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return the candidates that pass all tests."""
    return supported_candidates(apply_tests(data, reduced, candidates))


def _reason(data: DiagnosisData, reduced: FittedModel, candidate: Candidate, p_value: float) -> Reason:
    """Return why a candidate passes or fails. Its end location comes before its p value, which a bound distorts."""
    failed: list[tuple[bool, Reason]] = [
        *violations_of_estimate(data, candidate),
        (not p_value < ALPHA, "at-bound" if at_any_bound(candidate) else "not-significant"),
    ]
    reason = next((reason for fails, reason in failed if fails), None)
    if reason is not None:
        return reason
    return _reason_of_cost(data, reduced, candidate, p_value)


def _reason_of_cost(data: DiagnosisData, reduced: FittedModel, candidate: Candidate, p_value: float) -> Reason:
    """Return whether the cost falls enough, on fitted and on held-out data.

    With an unmodelled effect present, most of the cost is that of the unmodelled effect, on held-out data as well, and
    a present effect may hardly lower it. Then a clear fall of the free-run error is as good, no held-out confirmation
    is required, and the probability decides (:mod:`pneucli.diagnose.calibration`).
    """
    material = candidate.train_gain.total > min_relevant_reduction(*data.sensitive_cost(reduced, candidate.effect))
    confirmed = candidate.test_gain.significant or not data.has_held_out_data or _rarely_shown(candidate, p_value)
    if material and confirmed:
        return "supported"
    if (material or _free_run_error_falls_clearly(data, candidate)) and _leaves_unmodelled_effect(data, candidate):
        return "supported"
    return "not-on-held-out" if material else "immaterial"


def _free_run_error_falls_clearly(data: DiagnosisData, candidate: Candidate) -> bool:
    """Whether there is a free-run error and it falls clearly."""
    return data.free_run_errors is not None and data.free_run_error_falls_clearly(candidate.reduced, candidate.full)


def _leaves_unmodelled_effect(data: DiagnosisData, candidate: Candidate) -> bool:
    return bool(significant_lack_of_fit(*lack_of_fit(data, candidate.full)))


def _rarely_shown(candidate: Candidate, p_value: float) -> bool:
    """Whether the effect acts too rarely in the held-out data for certainty, and the fitted data are certain of it.

    An example is a break-away after a long rest: one or two blocks decide, and a bootstrap may draw neither.
    """
    return (
        candidate.test_gain.effective_blocks < MIN_EFFECTIVE_BLOCKS
        and candidate.test_gain.total > 0.0
        and candidate.train_gain.significant
        and p_value < ALPHA_RARELY_SHOWN
    )


def min_relevant_reduction(cost: float, residual_count: int) -> float:
    """Return by how much a cost of so many residuals must fall to be material."""
    return (MIN_COST_SHARE_AT_NOISE if _cost_at_noise_floor(cost, residual_count) else MIN_COST_SHARE) * cost


def is_at_noise_floor(fitted: FittedModel) -> bool:
    """Whether sensor noise alone would cost about as much."""
    return _cost_at_noise_floor(fitted.cost, fitted.residual_count)


def _cost_at_noise_floor(cost: float, residual_count: int) -> bool:
    return cost < NOISE_COST_RATIO * residual_count
