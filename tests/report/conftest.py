import pytest

from pneucli.report.page import to_html
from pneucli.report.report_data import ReportData
from tests.report.bench import whole


@pytest.fixture(scope="session")
def material() -> ReportData:
    return whole()


@pytest.fixture(scope="session")
def page(material: ReportData) -> str:
    return to_html(material)
