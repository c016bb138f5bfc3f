"""The grades as they are told: a report of three cases, word for word, and the rows of its tables."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from pneucli.exam.grades import SHORT_TITLES, Grades
from pneucli.exam.workflow import case_rows
from pneucli.figure import read

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
