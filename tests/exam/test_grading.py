"""Grading: what counts as right, as covered, as confident, why the rest failed, and how the grades are told."""

import json
from pathlib import Path
from typing import Any

import pytest

from pneucli.errors import InputError
from pneucli.exam.grades import Grades
from pneucli.exam.grading import grade, graded_cases
from pneucli.exam.workflow import case_rows
from pneucli.figure import to_json
from tests.stored import hold_against

STORED = Path(__file__).parent / "stored"
LEAK, FORCE = {"chamber-leak": {"area": 2.0}}, {"constant-force": {"force": -2.0}}
SEVERAL = "several small ones"  # of the shared example cases
STRANGER, WHERE = "quadratic drag", {"part": "force", "over": "x"}


def candidate(effect: str, confidence: float | None = None, *twins: str, fitted: bool = True, **values: Any) -> Any:
    """``values`` are numbers, or a number and its interval."""
    known = {n: v if isinstance(v, dict) else {"value": v} for n, v in values.items()}
    parameters = known or ({"size": {"value": 1.0}} if fitted else {})
    return {"effect": effect, "confidence": confidence, "indistinguishable_from": twins, "parameters": parameters}


def interval(value: float, low: float | None, high: float | None) -> dict[str, Any]:
    return {"value": value, "ci95": [low, high]}


def case(hidden: Any, verdict: str | None, *named: Any, others: Any = (), truth: Any = (), **more: Any) -> Any:
    """A truth and an answer, which names candidates and refuses others; without a verdict there is no answer.

    What is hidden is a stranger to the catalogue where it is text.
    """
    outside = hidden if isinstance(hidden, str) else None
    known = {} if outside else hidden
    right = "unexplained" if outside else "missing-effect" if known else "adequate"
    said = {"verdict": verdict, "missing": [c["effect"] for c in named], "candidates": [*named, *others], **more}
    return {"hidden": known, "outside_the_catalogue": outside, "verdict": right} | dict(
        truth
    ), said if verdict else None


MESSY = {"mess": {"warming": 0.1}, "unexplained_is_right": True, "conditions": ["messy", "rate-200Hz"]}
STATED = {"critical-ratio": {"critical_ratio": 0.3}, "heat-transfer": {"conductance": 1.0}}
CASES = {
    "right, within 15 %": case(
        LEAK, "missing-effect", candidate("chamber-leak", 0.95, area=interval(2.29, 1.9, 2.4)),
        ladder=[{"error_train": 1.0, "error_test": 1.1}],
    ),
    "right, beyond 15 %": case(
        LEAK, "missing-effect", candidate("chamber-leak", 0.9, area=interval(2.31, 2.1, 2.5)),
        ladder=[{"error_train": 1.0, "error_test": 1.5}],
    ),
    "right, an open interval": case(
        FORCE, "missing-effect", candidate("constant-force", force=interval(-1.71, None, 0.0))
    ),
    "right, of other sign": case(FORCE, "missing-effect", candidate("constant-force", 0.89, force=2.0)),
    "right, of a truth of 0": case(
        {"a": {"b": 0.0, "unstated": 1.0}}, "missing-effect", candidate("a", 0.5, b=interval(0.1, -1.0, 1.0))
    ),
    "right, messy": case(LEAK, "unexplained", candidate("chamber-leak", 0.7), truth=MESSY),
    "named, but unexplained": case(LEAK, "unexplained", candidate("chamber-leak", 0.68)),
    "a twin": case(
        LEAK, "missing-effect", candidate("valve-leak", 0.97, "chamber-leak", "piston-leak"),
        others=[candidate("chamber-leak", 0.97, "valve-leak"), candidate("stribeck", 0.2, "chamber-leak")],
        ladder=[{"error_train": 9.0, "error_test": 8.0}, {"error_train": 3.0, "error_test": 2.0}],
    ),
    "another": case(LEAK, "missing-effect", candidate("valve-leak", 1.3), others=[candidate("chamber-leak", 0.0)]),
    "another as well": case(LEAK, "missing-effect", candidate("chamber-leak"), candidate("stribeck", 1.0)),
    "one of two": case(
        LEAK | {"stribeck": {"static": 20.0}}, "missing-effect", candidate("chamber-leak", 0.9),
        ladder=[{"error_train": 3.0, "error_test": None}],
    ),
    "both of two": case(
        LEAK | {"stribeck": {"static": 20.0}}, "missing-effect", candidate("stribeck", static=20.0, velocity=1.0),
        candidate("chamber-leak", area=1.69), ladder=[{"error_train": 3.0, "error_test": 0.0}],
    ),
    "refused": case(
        LEAK, "adequate", others=[candidate("chamber-leak", 0.4, fitted=False) | {"reason": "at-bound"}],
        ladder=[{"error_train": None, "error_test": None}],
    ),
    "no answer": case(LEAK, None),
    "failed": case(LEAK, "failed", error="LinAlgError: singular"),
    "healthy": case({}, "adequate", ladder=[], program="p1"),
    "healthy, stated": case(
        {}, "adequate", truth={"baseline_parameters": STATED, "command_sets_area": False}, command_sets_area=False,
        parameters={
            "critical-ratio.critical_ratio": interval(0.34, 0.33, 0.35),
            "heat-transfer.conductance": interval(1.2, 0.9, 1.5),
        },
    ),
    "healthy, its source not told": case({}, "adequate", truth={"command_sets_area": False}, command_sets_area=None),
    "healthy, messy": case({}, "unexplained", truth=MESSY),
    "healthy, unexplained": case({}, "unexplained"),
    "healthy, inconclusive": case({}, "inconclusive", truth={"conditions": ["wide", "5/3", "ends"]}),
    "healthy, named": case({}, "missing-effect", candidate("stribeck", 0.6)),
    "healthy by other hands": case(SEVERAL, "adequate"),
    "leaky by other hands": case(
        LEAK, "unexplained", candidate("chamber-leak"), truth={"outside_the_catalogue": SEVERAL}
    ),
    "stranger, not located": case(STRANGER, "unexplained"),
    "stranger, by signal": case(
        STRANGER, "unexplained", unexplained={"subsystem": "mechanics: friction", "variable": "x"}, truth=WHERE
    ),
    "stranger, in another part": case(
        STRANGER, "unexplained", unexplained={"subsystem": "gas, valve", "variable": "x"}, truth=WHERE
    ),
    "stranger, told among what remains": case(
        STRANGER, "unexplained", unexplained={"subsystem": "gas, valve", "variable": None},
        discrepancy=[{"over": "p1"}, {"over": "x"}], truth={"part": "flow", "over": "x"},
    ),
    "stranger, over another signal": case(
        STRANGER, "unexplained", unexplained={"subsystem": "mechanics", "variable": "v"},
        discrepancy=[{"over": "p1"}], truth=WHERE,
    ),
    "stranger in a sensor": case(
        STRANGER, "unexplained", unexplained={"subsystem": "the complete simulation", "variable": "x"},
        truth={"part": "sensor", "over": "x"},
    ),
    "stranger, adequate": case(STRANGER, "adequate"),
    "stranger, as another": case(STRANGER, "missing-effect", candidate("stribeck")),
    "stranger, another as well": case(STRANGER, "unexplained", candidate("stribeck")),
}  # fmt: skip
OF_A_CASE = (
    "conditions truth_label answer_label answer_set set_sizes verdict_is_correct failure_cause final_error seconds "
    "parameters_within_tolerance intervals_cover_truth stated_within_tolerance stated_intervals_cover_truth "
    "is_source_recognised stated_probabilities confident_namings confident_detections"
)


@pytest.fixture
def exam(tmp_path: Path) -> Path:
    (tmp_path / ".sealed").mkdir()
    for name, (truth, answer) in CASES.items():
        (tmp_path / ".sealed" / f"{name}.json").write_text(json.dumps(truth))
        if answer is not None:
            (tmp_path / f"{name}.json").write_text(json.dumps(answer))
    (tmp_path / "seconds.json").write_text(json.dumps({name: 10.0 + n for n, name in enumerate(CASES) if n % 3}))
    return tmp_path


def test_each_case_is_graded_as_stored(exam: Path) -> None:
    lines = []
    for one in graded_cases(exam, exam):
        lines.append(f"== {one.case}")
        for name in OF_A_CASE.split():
            value = getattr(one, name)
            shown = sorted(value) if isinstance(value, set) else value
            lines += [f"{name}: {shown}"] if shown not in (None, [], False) else []
    lines += [json.dumps(row) for row in case_rows(graded_cases(exam, exam))]
    hold_against(STORED / "graded cases.txt", "\n".join(lines) + "\n", 1e-9)


def test_the_grades_are_told_as_stored(exam: Path) -> None:
    grades = grade(exam, exam)
    assert (grades.schema, grades.cases, grades.unanswered) == ("pneucli/exam/1", len(CASES), ["no answer"])
    rows = "".join(f"{json.dumps(row)}\n" for row in grades.rows)
    hold_against(STORED / "grades.md", f"{grades.page}\n{json.dumps(to_json(grades.calibration))}\n{rows}", 1e-6)


def alone(folder: Path, *names: str) -> Grades:
    """The grades of some of the cases alone."""
    for file in (folder / ".sealed").glob("*.json"):
        if file.stem not in names:
            file.unlink()
    return grade(folder, folder)


def test_of_what_there_is_none_nothing_is_told(exam: Path) -> None:
    hold_against(STORED / "grades of one.md", alone(exam, "healthy").page)


def test_the_exact_interval_of_three_in_four(exam: Path) -> None:
    """Clopper and Pearson, from the binomial sums: P(X >= 3 | low) = P(X <= 3 | high) = 2.5 %."""
    found = alone(exam, "right, within 15 %", "right, beyond 15 %", "a twin", "another")
    low, high = found.shares["true effects in the answer"].ci95 or ()
    assert 4 * low**3 * (1 - low) + low**4 == pytest.approx(0.025, rel=1e-6)
    assert 1 - high**4 == pytest.approx(0.025, rel=1e-6)


@pytest.mark.parametrize(
    ("about", "words"),
    [
        ({"seed_from": "given", "program": "p1"}, "chosen by who wrote the exam. Program: p1"),
        ({"seed_from": "given"}, "chosen by who wrote the exam. Program: not stated"),
        ({"seed_from": "program", "program": "p1"}, "from the hash of the program that answers: nobody can have"),
        ({"seed_from": "program", "program": "p2"}, "from the hash of another program than the one that answered"),
    ],
)
def test_the_grades_state_the_origin_of_the_seed(exam: Path, about: dict[str, Any], words: str) -> None:
    (exam / ".sealed" / "exam.json").write_text(json.dumps(about | {"seed": 7}))
    assert grade(exam, exam).page.splitlines()[2].startswith(f"Seed 7, {words}")


@pytest.mark.parametrize("text", ["[]", '{"verdict": "adequate"}', '{"missing": []}'])
def test_an_answer_without_verdict_or_missing_is_refused(exam: Path, text: str) -> None:
    (exam / "healthy.json").write_text(text)
    with pytest.raises(InputError, match=r"(?s)healthy\.json.*no verdict or no missing.*diagnose --json"):
        grade(exam, exam)


def test_a_broken_answer_names_file_and_line(exam: Path) -> None:
    (exam / "healthy.json").write_text('{"verdict":\n oops}')
    with pytest.raises(InputError, match=r"healthy\.json, line 2"):
        grade(exam, exam)


def test_a_folder_without_truths_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no sealed truths"):
        grade(tmp_path, tmp_path)
