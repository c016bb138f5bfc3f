"""Grading by condition: what counts as right, and why the rest failed."""

import math
from types import SimpleNamespace
from typing import Any

import pytest

from pneucli.exam.graded_case import GradedCase
from pneucli.exam.grades import SHORT_TITLES, Counts, Grades, Spread
from pneucli.exam.grading import reliability, report
from pneucli.exam.workflow import case_rows
from pneucli.figure import read

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


# --- stated probabilities against the truth: sets of twins count once, and every effect that was fitted counts


def stating(*stated: tuple[float, bool]) -> Any:
    return SimpleNamespace(stated_probabilities=list(stated))


def candidate(effect: str, confidence: float | None, *twins: str, fitted: bool = True) -> dict[str, Any]:
    parameters = {"size": {"value": 1.0}} if fitted else {}
    return {"effect": effect, "confidence": confidence, "indistinguishable_from": list(twins), "parameters": parameters}


def graded(hidden: list[str], missing: list[str], *candidates: dict[str, Any]) -> GradedCase:
    truth = {"hidden": {name: {} for name in hidden}, "outside_the_catalogue": None, "verdict": "missing-effect"}
    return GradedCase("case", truth, {"verdict": "missing-effect", "missing": missing, "candidates": list(candidates)})


def test_scores_are_the_mean_square_and_the_mean_logarithm() -> None:
    found = reliability([stating((0.8, True), (0.6, False)), stating((0.0, True))])
    assert found is not None
    assert found.of == 3
    assert found.brier == pytest.approx((0.04 + 0.36 + 1.0) / 3)
    assert found.log == pytest.approx(-(math.log(0.8) + math.log(0.4) + math.log(1e-3)) / 3)  # no surer than 1e-3


def test_probabilities_are_gathered_by_what_was_stated() -> None:
    """A bin has its lower edge; 1 is in the last one. Empty bins are left out."""
    found = reliability([stating((0.5, True), (0.68, False), (0.7, True), (1.0, True), (1.3, True))])
    assert found is not None
    assert [(b.from_, b.to, b.there, b.of) for b in found.bins] == [
        (0.5, 0.7, 1, 2), (0.7, 0.9, 1, 1), (0.9, 1.0, 2, 2),
    ]  # fmt: skip
    assert [b.stated for b in found.bins] == pytest.approx([0.59, 0.7, 1.0])
    assert "| 0.5 to 0.7 | 0.59 | 1 | 2 |" in found.table


def test_without_probabilities_there_is_no_reliability() -> None:
    assert reliability([stating()]) is None


def test_the_probability_of_a_set_counts_as_true_if_one_member_is() -> None:
    """The twin of a named effect has the set's probability; it is not counted again."""
    one = graded(
        ["twin"], ["named"],
        candidate("named", 0.9, "twin"), candidate("twin", 0.9, "named"), candidate("refused", 0.2),
        candidate("screened", 0.01, fitted=False), candidate("silent", None),
    )  # fmt: skip
    assert one.stated_probabilities == [(0.9, True), (0.2, False)]


def test_the_probability_of_a_refused_effect_counts_only_for_itself() -> None:
    one = graded(["other"], [], candidate("refused", 0.4, "other"), candidate("other", 0.1))
    assert (0.4, True) not in one.stated_probabilities


@pytest.mark.parametrize(("confidence", "found"), [(0.9, [True, False]), (0.89, [False, False]), (None, [False] * 2)])
def test_a_true_effect_is_confidently_found_if_it_or_an_equivalent_is_named(
    confidence: float | None, found: list[bool]
) -> None:
    one = graded(["a", "b"], ["c"], candidate("c", confidence, "a"))
    assert one.confident_detections == found


@pytest.mark.parametrize(
    ("part", "subsystem", "variable", "over", "right"),
    [
        ("force", "mechanics: friction", "x", [], True),
        ("force", "gas, valve and their sensors", "x", [], False),
        ("flow", "gas, valve and their sensors", None, ["p1", "x"], True),  # told among what remains
        ("force", "mechanics: friction", "v", ["p1"], False),
        ("sensor", "the complete simulation", "x", [], True),
        (None, None, None, [], True),  # a truth that does not say where it is
    ],
)
def test_a_disturbance_is_located_by_subsystem_and_signal(
    part: str | None, subsystem: str | None, variable: str | None, over: list[str], *, right: bool
) -> None:
    truth = {"hidden": {}, "outside_the_catalogue": "a stranger", "verdict": "unexplained", "part": part, "over": "x"}
    about = {"subsystem": subsystem, "variable": variable}
    said = {
        "verdict": "unexplained", "missing": [], "unexplained": about, "discrepancy": [{"over": o} for o in over],
    }  # fmt: skip
    assert GradedCase("case", truth, said).verdict_is_correct == right
    assert not GradedCase("case", truth, said | {"verdict": "adequate"}).verdict_is_correct


# --- the grades as they are told: a report of three cases, word for word, and the rows of its tables


NOTHING = {"right": 0, "of": 0, "share": None, "ci95": None}


def share(right: int, of: int) -> dict[str, Any]:
    return {"right": right, "of": of, "share": right / of, "ci95": [0.1, 0.9]} if of else NOTHING


def group(condition: str, cases: int, verdict: dict[str, Any], **more: Any) -> dict[str, Any]:
    shares = dict.fromkeys(SHORT_TITLES, NOTHING) | {"verdict right": verdict, "unknown flagged": share(1, 1)}
    return {
        "condition": condition, "cases": cases, "shares": shares, "failures": {},
        "set_size": None, "error_after": None, "seconds": None,
    } | more  # fmt: skip


MESSY = group("messy", 1, share(0, 1), failures={"timeout": 1})
USUAL = group(
    "usual", 2, share(1, 2), failures={"timeout": 1, "false alarm": 2}, set_size={"median": 1.0, "largest": 2.0},
    error_after={"median": 1.02, "largest": 1.5}, seconds={"median": 31.0, "slowest": 40.0, "case": "b"},
)  # fmt: skip
RESULT: dict[str, Any] = {
    "cases": 3, "unanswered": ["c"], "exam": None, "answered_by": [], "conditions": [USUAL, MESSY],
    "shares": {"verdict right": share(1, 3), "messy nulls named nothing": NOTHING, "unknown flagged": share(1, 1)},
    "set_size": {"median": 1.0, "largest": 2.0}, "error_after": {"median": 1.02, "largest": 1.5},
    "seconds": {"median": 31.0, "slowest": 40.0, "case": "b"}, "failures": {"timeout": 2, "false alarm": 3},
    "calibration": {
        "bins": [{"from": 0.5, "to": 0.7, "stated": 0.61, "there": 3, "of": 4}], "brier": 0.1236, "log": 0.5, "of": 4,
    },
    "confusion": [{"hidden": "none", "answered": "stribeck", "cases": 1}],
}  # fmt: skip
TOLD = """\
3 cases, 1 without an answer

| what | right | of | share | 95 % interval |
| --- | ---: | ---: | ---: | --- |
| verdict right | 1 | 3 | 33% | 10% to 90% |
| unknown flagged | 1 | 1 | 100% | 10% to 90% |

Effects in one answer that it does not tell apart: 1 (median), 2 (largest)

Error after, over the noise floor: 1.02 (median), 1.50 (largest)

Processor seconds a case: 31 (median), 40 (b, slowest)

Probabilities: Brier score 0.124, log score 0.500, of 4

| stated | mean | there | of |
| --- | ---: | ---: | ---: |
| 0.5 to 0.7 | 0.61 | 3 | 4 |

| condition | cases | verdict | in the answer | exactly | clean nulls | messy nulls | unknown | parameters | intervals \
| set | error | seconds |
| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |
| usual | 2 | 1/2 |  |  |  |  | 1/1 |  |  | 1 | 1.02 | 31 |
| messy | 1 | 0/1 |  |  |  |  | 1/1 |  |  |  |  |  |

| failure | cases | under |
| --- | ---: | --- |
| false alarm | 3 | usual 2 |
| timeout | 2 | usual 1, messy 1 |

| hidden | answered | cases |
| --- | --- | ---: |
| none | stribeck | 1 |
"""


def test_the_report_of_three_cases() -> None:
    assert read(Grades, RESULT).page == TOLD


def test_without_failures_there_is_no_sentence_about_them() -> None:
    clean = RESULT | {"failures": {}, "set_size": None, "error_after": None, "seconds": None, "calibration": None}
    told = read(Grades, clean).page
    assert "failure" not in told
    assert "Effects in one" not in told
    assert "Error after" not in told
    assert "Processor" not in told
    assert "Probabilities" not in told


@pytest.mark.parametrize(
    ("source", "by", "words"),
    [
        ("given", ["p1"], "chosen by who wrote the exam."),
        ("program", ["p1"], "from the hash of the program that answers: nobody can have looked."),
        ("program", [], "from the hash of the program that answers: nobody can have looked."),
        (
            "program",
            ["p2"],
            "from the hash of another program than the one that answered: the cases may have been seen.",
        ),
    ],
)
def test_the_grades_state_the_origin_of_the_seed(source: str, by: list[str], words: str) -> None:
    about = {"seed": 7, "seed_from": source, "program": "p1"}
    first, _, line, blank, *_ = read(Grades, RESULT | {"exam": about, "answered_by": by}).page.splitlines()
    assert (first, line, blank) == ("3 cases, 1 without an answer", f"Seed 7, {words} Program: p1", "")
    del about["program"]
    given = read(Grades, RESULT | {"exam": about | {"seed_from": "given"}})
    assert given.page.splitlines()[2].endswith("not stated")


def test_rows_have_every_measure_of_every_condition() -> None:
    found = read(Grades, RESULT).rows
    table = {(row["condition"], row["what"]): row for row in found}
    assert len(table) == len(found)
    assert {row["condition"] for row in found} == {"all", "usual", "messy"}
    plain = {"unit": "1", "right": None, "ci_low": None, "ci_high": None}

    def row(condition: str, what: str) -> dict[str, Any]:
        return {k: v for k, v in table[condition, what].items() if k not in ("condition", "what")}

    assert row("all", "verdict right") == {
        "value": pytest.approx(1 / 3), "unit": "1", "right": 1, "of": 3, "ci_low": 0.1, "ci_high": 0.9,
    }  # fmt: skip
    assert row("all", "messy nulls named nothing") == plain | {"value": None, "right": 0, "of": 0}
    assert row("usual", "set size, median") == plain | {"value": 1.0, "of": 2}
    assert row("usual", "set size, largest") == plain | {"value": 2.0, "of": 2}
    assert row("usual", "error after, largest") == plain | {"value": 1.5, "of": 2}
    assert row("usual", "processor time, median") == plain | {"value": 31.0, "of": 2, "unit": "s"}
    assert row("usual", "processor time, slowest") == plain | {"value": 40.0, "of": 2, "unit": "s"}
    assert row("messy", "error after, median") == plain | {"value": None, "of": 1}
    assert row("usual", "failure: false alarm") == plain | {"value": 2.0, "right": 2, "of": 2}
    assert row("all", "failure: timeout") == plain | {"value": 2.0, "right": 2, "of": 3}


def test_a_case_is_a_row() -> None:
    about = {"case": "a", "truth_label": "stribeck", "verdict": "missing-effect", "final_error": 1.1, "seconds": 9.0}
    named = {"missing": {"b", "a"}, "failure_cause": None, "set_sizes": [1, 3], "conditions": ["usual"]}
    known = {"hidden": "stribeck", "verdict": "missing-effect", "error_after": 1.1, "seconds": 9.0}
    one: Any = SimpleNamespace(**about, **named, truth={"conditions": ["ends", "drift"]})
    other: Any = SimpleNamespace(
        **about, **(named | {"failure_cause": "timeout", "set_sizes": [], "missing": set()}), truth={}
    )
    assert case_rows([one, other]) == [
        {"case": "a", "conditions": "ends+drift", "named": "a + b", "failure": "", "largest_set": 3.0} | known,
        {"case": "a", "conditions": "usual", "named": "", "failure": "timeout", "largest_set": 0.0} | known,
    ]
