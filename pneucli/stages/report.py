"""``report``: one HTML file, a Markdown summary, JUnit XML."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pneucli.config import PipelineConfig
from pneucli.errors import InputError
from pneucli.io.artifacts import Provenance, atomic_path, read_metadata, read_table, write_table
from pneucli.messages.formatting import format_number, format_quantity
from pneucli.pipeline.checks import evaluate
from pneucli.pipeline.context import Context
from pneucli.report import (
    Check,
    EarlierAnswer,
    ReportData,
    Table,
    build_sections,
    section_tables,
    thesis_page,
    to_html,
    to_junit,
    to_markdown,
)
from pneucli.report.overview import overview
from pneucli.report.page_elements import Section
from pneucli.report.thesis import SECTIONS as THESIS_SECTIONS
from pneucli.stages import history
from pneucli.stages.closed_loop_checks import closed_loop_checks
from pneucli.stages.compare import RESIDUALS_FILE
from pneucli.stages.tables.diagnosis import SHAPE_FILE
from pneucli.version import __version__

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
        with atomic_path(context.out / name) as path:
            path.write_text(text, encoding="utf-8")
    return {
        "schema": "pneucli/report/1",
        "pipeline": context.config.name,
        "files": [*texts],
        "tables": tables_written,
        "bytes": len(page.encode()),
        "checks": [{"path": c.path, "passed": not c.failure} for c in checks],
        "default_checks": [
            {"path": c.path, "passed": None if c.skipped else not c.failure, "value": c.value} for c in defaults
        ],
    }


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
    compared = history.recorded_models(artifacts / "compare")
    data = next((one.answer["data"] for one in compared if one.current), None)
    former = [one for one in compared if one.answer["data"] == data and not one.current]
    first = EarlierAnswer(former[0].answer, _table(former[0].folder / RESIDUALS_FILE)) if former else None
    diagnoses = [
        EarlierAnswer(one.answer, _table(one.folder / SHAPE_FILE))
        for one in history.recorded_models(artifacts / "diagnose")
        if one.answer["data"] == data and not one.current
    ]
    return {"history": history.history_answer(artifacts / "compare"), "first_comparison": first, "diagnoses": diagnoses}


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
