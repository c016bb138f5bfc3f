"""Make one HTML page, its tables as Parquet, a Markdown summary and JUnit XML from the stages' answers and tables."""

from __future__ import annotations

from pneucli.report.junit import to_junit
from pneucli.report.markdown_summary import to_markdown
from pneucli.report.page import build_sections, thesis_page, to_html
from pneucli.report.report_data import Check, EarlierAnswer, ReportData, Table
from pneucli.report.section_tables import section_tables

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
