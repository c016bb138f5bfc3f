"""The tests that a candidate must pass to be added, and the reason where it fails one."""

from __future__ import annotations

from collections.abc import Sequence

from pneucli.diagnose.candidate import Candidate, Decision, Reason
from pneucli.diagnose.constraints import violations_of_estimate
from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.evidence import holm_adjusted
from pneucli.diagnose.validity import at_any_bound

ALPHA = 0.02  # rate at which a healthy rig yields any candidate


def apply_tests(data: DiagnosisData, candidates: Sequence[Candidate]) -> list[Decision]:
    """Decide on each candidate: is its estimate valid, and does it lower the cost significantly in the family of all
    hypotheses?
    """
    adjusted = holm_adjusted([c.p_value for c in candidates], max(data.hypothesis_count, len(candidates)))
    return [Decision(c.effect, _reason(data, c, p), c) for c, p in zip(candidates, adjusted, strict=True)]


def _reason(data: DiagnosisData, candidate: Candidate, p_value: float) -> Reason:
    """Return why a candidate passes or fails. Its end location comes before its p value, which a bound distorts."""
    failed: list[tuple[bool, Reason]] = [
        *violations_of_estimate(data, candidate),
        (candidate.full.cost >= candidate.reduced.cost, "not-significant"),  # a law with bounds may fit and cost more
        (not p_value < ALPHA, "at-bound" if at_any_bound(candidate) else "not-significant"),
    ]
    return next((reason for fails, reason in failed if fails), "supported")
