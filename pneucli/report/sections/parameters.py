"""The model's parameters with their intervals."""

import math

from pneucli.figure import Figure
from pneucli.messages.formatting import format_figure, format_number
from pneucli.messages.identify import FRICTION_COLUMNS, Answer
from pneucli.report.page_elements import Cell, Grid, Note, Part, Row, Section, warning_notes
from pneucli.report.report_data import ReportData
from pneucli.report.sections.friction import friction_warnings

PLACE = 50  # on the page


def section(material: ReportData) -> Section | None:
    """Return the parameters of the model; absent where none was identified."""
    answer = material.read(Answer)
    if not answer.model.parameters:
        return None
    rows = [_row(name, p) for name, p in answer.model.parameters.items()]
    effects = ", ".join(answer.model.effects)
    lead = f"The base model with {effects}." if effects else "The base model without additional effects."
    head = ("parameter", "value, 95 % interval", "half width")
    grid = Grid("Identified parameters; a wide bar is a wide interval.", head, rows)
    warnings = [note for note in warning_notes(material, "identify") if note not in friction_warnings(material)]
    parts: list[Part] = [*warnings, grid]
    if answer.friction and (by_recording := answer.friction.rows):
        caption = "Friction by recording; in brackets the number of break-aways."
        parts.append(Grid(caption, FRICTION_COLUMNS, by_recording))
    sentences = (*(answer.friction.lines if answer.friction else ()), *(answer.leaks.lines if answer.leaks else ()))
    parts += [Note(f"{line}.") for line in sentences]
    return Section("parameters", "Parameters", lead, parts, folded=True, printed=True)


def _row(name: str, one: Figure) -> Row:
    width = abs(one.high - one.low)
    relative = width / 2 / abs(one.value) if one.value and math.isfinite(width) else None
    share = "–" if relative is None else f"{format_number(100 * relative, 2)} %"
    return [name, format_figure(one), Cell(share, bar=relative)]
