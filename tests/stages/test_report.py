"""The stage ``report``: artifacts on disk in, three files out."""

import ast
import html
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

import pneucli
from pneucli import config, messages
from pneucli.io.artifacts import Provenance, read_table, write_table
from pneucli.pipeline.graph import Context
from pneucli.report.page import to_html
from pneucli.stages import report
from pneucli.stages.report import closed_loop_checks
from tests.report.bench import whole

PIPELINE = """
[pipeline]
name = "bench"
[[recordings]]
file = "raw.csv"
experiment = "valve"
use = "train"
[checks]
"compare.error.test" = { max = 1.5 }
"compare.error.train" = { min = 0.5, max = 2.0 }
"diagnose.verdict" = { equals = "adequate" }
"""
SHOWN = ("compare/residuals", "identify/valve_areas", "identify/tp_weights", "identify/tp_vertices")


@pytest.fixture
def context(tmp_path: Path) -> Context:
    """A finished run of ingest, identify and compare; diagnose never ran."""
    file = tmp_path / "bench.toml"
    file.write_text(PIPELINE)
    material = whole()
    for name in SHOWN:
        table = material.tables[name]
        numeric = {n: table.units.get(n, "1") for n in table.columns if table[n].dtype.kind in "fib"}
        write_table(
            tmp_path / f"{name}.parquet",
            {n: table[n] for n in table.columns},
            units=numeric,
            schema=f"pneucli/{name}/1",
            provenance=Provenance(),
        )
    answers: dict[str, Any] = {n: dict(material.answers[n]) for n in ("ingest", "identify", "compare")}
    out = tmp_path / ".report.new"
    out.mkdir()
    return Context(file, config.load(file), out, tmp_path, answers=answers)


def test_it_writes_page_summary_and_junit(context: Context) -> None:
    answer = report.run(context)
    assert sorted(path.name for path in context.out.iterdir()) == sorted([*answer["files"], "tables"])
    page = (context.out / "report.html").read_text(encoding="utf-8")
    assert len(page.encode()) == answer["bytes"]
    assert '<section id="comparison">' in page
    assert str(context.artifacts) not in page


def test_the_thesis_has_a_page_of_its_own_where_it_is_asked_for(context: Context) -> None:
    plain = report.run(context)
    assert "thesis.html" not in plain["files"]
    assert not any(name.startswith("tables/tensor") for name in plain["tables"])
    answer = report.run(replace(context, options={"thesis": True}))
    assert sorted(path.name for path in context.out.iterdir()) == sorted([*answer["files"], "tables"])
    page = (context.out / "thesis.html").read_text(encoding="utf-8")
    assert re.findall(r'<section id="([^"]+)">', page) == ["thesis", "tensor"]
    assert "Figure 7.23" in page
    assert "tables/tensor-1.parquet" in answer["tables"]
    assert "report/report.html" in (told := messages.render("report", answer, "bench.toml"))
    assert "junit.xml, thesis.html" in told
    assert '<section id="tensor">' not in (context.out / "report.html").read_text(encoding="utf-8")


def test_every_table_of_the_page_is_a_parquet_file_too(context: Context) -> None:
    answer = report.run(context)
    written = sorted(path.relative_to(context.out).as_posix() for path in context.out.glob("tables/*.parquet"))
    assert written == sorted(answer["tables"])
    shown = read_table(context.out / "tables/checks-1.parquet")
    assert list(shown["check"]) == ["compare.error.test", "compare.error.train", "diagnose.verdict"]


def test_units_of_a_table_come_with_it(context: Context) -> None:
    assert report.load_tables(context.artifacts)["identify/valve_areas"].units["area"] == "m^2"


def test_the_checks_are_those_of_the_pipeline_file(context: Context) -> None:
    # the bench's error is sqrt((1 + 9 + 1.21) / 3) = 1.93, over 1.5 and between 0.5 and 2
    answer = report.run(context)
    passed = {check["path"]: check["passed"] for check in answer["checks"]}
    assert passed == {"compare.error.test": False, "compare.error.train": True, "diagnose.verdict": False}
    suite = ElementTree.parse(context.out / "junit.xml").getroot()
    failures = {case.get("name"): case.findtext("failure") for case in suite.iter("testcase")}
    assert failures["compare.error.train"] is None
    assert "max 1.5" in (failures["compare.error.test"] or "")
    assert 'no "diagnose"' in (failures["diagnose.verdict"] or "")


def test_the_line_for_people_names_the_failed_checks(context: Context) -> None:
    told = messages.render("report", report.run(context), "bench.toml")
    assert "failed   checks: compare.error.test and diagnose.verdict" in told


def test_the_rig_is_said_in_a_few_words(context: Context) -> None:
    cylinder = {"piston_area_1": "8.0425 cm^2", "piston_area_2": "8 cm^2", "stroke": "200 mm"}
    rig = {**context.config.model_dump()["rig"], "supply_pressure": "7 bar", "cylinder": cylinder}
    config = context.config.model_validate({**context.config.document, "rig": {**rig, "vessel": {}}})
    assert (
        report.rig_description(config) == "cylinder ⌀ 32.0 mm × 200 mm, supply 7.00 bar"
    )  # pi/4 (32 mm)^2 = 8.0425 cm^2
    assert report.rig_description(context.config) == ""


# --- numbers read well wherever people meet them: on the terminal, on the page, and in the texts of faults


PACKAGE = Path(pneucli.__file__).parent
STUMBLING = re.compile(r"\d[eE][+-]\d|\d*\.\d{8,}")
LATEX = re.compile(r"\\[a-zA-Z]+|\$[^$\n]*[\\^_][^$\n]*\$")
INTERVAL = re.compile(r"(−?[\d.]+) ± ([\d.]+)")

# modules that write numbers for programs, or that lie below the formatter: none of an estimate
FOR_PROGRAMS = {
    *("config/key_reference.py", "config/load.py", "config/value_types.py", "units.py"),  # what a file may hold
    *("init/clock_columns.py", "init/columns.py", "init/components.py"),  # TOML
    *("init/stated_scales.py", "init/writer.py"),  # the same
    "init/survey.py",  # names of runs
    *("exam/conditions.py", "exam/from_pipeline.py", "exam/laboratory.py"),
    *("exam/grades.py", "executors.py", "export/fmu/package.py", "export/fmu/plant.py"),
    *("fleet/output.py", "io/file_units.py", "stages/plan_take.py", "workbench/bench.py"),
    *("stages/history.py", "stages/flow_bench.py", "stages/diagnosis_answer.py"),  # names of rows
    *("identify/valve/charge_budget.py", "simulate/valve_forms.py"),
    *("stages/identify_tables.py", "tp/model.py", "tp/sampling.py", "tp/weights.py"),
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


# --- default checks of the closed loop: limits from the requirements, skipped without one


FIGURES: dict[str, Any] = {
    "steady_um": 4.0,
    "cycle_um": 0.0,
    "tracking_rms_um": None,
    "recovery_s": None,
    "peak_um": None,
}
LOADED = FIGURES | {"recovery_s": 0.2, "peak_um": 900.0}
SINE = FIGURES | {"steady_um": None, "cycle_um": None, "tracking_rms_um": 40.0}
GATE = {"passed": True, "missed": [], "model_error": 1.0, "model_error_limit": 2.0}


def answers(**changed: Any) -> dict[str, Any]:
    design = {
        "requirements": {"controller": "best", "settling_time": None, "tracking_error": None},
        "compare": {},
        "tolerance_um": 10.0,
        "gate": GATE,
    }
    replay = {"difference_v": 0.0, "samples": 60000, "reason": ""}
    loop = {"steps": FIGURES, "load": LOADED, "sine": SINE}
    simulate = {"closed_loop": loop | changed.pop("loop", {}), "exported_c": changed.pop("replay", replay)}
    return {"design": design | changed, "simulate": simulate}


def outcome(**changed: Any) -> dict[str, str]:
    found = closed_loop_checks(answers(**changed))
    return {
        c.path.removeprefix("closed-loop."): "skipped" if c.skipped else "failed" if c.failure else "passed"
        for c in found
    }


def test_without_stated_requirements_rest_cycle_recovery_gate_and_c_are_checked() -> None:
    passed = dict.fromkeys(("gate", "rest", "limit-cycle", "recovery", "exported-c"), "passed")
    assert outcome() == passed | {"sine": "skipped"}


@pytest.mark.parametrize(
    ("name", "changed"),
    [
        ("rest", {"tolerance_um": 3.0}),
        ("limit-cycle", {"loop": {"steps": FIGURES | {"cycle_um": 11.0}}}),
        ("recovery", {"loop": {"load": LOADED | {"recovery_s": None}}}),
        ("recovery", {"requirements": {"controller": "best", "settling_time": 0.1, "tracking_error": None}}),
        ("sine", {"requirements": {"controller": "best", "settling_time": None, "tracking_error": 30e-6}}),
        ("gate", {"gate": GATE | {"passed": False}}),
        ("exported-c", {"replay": {"difference_v": 1e-6, "samples": 1, "reason": ""}}),
    ],
)
def test_what_exceeds_its_limit_fails(name: str, changed: dict[str, Any]) -> None:
    assert outcome(**changed)[name] == "failed"


def test_without_a_compiler_the_c_is_skipped_with_the_reason() -> None:
    found = closed_loop_checks(answers(replay={"difference_v": None, "samples": 0, "reason": "no C compiler (cc)"}))
    assert [c.skipped for c in found if c.path.endswith("exported-c")] == ["no C compiler (cc)"]


def test_without_a_design_there_are_none() -> None:
    assert closed_loop_checks({"compare": {}}) == []
