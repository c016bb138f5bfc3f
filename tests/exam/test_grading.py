"""Grading: what counts as right, as covered, as confident, why the rest failed, and how the grades are told."""

import json
from pathlib import Path
from typing import Any

import pytest

from pneucli.errors import InputError
from pneucli.exam.grades import Grades, grade, graded_cases
from pneucli.exam.workflow import case_rows
from pneucli.figure import to_json
from tests.stored import hold_against

STORED = Path(__file__).parent / "stored"
CASES: dict[str, dict[str, Any]] = json.loads((STORED / "cases to grade.json").read_text(encoding="utf-8"))
OF_A_CASE = (
    "conditions truth_label answer_label answer_set set_sizes verdict_is_correct failure_cause final_error seconds "
    "parameters_within_tolerance intervals_cover_truth stated_within_tolerance stated_intervals_cover_truth "
    "is_source_recognised stated_probabilities confident_namings confident_detections"
)


@pytest.fixture
def exam(tmp_path: Path) -> Path:
    (tmp_path / ".sealed").mkdir()
    for name, case in CASES.items():
        (tmp_path / ".sealed" / f"{name}.json").write_text(json.dumps(case["truth"]))
        if "answer" in case:
            (tmp_path / f"{name}.json").write_text(json.dumps(case["answer"]))
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
