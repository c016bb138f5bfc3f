"""Make one HTML page, its tables as Parquet, a Markdown summary and JUnit XML from the stages' answers and tables."""

from __future__ import annotations

from pneucli.report.page import build_sections, thesis_page, to_html
from pneucli.report.page_elements import section_tables
from pneucli.report.report_data import Check, EarlierAnswer, ReportData, Table
from pneucli.report.summaries import to_junit, to_markdown

__all__ = [
    "Check",
    "EarlierAnswer",
    "ReportData",
    "Table",
    "build_sections",
    "section_tables",
    "thesis_page",
    "to_html",
    "to_junit",
    "to_markdown",
]
