"""The model's parameters with their intervals."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pneucli.messages.formatting import format_interval, format_number
from pneucli.messages.identify import FRICTION_COLUMNS, friction_lines, friction_rows, leak_lines
from pneucli.report.page_elements import Cell, Grid, Note, Part, Row, Section, warning_notes
from pneucli.report.report_data import ReportData
from pneucli.report.sections.friction import friction_warnings

PLACE = 50  # on the page


def section(material: ReportData) -> Section | None:
    """Return the parameters of the model; absent where none was identified."""
    model = material.answer("identify").get("model")
    if not model or not model["parameters"]:
        return None
    rows = [_row(name, p) for name, p in model["parameters"].items()]
    effects = ", ".join(model["effects"])
    lead = f"The base model with {effects}." if effects else "The base model without additional effects."
    head = ("parameter", "value, 95 % interval", "half width")
    grid = Grid("Identified parameters; a wide bar is a wide interval.", head, rows)
    warnings = [note for note in warning_notes(material, "identify") if note not in friction_warnings(material)]
    parts: list[Part] = [*warnings, grid, *_summary(material.answer("identify"))]
    return Section("parameters", "Parameters", lead, parts, folded=True, printed=True)


def _summary(answer: Mapping[str, Any]) -> Iterator[Part]:
    """Yield friction and break-away by recording, growth with pressure, repeatability, and leaks."""
    friction = answer.get("friction", {})
    if rows := friction_rows(friction):
        yield Grid("Friction by recording; in brackets the number of break-aways.", FRICTION_COLUMNS, rows)
    yield from (Note(f"{line}.") for line in (*friction_lines(friction), *leak_lines(answer.get("leaks", {}))))


def _row(name: str, parameter: Mapping[str, Any]) -> Row:
    value, unit, (low, high) = parameter["value"], parameter["unit"], parameter["ci95"]
    relative = abs(high - low) / 2 / abs(value) if value and None not in (low, high) else None
    return [
        name,
        Cell(format_interval(value, unit, (low, high))),
        Cell("–" if relative is None else f"{format_number(100 * relative, 2)} %", bar=relative),
    ]
