"""Numbers read well wherever people meet them: on the terminal, on the page, and in the texts of faults."""

from __future__ import annotations

import ast
import html
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import pneucli
from pneucli import messages
from pneucli.report.page import to_html
from tests.report.bench import whole

PACKAGE = Path(pneucli.__file__).parent
STUMBLING = re.compile(r"\d[eE][+-]\d|\d*\.\d{8,}")
LATEX = re.compile(r"\\[a-zA-Z]+|\$[^$\n]*[\\^_][^$\n]*\$")
INTERVAL = re.compile(r"(−?[\d.]+) ± ([\d.]+)")

# modules that write numbers for programs, or that lie below the formatter: none of an estimate
FOR_PROGRAMS = {
    *("config/key_reference.py", "config/load.py", "config/value_types.py", "units.py"),  # what a file may hold
    *("init/clock_columns.py", "init/columns.py", "init/components.py", "init/writer.py"),  # TOML
    "init/survey.py",  # names of runs
    *("exam/conditions.py", "exam/from_pipeline.py", "exam/laboratory.py", "exam/like.py"),
    *("exam/grades.py", "executors/dask_cluster.py", "export/fmu/package.py", "export/fmu/plant.py"),
    *("fleet/output.py", "io/file_units.py", "stages/plan_take.py", "workbench/bench.py"),
    *(
        "stages/history.py",
        "identify/valve/charge_budget.py",
        "simulate/valve_forms/area.py",
        "stages/flow_bench.py",
        "stages/diagnosis_answer.py",
    ),  # names of rows
    *("stages/identify_tables.py", "tp/model.py", "tp/sampling.py", "tp/scattered.py", "tp/weights.py"),
    "messages/formatting.py",
}


def exponent_formats(path: Path) -> Iterator[int]:
    """Yield the lines of a module where a number is formatted as Python does, with an exponent where it likes."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FormattedValue) and isinstance(node.format_spec, ast.JoinedStr):
            spec = "".join(str(part.value) for part in node.format_spec.values if isinstance(part, ast.Constant))
            if re.search(r"[eEgG]$", spec):
                yield node.lineno


def test_people_read_numbers_of_one_formatter() -> None:
    found = {path.relative_to(PACKAGE).as_posix(): [*exponent_formats(path)] for path in PACKAGE.rglob("*.py")}
    assert {name: lines for name, lines in found.items() if lines and name not in FOR_PROGRAMS} == {}


def faults(text: str) -> list[str]:
    """What a reader stumbles over: exponents of programs, more digits than an interval or any sensor has."""
    wrong = [match.group() for match in STUMBLING.finditer(text)]
    for value, width in INTERVAL.findall(text):
        digits = width.replace(".", "").lstrip("0")
        even = len(value.partition(".")[2]) == len(width.partition(".")[2])
        if not even or len(digits.rstrip("0") if "." not in width else digits) > 2:
            wrong.append(f"{value} ± {width}")
    return wrong


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("1.7e+02 times", ["7e+0"]),
        ("12.345678901 N", ["12.345678901"]),
        ("3.0 ± 1.0 and 1230 ± 230", []),
        ("0.12345 ± 0.00321", ["0.12345 ± 0.00321"]),
        ("5.0 ± 0.10", ["5.0 ± 0.10"]),
    ],
)
def test_the_guard_sees_what_it_is_for(text: str, wrong: list[str]) -> None:
    assert faults(text) == wrong


def test_the_page_has_no_number_that_nobody_reads() -> None:
    seen = re.sub(r"(?s)<(script|style|svg|math)\b.*?</\1>", " ", to_html(whole()))
    text = html.unescape(re.sub(r"<[^>]*>", " ", seen))
    assert "±" in text
    assert faults(text) == []


def test_a_terminal_has_no_such_number_and_no_formula(demo: tuple[Path, dict[str, Any]]) -> None:
    text = "\n".join(messages.render(name, answer, "a.toml", verbose=True) for name, answer in demo[1].items())
    assert "±" in text
    assert faults(text) == []
    assert not LATEX.search(text)
