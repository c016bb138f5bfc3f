"""Exams: write sealed cases, and grade the answers to them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pneucli.exam.cases import write_exam
from pneucli.exam.grading import grade as grade_answers
from pneucli.exam.grading import to_markdown
from pneucli.io.artifacts import atomic_path

GRADES, SUMMARY = "grades.json", "grades.md"


def write(directory: Path, cases: int = 60, nulls: int = 20, size: float = 1.0, seed: int = 1) -> dict[str, Any]:
    """Write an exam into an empty or new folder; the truths lie sealed in its hidden folder.

    ``cases`` have something hidden, of ``size`` times the usual, ``nulls`` have nothing. Raises InputError where
    the folder holds something already.
    """
    names = write_exam(directory, cases, nulls, size, seed)
    return {"schema": "pneucli/exam-written/1", "directory": str(directory), "size": size, "seed": seed, "cases": names}


def grade(directory: Path, answers: Path | None = None) -> dict[str, Any]:
    """Grade ``answers/CASE.json`` (default: the folder ``answers`` in the exam's) into ``grades.json`` and ``.md``.

    Raises InputError where there is no truth or an answer cannot be read.
    """
    answers = answers or directory / "answers"
    result = grade_answers(directory, answers)
    for name, text in ((GRADES, json.dumps(result, indent=1) + "\n"), (SUMMARY, to_markdown(result))):
        with atomic_path(answers / name) as path:
            path.write_text(text, encoding="utf-8")
    return result
