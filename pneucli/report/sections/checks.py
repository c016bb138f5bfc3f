"""The checks of the pipeline file: limits and values."""

from __future__ import annotations

from collections.abc import Sequence

from pneucli.messages.formatting import format_number
from pneucli.report.page_elements import Cell, Grid, Row, Section
from pneucli.report.report_data import Check, ReportData

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
    return Grid(caption, ("check", "wanted", "found", ""), [_row(check) for check in checks])


def _row(check: Check) -> Row:
    value = format_number(check.value) if isinstance(check.value, float) else str(check.value)
    found = "nothing there" if check.value is None else value
    verdict = Cell("failed", tone="bad", numeric=False) if check.failure else Cell("passed", tone="good", numeric=False)
    return [check.path, check.wanted, found, verdict]
