from __future__ import annotations

import pytest

from pneucli.report import ReportData, to_html
from tests.report.bench import whole


@pytest.fixture(scope="session")
def material() -> ReportData:
    return whole()


@pytest.fixture(scope="session")
def page(material: ReportData) -> str:
    return to_html(material)
