"""The checks of the pipeline file: limits and values."""

from collections.abc import Sequence

from pneucli.report.page_elements import Cell, Grid, Row, Section
from pneucli.report.report_data import CHECK_TITLES, Check, ReportData

PLACE = 150  # on the page


def section(material: ReportData) -> Section | None:
    """Return the checks as a table; absent where the pipeline file has none."""
    if not material.checks:
        return None
    failed = sum(bool(check.failure) for check in material.checks)
    lead = f"{failed} of {len(material.checks)} checks failed." if failed else "Every check passed."
    part = grid(material.checks, "The limits of [checks] in the pipeline file.")
    return Section("checks", "Checks", lead, (part,), folded=not failed)


def grid(checks: Sequence[Check], caption: str) -> Grid:
    """Return a table of checks: the limit, the value, and whether it passed."""
    tones = ["bad" if check.failure else "good" for check in checks]
    rows: list[Row] = [
        [*check.row[:-1], Cell(check.row[-1], tone=tone)] for check, tone in zip(checks, tones, strict=True)
    ]
    return Grid(caption, CHECK_TITLES, rows)
