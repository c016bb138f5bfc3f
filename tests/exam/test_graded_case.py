"""Grading: what counts as right, as covered, as within 15 %, and how it is told."""

import json
from pathlib import Path
from typing import Any

import pytest

from pneucli.errors import InputError
from pneucli.exam.graded_case import GradedCase
from pneucli.exam.grades import Grades, Share
from pneucli.exam.grading import grade
from pneucli.figure import to_json


def truth(hidden: dict[str, dict[str, float]], outside: str | None = None) -> dict[str, Any]:
    verdict = "unexplained" if outside else "missing-effect" if hidden else "adequate"
    return {"hidden": hidden, "outside_the_catalogue": outside, "verdict": verdict}


def candidate(effect: str, twins: tuple[str, ...] = (), **values: float) -> dict[str, Any]:
    found: dict[str, Any] = {"effect": effect, "parameters": {n: {"value": v} for n, v in values.items()}}
    return found | ({"indistinguishable_from": list(twins)} if twins else {})


def answer(
    verdict: str, *named: dict[str, Any], others: tuple[dict[str, Any], ...] = (), **more: Any
) -> dict[str, Any]:
    return {"verdict": verdict, "missing": [c["effect"] for c in named], "candidates": [*named, *others], **more}


def graded(hidden: dict[str, dict[str, float]], said: dict[str, Any], outside: str | None = None) -> GradedCase:
    return GradedCase("case", truth(hidden, outside), said)


LEAK = {"chamber-leak": {"area": 2.0}}


def test_the_answer_set_includes_indistinguishable_effects() -> None:
    g = graded(LEAK, answer("missing-effect", candidate("valve-leak", ("chamber-leak", "piston-leak"))))
    assert g.missing == {"valve-leak"}
    assert g.answer_set == {"valve-leak", "chamber-leak", "piston-leak"}
    assert g.hidden <= g.answer_set


def test_an_unnamed_candidate_adds_nothing_to_the_answer_set() -> None:
    g = graded(LEAK, answer("adequate", others=(candidate("chamber-leak", ("x",), area=2.0),)))
    assert g.answer_set == set()
    assert g.parameters_within_tolerance == []


def test_without_candidates_the_answer_set_is_the_named_effects() -> None:
    assert graded(LEAK, {"verdict": "missing-effect", "missing": ["chamber-leak"]}).answer_set == {"chamber-leak"}


@pytest.mark.parametrize(
    ("true", "value", "right"),
    [
        (2.0, 2.29, True),
        (2.0, 2.31, False),
        (2.0, 1.71, True),
        (2.0, 1.69, False),
        (-2.0, -2.29, True),
        (-2.0, 2.0, False),
    ],
)
def test_a_parameter_is_right_within_15_percent_of_the_truth(true: float, value: float, right: bool) -> None:
    g = graded({"constant-force": {"force": true}}, answer("missing-effect", candidate("constant-force", force=value)))
    assert g.parameters_within_tolerance == [right]


def test_unstated_parameters_and_absent_effects_do_not_count() -> None:
    said = answer("missing-effect", candidate("stribeck", static=20.0), candidate("extra-mass", mass=1.0))
    g = graded({"stribeck": {"static": 20.0, "velocity": 0.01}, "dead-volume": {"volume_added": 1.0}}, said)
    assert g.parameters_within_tolerance == [True]


@pytest.mark.parametrize(
    ("hidden", "outside", "row"),
    [
        ({}, None, "none"),
        (LEAK, None, "chamber-leak"),
        ({"valve-lag": {}, "chamber-leak": {}}, None, "chamber-leak + valve-lag"),
        ({}, "backlash", "backlash"),
    ],
)
def test_the_rows_of_the_matrix_are_the_hidden_effects(hidden: dict, outside: str | None, row: str) -> None:
    assert graded(hidden, answer("adequate"), outside).truth_label == row


@pytest.mark.parametrize(
    ("said", "column"),
    [
        (answer("adequate"), "adequate"),
        (answer("unexplained"), "unexplained"),
        (answer("missing-effect", candidate("valve-lag"), candidate("chamber-leak")), "chamber-leak + valve-lag"),
        (answer("unexplained", candidate("valve-lag")), "valve-lag (unexplained)"),
    ],
)
def test_the_columns_are_those_of_the_answer(said: dict[str, Any], column: str) -> None:
    assert graded({}, said).answer_label == column


@pytest.mark.parametrize(
    ("ladder", "error"),
    [
        (None, None),
        ([], None),
        ([{"error_train": 9.0, "error_test": 8.0}, {"error_train": 3.0, "error_test": 2.0}], 2.0),
        ([{"error_train": 3.0, "error_test": None}], 3.0),
        ([{"error_train": None, "error_test": None}], None),
        ([{"error_train": 3.0, "error_test": 0.0}], 0.0),
    ],
)
def test_the_final_error_is_that_of_the_last_step_preferably_held_out(ladder: Any, error: float | None) -> None:
    said = answer("adequate") | ({} if ladder is None else {"ladder": ladder})
    assert graded({}, said).final_error == error


# --- a whole exam


def written(folder: Path, cases: dict[str, tuple[dict[str, Any], dict[str, Any] | None]]) -> Grades:
    """The grades of cases by name, each a truth and an answer (None: there is none)."""
    (folder / ".sealed").mkdir()
    answers = folder / "given"
    answers.mkdir()
    for case, (hidden, said) in cases.items():
        (folder / ".sealed" / f"{case}.json").write_text(json.dumps(hidden))
        if said is not None:
            (answers / f"{case}.json").write_text(json.dumps(said))
    return grade(folder, answers)


def rung(error: float) -> dict[str, Any]:
    return {"ladder": [{"error_train": error, "error_test": error}]}


CASES: dict[str, tuple[dict[str, Any], dict[str, Any] | None]] = {
    "a": (truth(LEAK), answer("missing-effect", candidate("chamber-leak", area=2.1), **rung(1.1))),
    "b": (truth(LEAK), answer("missing-effect", candidate("chamber-leak", area=3.0), **rung(1.5))),
    "c": (truth(LEAK), answer("missing-effect", candidate("valve-leak", ("chamber-leak",)), **rung(7.0))),
    "d": (truth({}), answer("adequate")),
    "e": (truth({}), answer("adequate", candidate("stribeck"))),
    "f": (truth({}, "backlash"), answer("unexplained")),
    "g": (truth({}, "backlash"), answer("missing-effect", candidate("stribeck"))),
    "h": (truth(LEAK), None),
}


def test_every_share_counts_its_own_cases(tmp_path: Path) -> None:
    result = written(tmp_path, CASES)
    counted = {what: (s.right, s.of) for what, s in result.shares.items()}
    assert counted == {
        "verdict right": (6, 8),
        "true effects in the answer": (3, 4),
        "exactly the true effects": (2, 4),
        "nulls named nothing": (1, 2),
        "clean nulls named nothing": (1, 2),
        "messy nulls named nothing": (0, 0),
        "unknown flagged": (1, 2),
        "unknown wrongly named": (1, 2),
        "inconclusive": (0, 8),
        "parameters within 15 %": (1, 2),
        "intervals that hold the truth": (0, 0),
        "stated effects: parameters within 15 %": (0, 0),
        "stated effects: intervals that hold the truth": (0, 0),
        "told that the command sets no area": (0, 0),
        "named with 0.9 or more, and true": (0, 0),
        "true effects named with 0.9 or more": (0, 4),  # no answer says how sure it is
        "unknown flagged in its subsystem, over its signal": (1, 2),  # these truths do not say where it is
    }
    assert result.calibration is None
    assert result.shares["exactly the true effects"].share == 0.5
    assert (result.schema, result.cases, result.unanswered) == ("pneucli/exam/1", 8, ["h"])


def test_the_final_error_counts_only_exact_answers(tmp_path: Path) -> None:
    assert to_json(written(tmp_path, CASES).error_after) == {"median": pytest.approx(1.3), "largest": 1.5}


def test_an_exam_without_known_effects_has_no_share_of_them_and_no_error(tmp_path: Path) -> None:
    result = written(tmp_path, {"d": CASES["d"]})
    assert result.shares["true effects in the answer"] == Share(0, 0, None, None)
    assert result.error_after is None
    assert result.seconds is None
    text = result.page
    assert "true effects" not in text
    assert "Error after" not in text
    assert "Seconds" not in text


def test_the_exact_interval_of_three_in_four(tmp_path: Path) -> None:
    """Clopper and Pearson, from the binomial sums: P(X >= 3 | low) = P(X <= 3 | high) = 2.5 %."""
    low, high = written(tmp_path, CASES).shares["true effects in the answer"].ci95 or ()
    assert 4 * low**3 * (1 - low) + low**4 == pytest.approx(0.025, rel=1e-6)
    assert 1 - high**4 == pytest.approx(0.025, rel=1e-6)


def test_the_confusion_matrix_counts_pairs_in_order(tmp_path: Path) -> None:
    assert to_json(written(tmp_path, CASES).confusion) == [
        {"hidden": "backlash", "answered": "stribeck", "cases": 1},
        {"hidden": "backlash", "answered": "unexplained", "cases": 1},
        {"hidden": "chamber-leak", "answered": "chamber-leak", "cases": 2},
        {"hidden": "chamber-leak", "answered": "no answer", "cases": 1},
        {"hidden": "chamber-leak", "answered": "valve-leak", "cases": 1},
        {"hidden": "none", "answered": "adequate", "cases": 1},
        {"hidden": "none", "answered": "stribeck", "cases": 1},
    ]


@pytest.mark.parametrize("text", ["[]", '{"verdict": "adequate"}', '{"missing": []}'])
def test_an_answer_without_verdict_or_missing_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / ".sealed").mkdir()
    (tmp_path / ".sealed" / "a.json").write_text(json.dumps(truth({})))
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(InputError, match=r"(?s)a\.json.*no verdict or no missing.*diagnose --json"):
        grade(tmp_path, tmp_path)
