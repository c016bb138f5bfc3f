"""Exams: write sealed cases, answer them, and grade the answers."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pneucli.errors import InputError
from pneucli.exam.cases import write_exam
from pneucli.exam.conditions import USUAL
from pneucli.exam.grading import SECONDS, to_markdown
from pneucli.exam.grading import grade as grade_answers
from pneucli.io.artifacts import atomic_path
from pneucli.pipeline.context import Progress, silent
from pneucli.pipeline.runner import open_pipeline
from pneucli.stages.load import load

__all__ = ["answer", "grade", "to_markdown", "write"]

ANSWERS = "answers"
GRADES, SUMMARY = "grades.json", "grades.md"
FAILED = "failed"


def write(
    directory: Path,
    cases: int = 60,
    nulls: int = 20,
    size: float = 1.0,
    seed: int = 1,
    conditions: Sequence[str] = (USUAL,),
) -> dict[str, Any]:
    """Write an exam into an empty or new folder; the truths lie sealed in its hidden folder.

    Of each of the ``conditions``, ``cases`` have something hidden, of ``size`` times the usual, and ``nulls`` have
    nothing. Raises InputError where the folder holds something already, or for an unknown condition.
    """
    names = write_exam(directory, cases, nulls, size, seed, conditions)
    return {
        "schema": "pneucli/exam-written/1",
        "directory": str(directory),
        "size": size,
        "seed": seed,
        "conditions": list(conditions),
        "cases": names,
    }


def answer(directory: Path, progress: Progress = silent) -> dict[str, Any]:
    """Diagnose every ``CASE/pipeline.toml`` that has no ``answers/CASE.json`` yet; note the seconds of each.

    A case that fails gets the verdict ``failed`` and the error for an answer; delete that file to try it again.
    Raises InputError where there are no cases.
    """
    cases = {path.parent.name: path for path in sorted(directory.glob("*/pipeline.toml"))}
    if not cases:
        raise InputError(str(directory), "no CASE/pipeline.toml in it", "an exam", f"pneucli exam {directory}")
    answers = directory / ANSWERS
    answers.mkdir(exist_ok=True)
    given: dict[str, dict[str, Any]] = {}
    for i, (case, pipeline) in enumerate(cases.items()):
        progress(case, i / len(cases))
        if not (answers / f"{case}.json").exists():
            _answer(pipeline, answers, case)
        given[case] = _read(answers / f"{case}.json")
    return {
        "schema": "pneucli/exam-answered/1",
        "answered": [case for case, content in given.items() if content.get("verdict") != FAILED],
        "failed": {case: content["error"] for case, content in given.items() if content.get("verdict") == FAILED},
        "seconds": _read(answers / SECONDS),
    }


def _answer(pipeline: Path, answers: Path, case: str) -> None:
    """Write the seconds that the stages took, then the answer: no answer without its seconds."""
    try:
        done = open_pipeline(pipeline, load).bring_up(["diagnose"])
        content = dict(done["diagnose"].answer)
        _write(answers / SECONDS, _read(answers / SECONDS) | {case: sum(d.manifest.seconds for d in done.values())})
    except Exception as error:  # one case must not stop the others
        content = {"verdict": FAILED, "missing": [], "error": f"{type(error).__name__}: {error}"}
    _write(answers / f"{case}.json", content)


def grade(directory: Path, answers: Path | None = None) -> dict[str, Any]:
    """Grade ``answers/CASE.json`` (default: the folder ``answers`` in the exam's) into ``grades.json`` and ``.md``.

    Raises InputError where there is no truth or an answer cannot be read.
    """
    answers = answers or directory / ANSWERS
    result = grade_answers(directory, answers)
    _write(answers / GRADES, result)
    with atomic_path(answers / SUMMARY) as path:
        path.write_text(to_markdown(result), encoding="utf-8")
    return result


def _read(path: Path) -> dict[str, Any]:
    return dict(json.loads(path.read_text(encoding="utf-8"))) if path.exists() else {}


def _write(path: Path, content: dict[str, Any]) -> None:
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
