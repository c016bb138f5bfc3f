"""``exam``: cases are answered once each, failures do not stop the others, grades come with what they took."""

import json
from pathlib import Path

import numpy as np
import pytest

from pneucli.exam.conditions import CONDITIONS
from pneucli.exam.workflow import seed_from_program
from pneucli.io.artifacts import read_table
from pneucli.pipeline.manifest import program_digest
from tests.cli.conftest import Command
from tests.cli.toys import PIPELINE

ADEQUATE = {"verdict": "adequate", "missing": []}


def test_the_conditions_are_listed_without_a_folder(pneucli: Command) -> None:
    shown = pneucli("exam", "--conditions")
    assert (shown.code, shown.err) == (0, "")
    assert [line.split()[0] for line in shown.out.splitlines()] == [one.pattern for one in CONDITIONS]
    assert "bore-#mm         a piston of this diameter, 6 to 200\n" in shown.out


def case(exam: Path, name: str) -> None:
    """A case for the toy stages."""
    (exam / name).mkdir(parents=True)
    (exam / name / "raw.csv").write_text("t,p\n0,1\n1,2\n")
    (exam / name / "pipeline.toml").write_text(PIPELINE)


def seal(exam: Path, name: str, hidden: str | None = None) -> None:
    truth = {
        "hidden": {hidden: {"area": 1.0}} if hidden else {},
        "outside_the_catalogue": None,
        "verdict": "missing-effect" if hidden else "adequate",
    }
    (exam / ".sealed").mkdir(parents=True, exist_ok=True)
    (exam / ".sealed" / f"{name}.json").write_text(json.dumps(truth))


def answered(exam: Path, name: str, answer: dict[str, object]) -> Path:
    path = exam / "answers" / f"{name}.json"
    path.parent.mkdir(exist_ok=True)
    path.write_text(json.dumps(answer))
    return path


@pytest.fixture
def exam(tmp_path: Path) -> Path:
    return tmp_path / "exam"


def test_exam_writes_cases_and_prints_the_next_command(pneucli: Command, exam: Path) -> None:
    result = pneucli("exam", exam, "--cases", 1, "--nulls", 1, "--seed", 5)
    assert result.code == 0
    assert "wrote 2 cases" in result.out
    assert "--answer" in result.out
    assert sorted(path.parent.name for path in exam.glob("*/pipeline.toml")) == ["case-001", "case-002"]
    assert pneucli("exam", exam).code == 2  # not empty
    sealed = json.loads((exam / ".sealed" / "exam.json").read_text())
    assert (sealed["seed"], sealed["seed_from"]) == (5, "given")


def test_every_case_is_answered_with_what_diagnose_answers_and_its_seconds(pneucli: Command, exam: Path) -> None:
    case(exam, "a")
    case(exam, "b")
    result = pneucli("exam", exam, "--answer", "--json")
    assert result.code == 0
    assert json.loads(result.out)["answered"] == ["a", "b"]
    assert json.loads((exam / "answers" / "b.json").read_text())["schema"] == "toy/diagnose/1"
    assert sorted(json.loads((exam / "answers" / "seconds.json").read_text())) == ["a", "b"]


def test_an_interrupted_exam_resumes(pneucli: Command, exam: Path) -> None:
    case(exam, "a")
    case(exam, "b")
    kept = answered(exam, "a", {"verdict": "adequate", "missing": [], "by": "somebody"})
    assert pneucli("exam", exam, "--answer", "--quiet").out == "2 cases answered, 0 failed\n"
    assert json.loads(kept.read_text())["by"] == "somebody"
    assert not (exam / "a" / "artifacts").exists()


def test_a_case_that_fails_is_recorded_and_the_others_are_answered(pneucli: Command, exam: Path) -> None:
    case(exam, "a")
    case(exam, "b")
    (exam / "a" / "pipeline.toml").write_text("[pipeline]\nname = 3\n")
    result = pneucli("exam", exam, "--answer", "--quiet")
    assert result.code == 0
    assert "a failed: InputError" in result.out
    assert "1 cases answered, 1 failed" in result.out
    record = json.loads((exam / "answers" / "a.json").read_text())
    assert (record["verdict"], record["missing"]) == ("failed", [])
    assert (exam / "answers" / "b.json").exists()


def test_grades_show_the_confusion_and_the_seconds(pneucli: Command, exam: Path) -> None:
    for name, hidden in (("a", "valve-leak"), ("b", None), ("c", None)):
        seal(exam, name, hidden)
    answered(exam, "a", {"verdict": "missing-effect", "missing": ["valve-lag"]})
    answered(exam, "b", ADEQUATE)
    answered(exam, "c", {"verdict": "failed", "missing": [], "error": "a bug"})
    (exam / "answers" / "seconds.json").write_text(json.dumps({"a": 30.0, "b": 10.0, "c": 20.0}))
    page = pneucli("exam", exam, "--grade")
    assert page.code == 0
    assert "| valve-leak | valve-lag | 1 |" in page.out
    assert "| none | failed | 1 |" in page.out
    assert "Processor seconds a case: 20 (median), 30 (a, slowest)" in page.out
    grades = json.loads(pneucli("exam", exam, "--grade", "--json").out)
    assert grades["shares"]["verdict right"]["right"] == 2  # of a and b
    assert grades["shares"]["exactly the true effects"]["right"] == 0
    assert grades["seconds"] == {"median": 20.0, "slowest": 30.0, "case": "a"}


def test_answer_and_grade_go_together(pneucli: Command, exam: Path) -> None:
    case(exam, "a")
    seal(exam, "a")
    answered(exam, "a", ADEQUATE)
    grades = json.loads(pneucli("exam", exam, "--answer", "--grade", "--json").out)
    assert grades["shares"]["nulls named nothing"]["right"] == 1
    assert grades["seconds"] is None


@pytest.mark.parametrize("what", ["--answer", "--grade"])
def test_a_folder_without_an_exam_is_an_input_error(pneucli: Command, tmp_path: Path, what: str) -> None:
    result = pneucli("exam", tmp_path, what)
    assert result.code == 2
    assert "pneucli exam" in result.err or "write an exam" in result.err


def test_conditions_have_names_and_an_unknown_one_is_an_input_error(pneucli: Command, exam: Path) -> None:
    wrong = pneucli("exam", exam, "--condition", "rate-20kHz")
    assert wrong.code == 2
    assert "rate-#Hz" in wrong.err
    result = pneucli("exam", exam, "--cases", 0, "--nulls", 1, "--condition", "rate-200Hz", "--json")
    written = json.loads(result.out)
    assert written["conditions"] == ["rate-200Hz"]
    assert len(written["cases"]) == 1


def test_the_default_seed_is_the_programs_hash_and_both_are_sealed(pneucli: Command, exam: Path) -> None:
    pneucli("exam", exam, "--cases", 0, "--nulls", 1)
    sealed = json.loads((exam / ".sealed" / "exam.json").read_text())
    assert sealed["program"] == program_digest()
    assert sealed["seed"] == seed_from_program(program_digest()) != seed_from_program(program_digest() + "changed")
    answered(exam, "case-001", ADEQUATE | {"program": program_digest()})
    page = pneucli("exam", exam, "--grade").out
    assert f"Seed {sealed['seed']}, from the hash of the program that answers" in page
    assert program_digest() in page
    answered(exam, "case-001", ADEQUATE | {"program": "0.1 of yesterday"})
    assert "from the hash of another program" in pneucli("exam", exam, "--grade").out
    assert json.loads(pneucli("exam", exam, "--grade", "--json").out)["answered_by"] == ["0.1 of yesterday"]


def test_an_answer_states_the_program_that_gave_it(pneucli: Command, exam: Path) -> None:
    case(exam, "a")
    pneucli("exam", exam, "--answer")
    assert json.loads((exam / "answers" / "a.json").read_text())["program"] == program_digest()


def test_grades_are_also_tables_with_units(pneucli: Command, exam: Path) -> None:
    for name, conditions in (("a", ["usual"]), ("b", ["messy", "rate-200Hz"])):
        seal(exam, name)
        path = exam / ".sealed" / f"{name}.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | {"conditions": conditions}))
    answered(exam, "a", ADEQUATE)
    pneucli("exam", exam, "--grade")
    grades = read_table(exam / "answers" / "grades.parquet")
    assert set(grades["condition"]) == {"all", "usual", "messy", "rate-200Hz", "messy+rate-200Hz"}
    of = dict(zip(zip(grades["condition"], grades["what"], strict=True), grades["value"], strict=True))
    assert (of["all", "verdict right"], of["usual", "verdict right"], of["messy", "verdict right"]) == (0.5, 1.0, 0.0)
    assert of["messy", "failure: no answer"] == 1.0
    assert np.isnan(of["all", "unknown flagged"])
    cases = read_table(exam / "answers" / "cases.parquet")
    assert list(cases["case"]) == ["a", "b"]
    assert list(cases["failure"]) == ["", "no answer"]
