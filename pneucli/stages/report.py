"""``report``: one HTML file, a Markdown summary, JUnit XML."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pneucli.config import PipelineConfig
from pneucli.errors import InputError
from pneucli.export.export_files import MAX_DIFFERENCE
from pneucli.figure import read, to_answer
from pneucli.io.artifacts import Provenance, read_metadata, read_table, write_table, write_text
from pneucli.messages import answer_of, compare, diagnose
from pneucli.messages.design import Answer as Design
from pneucli.messages.design import Gate, Scenarios, worst_value
from pneucli.messages.formatting import format_number, format_plain, format_quantity
from pneucli.messages.report import Answer, DefaultCheck, StatedCheck
from pneucli.messages.simulate import Answer as Simulation
from pneucli.messages.simulate import ReplayCheck
from pneucli.pipeline.checks import evaluate
from pneucli.pipeline.graph import Context
from pneucli.report.overview import overview
from pneucli.report.page import build_sections, thesis_page, to_html
from pneucli.report.page_elements import Section, section_tables
from pneucli.report.report_data import Check, EarlierAnswer, ReportData, Table
from pneucli.report.summaries import to_junit, to_markdown
from pneucli.report.thesis import SECTIONS as THESIS_SECTIONS
from pneucli.stages import history
from pneucli.stages.compare import RESIDUALS_FILE
from pneucli.stages.diagnosis_answer import SHAPE_FILE
from pneucli.version import __version__

Answers = Mapping[str, Mapping[str, Any]]
MICROMETRES_PER_METRE = 1e6
UNIT_IN_TITLE = "as titled"  # unit of a column whose title states it
REPORTED_ARTIFACTS = ("ingest/signals", "compare/*", "identify/*", "diagnose/*", "design/*", "simulate/*")


def run(context: Context) -> dict[str, Any]:
    """Write the report of whatever the stages before have left, and that of the thesis where it was asked for.

    Returns what it holds, in brief.
    """
    context.progress("reading artifacts")
    checks = [check_result(path, limit, context.answers, context.path.name) for path, limit in _limits(context).items()]
    defaults = closed_loop_checks(context.answers)
    tables = load_tables(context.artifacts)
    about = {"made by": f"pneucli {__version__}", "pipeline file": context.path.name}
    material = ReportData(context.config.name, context.answers, tables, checks, about, rig_description(context.config))
    material = replace(material, file=context.path.name, **_earlier_models(context.artifacts))
    context.progress("drawing")
    sections = build_sections(material)
    first = overview(material)
    page = to_html(material, sections, first)
    texts = {
        "report.html": page,
        "summary.md": to_markdown(material, first),
        "junit.xml": to_junit(material.name, [*checks, *defaults]),
    }
    if context.options.get("thesis"):
        of_thesis = build_sections(material, THESIS_SECTIONS)
        texts["thesis.html"] = thesis_page(material, of_thesis)
        sections += of_thesis
    tables_written = _write_tables(context, sections)
    for name, text in texts.items():
        write_text(context.out / name, text)
    found = Answer(
        schema="pneucli/report/1",
        pipeline=context.config.name,
        files=[*texts],
        tables=tables_written,
        bytes=len(page.encode()),
        checks=[StatedCheck(c.path, not c.failure) for c in checks],
        default_checks=[DefaultCheck(c.path, None if c.skipped else not c.failure, c.value) for c in defaults],
    )
    return to_answer(found)


def _write_tables(context: Context, sections: Sequence[Section]) -> list[str]:
    """Write the tables of the page to ``tables/``, each with its caption; return the names of the files."""
    names = []
    for table in section_tables(sections):
        names.append(f"tables/{table.name}.parquet")
        write_table(
            context.out / names[-1],
            table.columns,
            units={title: UNIT_IN_TITLE for title, values in table.columns.items() if not isinstance(values, list)},
            schema="pneucli/report/table/1",
            provenance=Provenance({}, {"pipeline": context.config.name, "caption": table.caption}),
        )
    return names


def load_tables(artifacts: Path) -> dict[str, Table]:
    """Return the artifacts that a report may show, by ``"stage/file"``."""
    paths = sorted({path for pattern in REPORTED_ARTIFACTS for path in artifacts.glob(f"{pattern}.parquet")})
    return {path.relative_to(artifacts).with_suffix("").as_posix(): _table(path) for path in paths}


def rig_description(config: PipelineConfig) -> str:
    """Return what stands on the bench: the cylinder by bore and stroke, the vessel, the supply."""
    rig = config.to_rig()
    parts = []
    if rig.piston_area_1 is not None:
        bore = format_number(2e3 * math.sqrt(rig.piston_area_1 / math.pi), 3)
        parts.append(f"cylinder ⌀ {bore} mm" + (f" × {format_quantity(rig.stroke, 'm', 3)}" if rig.stroke else ""))
    elif rig.vessel_volume is not None:
        parts.append(f"vessel of {format_quantity(rig.vessel_volume, 'm^3', 3)}")
    if rig.supply_pressure is not None:
        parts.append(f"supply {format_quantity(rig.supply_pressure, 'Pa', 3)}")
    return ", ".join(parts)


def _earlier_models(artifacts: Path) -> dict[str, Any]:
    """Return earlier models and diagnoses on the present data."""
    models, found = history.recorded_models(artifacts / "compare"), history.recorded_models(artifacts / "diagnose")
    data = next((one.answer["data"] for one in models if one.current), None)
    former, found = ([one for one in of if one.answer["data"] == data and not one.current] for of in (models, found))
    first = [EarlierAnswer(read(compare.Answer, one.answer), _table(one.folder / RESIDUALS_FILE)) for one in former[:1]]
    return {
        "history": history.compared_models(artifacts / "compare"),
        "first_comparison": first[0] if first else None,
        "diagnoses": [
            EarlierAnswer(read(diagnose.Answer, one.answer), _table(one.folder / SHAPE_FILE)) for one in found
        ],
    }


def _table(path: Path) -> Table:
    return Table(read_table(path), read_metadata(path).get("units", {}))


def _limits(context: Context) -> dict[str, dict[str, Any]]:
    return {path: limit.model_dump(exclude_none=True) for path, limit in context.config.checks.items()}


def check_result(path: str, limit: Mapping[str, Any], answers: Mapping[str, Mapping[str, Any]], where: str) -> Check:
    """Return what became of one check; one whose path leads nowhere has failed, and says so."""
    wanted = ", ".join(f"{kind} {value}" for kind, value in limit.items())
    try:
        (result,) = evaluate({path: limit}, answers, where)
    except InputError as error:
        return Check(path, wanted, None, str(error))
    return Check(path, wanted, result.value, "" if result.passed else str(result))


def closed_loop_checks(answers: Answers) -> list[Check]:
    """Return the checks of the selected controller: rest, limit cycle, recovery, sine, gate, C against simulation.

    A check without a stated requirement is skipped and says what was found. Empty without a designed controller.

    Args:
        answers: Answers of the stages by name; ``simulate`` and ``design`` are read.

    """
    if not answers.get("design"):
        return []
    design, simulation = answer_of(Design, answers), answer_of(Simulation, answers)
    figures = simulation.closed_loop or design.compare.get(design.requirements["controller"], {})
    checks = [_gate(design.gate)] if design.gate else []
    if figures:
        checks += _figure_checks(figures, design.requirements, design.tolerance_um)
    if simulation.exported_c:
        checks.append(_exported_c(simulation.exported_c))
    return checks


def _figure_checks(figures: Scenarios, requirements: Mapping[str, Any], tolerance_um: float) -> list[Check]:
    tracking = requirements.get("tracking_error")
    limit = None if tracking is None else MICROMETRES_PER_METRE * tracking
    return [
        _limited("rest", worst_value(figures, "steady_um"), tolerance_um, "um"),
        _limited("limit-cycle", worst_value(figures, "cycle_um"), tolerance_um, "um"),
        _recovery(figures, requirements.get("settling_time")),
        _limited("sine", worst_value(figures, "tracking_rms_um"), limit, "um", "tracking_error"),
    ]


def _limited(name: str, value: float | None, limit: float | None, unit: str, key: str = "") -> Check:
    """Return a check of a largest value; skipped without a limit or where no scenario shows the value."""
    path = f"closed-loop.{name}"
    if value is None:
        return Check(path, "", None, skipped="no scenario shows it")
    if limit is None:
        return Check(path, "", value, skipped=f"[design] {key} is not stated; found {format_plain(value, 3)} {unit}")
    wanted = f"max {format_plain(limit, 6)} {unit}"
    failure = f"{path} = {format_plain(value, 3)} {unit} ({wanted}): FAILED"
    return Check(path, wanted, value, "" if value <= limit else failure)


def _recovery(figures: Scenarios, limit: float | None) -> Check:
    """Return the check of the time after which a load is rejected to 50 um; without a stated limit, that it is."""
    path, wanted = "closed-loop.recovery", "finite" if limit is None else f"max {format_plain(limit, 6)} s"
    loaded = [f["recovery_s"] for f in figures.values() if f["peak_um"] is not None]
    if not loaded:
        return Check(path, wanted, None, skipped="no scenario has a load")
    known = [one for one in loaded if one is not None]
    if len(known) < len(loaded):
        return Check(path, wanted, None, f"{path}: a load is never rejected to 50 um ({wanted}): FAILED")
    value = max(known)
    failed = limit is not None and value > limit
    return Check(path, wanted, value, f"{path} = {format_plain(value, 3)} s ({wanted}): FAILED" if failed else "")


def _gate(gate: Gate) -> Check:
    failure = "" if gate.passed else "; ".join(gate.violations) or "a requirement is missed"
    return Check("closed-loop.gate", "equals True", gate.passed, failure)


def _exported_c(found: ReplayCheck) -> Check:
    path, wanted, value = "closed-loop.exported-c", f"max {format_plain(MAX_DIFFERENCE)} V", found.difference_v
    if value is None:
        return Check(path, wanted, None, skipped=found.reason)
    failure = f"{path} = {format_plain(value, 3)} V ({wanted}): FAILED"
    return Check(path, wanted, value, "" if value <= MAX_DIFFERENCE else failure)
