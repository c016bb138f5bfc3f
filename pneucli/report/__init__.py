"""The report: tables and answers of the stages in; one HTML page, a Markdown summary and JUnit XML out."""

from __future__ import annotations

from pneucli.report.junit import to_junit
from pneucli.report.markdown_summary import to_markdown
from pneucli.report.page import to_html
from pneucli.report.report_data import Check, EarlierAnswer, ReportData, Table

__all__ = ["Check", "EarlierAnswer", "ReportData", "Table", "to_html", "to_junit", "to_markdown"]
