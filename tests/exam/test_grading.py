"""Grading by condition: what counts as right, and why the rest failed."""

from __future__ import annotations

from typing import Any

import pytest

from pneucli.exam.graded_case import GradedCase
from pneucli.exam.grades import Counts, Spread
from pneucli.exam.grading import report

LEAK = {"chamber-leak": {"area": 1.0}}


def case(
    hidden: dict[str, Any] | None = None,
    verdict: str = "adequate",
    missing: tuple[str, ...] = (),
    *,
    outside: str | None = None,
    mess: bool = False,
    conditions: tuple[str, ...] = ("usual",),
    twins: tuple[str, ...] = (),
    reason: str | None = None,
    **more: Any,
) -> GradedCase:
    truth = {
        "hidden": hidden or {},
        "outside_the_catalogue": outside,
        "verdict": "unexplained" if outside else "missing-effect" if hidden else "adequate",
        "mess": {"warming": 0.1} if mess else {},
        "unexplained_is_right": mess or bool(outside),
        "conditions": list(conditions),
    }
    candidates = [{"effect": e, "parameters": {}, "indistinguishable_from": list(twins), **more} for e in missing]
    candidates += [{"effect": e, "parameters": {}, "reason": reason} for e in hidden or {} if reason]
    answer = {"verdict": verdict, "missing": list(missing), "candidates": candidates}
    return GradedCase("case-001", truth, answer, 10.0)


@pytest.mark.parametrize(
    ("graded", "failure"),
    [
        (case(), None),
        (case(verdict="unexplained"), "healthy: unexplained"),
        (case(verdict="unexplained", mess=True), None),
        (case(verdict="inconclusive"), "healthy: inconclusive"),
        (case(verdict="missing-effect", missing=("stribeck",)), "healthy: an effect named"),
        (case(LEAK, "missing-effect", ("chamber-leak",)), None),
        (case(LEAK, "unexplained", ("chamber-leak",)), "named, but unexplained"),
        (case(LEAK, "unexplained", ("chamber-leak",), mess=True), None),
        (case(LEAK, "missing-effect", ("valve-leak",), twins=("chamber-leak",)), "its twin named"),
        (case(LEAK, "missing-effect", ("valve-leak",)), "missed: another named"),
        (case(LEAK, "missing-effect", ("chamber-leak", "stribeck")), "another named as well"),
        (case(LEAK | {"stribeck": {}}, "missing-effect", ("chamber-leak",)), "missed: one of two"),
        (case(LEAK, reason="at-bound"), "missed: adequate (at-bound)"),
        (case(outside="quadratic drag", verdict="unexplained"), None),
        (case(outside="quadratic drag"), "unknown: adequate"),
        (case(outside="quadratic drag", verdict="missing-effect", missing=("stribeck",)), "unknown: named as another"),
        (case(verdict="no answer"), "no answer"),
    ],
)
def test_every_failure_has_its_cause(graded, failure):
    assert graded.failure_cause == failure


def test_a_failed_run_has_the_class_of_its_error_as_cause():
    graded = case(verdict="failed")
    graded.answer["error"] = "LinAlgError: singular"
    assert graded.failure_cause == "failed: LinAlgError"


def test_small_disturbances_in_truths_of_other_rigs_are_recognised():
    """The shared example cases: small unknown effects beside the one that is to be named."""
    truth = {"hidden": {}, "outside_the_catalogue": "several small ones", "verdict": "unexplained"}
    null = GradedCase("messy-07", truth, {"verdict": "adequate", "missing": []})
    assert null.is_null
    assert null.is_correct_null
    assert null.conditions == ["messy"]
    flagged = GradedCase("messy-07", truth, {"verdict": "unexplained", "missing": []})
    assert flagged.is_correct_null
    known = GradedCase("messy-01", truth | {"hidden": LEAK}, {"verdict": "unexplained", "missing": ["chamber-leak"]})
    assert known.verdict_is_correct
    assert known.failure_cause is None


def test_a_case_counts_for_its_combined_and_for_each_single_condition():
    assert case(conditions=("messy", "rate-200Hz")).conditions == ["messy+rate-200Hz", "messy", "rate-200Hz"]
    assert case(conditions=("wide", "5/3", "ends")).conditions == ["wide", "5/3", "ends"]


def test_the_report_of_each_condition_counts_its_own_cases():
    graded = [
        case(LEAK, "missing-effect", ("chamber-leak",), twins=("valve-leak", "piston-leak"), confidence=0.95),
        case(LEAK, "missing-effect", ("stribeck",), conditions=("messy",), mess=True, confidence=0.97),
        case(conditions=("messy",), mess=True, verdict="unexplained"),
        case(),
        case(verdict="inconclusive"),
    ]
    result = report(graded)
    of = {one.condition: one for one in result.conditions}
    assert [of["usual"].cases, of["messy"].cases, result.cases] == [3, 2, 5]

    def count(group: Counts, what: str) -> tuple[int, int]:
        return group.shares[what].right, group.shares[what].of

    assert count(of["usual"], "exactly the true effects") == (1, 1)
    assert count(of["messy"], "exactly the true effects") == (0, 1)
    assert count(result, "clean nulls named nothing") == (1, 2)
    assert count(result, "messy nulls named nothing") == (1, 1)
    assert count(result, "inconclusive") == (1, 5)
    assert count(result, "named with 0.9 or more, and true") == (1, 2)
    assert of["usual"].set_size == Spread(3.0, 3.0)
    assert of["messy"].failures == {"missed: another named": 1}
    page = result.page
    row = next(line for line in page.splitlines() if line.startswith("| usual |"))
    assert [cell.strip() for cell in row.split("|")][1:6] == ["usual", "3", "2/3", "1/1", "1/1"]
    assert "| missed: another named | 1 | messy 1 |" in page
    sizes = [r for r in result.rows if r["what"] == "set size, median" and r["condition"] == "usual"]
    assert [(r["value"], r["unit"]) for r in sizes] == [(3.0, "1")]


def test_intervals_are_counted_where_they_were_given():
    inside = {"value": 1.3, "ci95": [0.9, 1.7]}
    graded = case(LEAK, "missing-effect", ("chamber-leak",))
    graded.answer["candidates"][0]["parameters"] = {"area": inside}
    assert graded.intervals_cover_truth == [True]
    assert graded.parameters_within_tolerance == [False]
    graded.answer["candidates"][0]["parameters"] = {"area": inside | {"ci95": [1.1, 1.5]}}
    assert graded.intervals_cover_truth == [False]
    graded.answer["candidates"][0]["parameters"] = {"area": {"value": 1.1}}
    assert (graded.intervals_cover_truth, graded.parameters_within_tolerance) == ([], [True])
