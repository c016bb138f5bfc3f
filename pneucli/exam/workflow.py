"""Write sealed cases, answer them, and grade the answers."""

import hashlib
import json
import time
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa

from pneucli.errors import InputError
from pneucli.exam.cases import write_exam
from pneucli.exam.conditions import USUAL
from pneucli.exam.graded_case import GradedCase
from pneucli.exam.grades import SECONDS_FILE, Answered, Grades, Written, graded_cases
from pneucli.exam.grades import grade as grade_answers
from pneucli.executors import engine_from, run_jobs
from pneucli.figure import to_json
from pneucli.io.artifacts import Provenance, TableWriter, schema_of, write_text
from pneucli.pipeline.graph import NO_PROGRESS, Progress
from pneucli.pipeline.manifest import program_digest, program_versions
from pneucli.pipeline.runner import open_pipeline
from pneucli.stages.pipeline_file import load_pipeline_file

Job = tuple[str, str, str]  # the pipeline file, the folder of the answers, the name of the case
ANSWERS = "answers"
GRADES, SUMMARY = "grades.json", "grades.md"
GRADES_TABLE, CASES_TABLE = "grades.parquet", "cases.parquet"
FAILED = "failed"
COLUMN_UNITS = {
    "value": "see column unit",
    "right": "1",
    "of": "1",
    "ci_low": "1",
    "ci_high": "1",
    "largest_set": "1",
    "error_after": "1",
    "seconds": "s",
}


def case_rows(graded: Sequence[GradedCase]) -> list[dict[str, Any]]:
    """Return one row for each case."""
    return [
        {
            "case": g.case,
            "conditions": "+".join(g.truth.get("conditions", g.conditions)),
            "hidden": g.truth_label,
            "verdict": g.verdict,
            "named": " + ".join(sorted(g.missing)),
            "failure": g.failure_cause or "",
            "largest_set": float(max(g.set_sizes, default=0)),
            "error_after": g.final_error,
            "seconds": g.seconds,
        }
        for g in graded
    ]


def write(
    directory: Path,
    cases: int = 60,
    nulls: int = 20,
    size: float = 1.0,
    seed: int | None = None,
    conditions: Sequence[str] = (USUAL,),
) -> Written:
    """Write an exam into an empty or new folder; the truth is sealed in its hidden folder.

    For each of the ``conditions``, ``cases`` rigs hide effects of ``size`` times the usual, and ``nulls`` are healthy.
    Without a ``seed`` it is the hash of this program, so that nobody can have tuned the program to the cases. Raises
    InputError where the folder is not empty, or for an unknown condition.
    """
    program = program_digest()
    about = {"seed_from": "program" if seed is None else "given", "program": program}
    seed = seed_from_program(program) if seed is None else seed
    names = write_exam(directory, cases, nulls, size, seed, conditions, about)
    return Written(
        "pneucli/exam-written/1", str(directory), size, seed, **about, conditions=list(conditions), cases=names
    )


def seed_from_program(program: str) -> int:
    """Return the seed for a program's version and hash."""
    return int(hashlib.sha256(program.encode()).hexdigest()[:8], 16)


def answer(directory: Path, progress: Progress = NO_PROGRESS, executor: str | None = None) -> Answered:
    """Diagnose every ``CASE/pipeline.toml`` that has no ``answers/CASE.json`` yet, and store the seconds of each.

    A case that fails gets the verdict ``failed`` and the error as its answer; delete that file to repeat it. Raises
    InputError where there are no cases, or the executor cannot work.
    """
    cases = {path.parent.name: path for path in sorted(directory.glob("*/pipeline.toml"))}
    if not cases:
        raise InputError(
            str(directory), "no CASE/pipeline.toml in it", "an exam", f"pneucli exam {directory}", code="E007"
        )
    answers = (directory / ANSWERS).absolute()
    answers.mkdir(exist_ok=True)
    open_jobs = deque((str(p), str(answers), c) for c, p in cases.items() if not (answers / f"{c}.json").exists())
    if open_jobs:
        _answer_all(open_jobs, executor, progress)
    given = {case: _read(answers / f"{case}.json") for case in cases}
    noted = {case: content["seconds"] for case, content in given.items() if "seconds" in content}
    _write(answers / SECONDS_FILE, _read(answers / SECONDS_FILE) | noted)
    return Answered(
        schema="pneucli/exam-answered/1",
        answered=[case for case, content in given.items() if content.get("verdict") != FAILED],
        failed={case: content["error"] for case, content in given.items() if content.get("verdict") == FAILED},
        seconds=_read(answers / SECONDS_FILE),
    )


def _answer_all(open_jobs: deque[Job], executor: str | None, progress: Progress) -> None:
    total = len(open_jobs)
    progress(f"{total} cases", 0.0)
    with engine_from(executor, program_versions, preload=__name__) as engine:
        for done, outcome in enumerate(run_jobs(engine, answer_case, open_jobs), 1):
            if isinstance(outcome.error, ChildProcessError):
                _, answers, case = outcome.job
                _write(Path(answers) / f"{case}.json", _failed(outcome.error))
            elif outcome.error is not None:
                raise outcome.error
            progress(f"{done} of {total} cases, {outcome.job[-1]}", done / total)


def answer_case(job: Job) -> str:
    """Diagnose one case, write the answer with the processor seconds of all stages, and return the case's name."""
    pipeline, answers, case = job
    begun = time.process_time()
    try:
        opened = open_pipeline(Path(pipeline), load_pipeline_file)
        content = dict(opened.update(["diagnose"])["diagnose"].answer)
        if content.get("flow"):  # a steady bench: whether its command sets an area is what identify says
            flow = opened.update(["identify"])["identify"].answer["flow"]
            content["command_sets_area"] = flow["command_sets_area"]
    except Exception as error:  # one case must not stop the others
        content = _failed(error)
    seconds = time.process_time() - begun
    _write(Path(answers) / f"{case}.json", content | {"program": program_digest(), "seconds": seconds})
    return case


def _failed(error: BaseException) -> dict[str, Any]:
    return {"verdict": FAILED, "missing": [], "error": f"{type(error).__name__}: {error}"}


def grade(directory: Path, answers: Path | None = None) -> Grades:
    """Grade ``answers/CASE.json`` (default: the exam's folder ``answers``) into ``grades.json`` and ``grades.md``.

    ``grades.parquet`` has a row for each condition and measure, ``cases.parquet`` one for each case.
    Raises InputError where there is no truth or an answer cannot be read.
    """
    answers = answers or directory / ANSWERS
    result = grade_answers(directory, answers)
    _write(answers / GRADES, to_json(result))
    write_text(answers / SUMMARY, result.page)
    made_of = Provenance(parameters={"exam": result.exam, "answered_by": result.answered_by})
    _write_rows(answers / GRADES_TABLE, result.rows, "pneucli/exam-grades/1", made_of)
    _write_rows(answers / CASES_TABLE, case_rows(graded_cases(directory, answers)), "pneucli/exam-cases/1", made_of)
    return result


def _write_rows(path: Path, lines: Sequence[Mapping[str, Any]], schema: str, provenance: Provenance) -> None:
    """Write rows of texts and, in the columns of ``COLUMN_UNITS``, numbers or nulls."""
    names = list(lines[0])
    types = {name: pa.float64() if name in COLUMN_UNITS else pa.string() for name in names}
    with TableWriter(path, schema_of(types, units=COLUMN_UNITS, schema=schema, provenance=provenance)) as writer:
        writer.write({name: [line[name] for line in lines] for name in names})


def _read(path: Path) -> dict[str, Any]:
    return dict(json.loads(path.read_text(encoding="utf-8"))) if path.exists() else {}


def _write(path: Path, content: dict[str, Any]) -> None:
    write_text(path, json.dumps(content, indent=1) + "\n")
