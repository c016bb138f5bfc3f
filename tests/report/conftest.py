from __future__ import annotations

import pytest

from pneucli.report import Material, to_html
from tests.report.bench import whole


@pytest.fixture(scope="session")
def material() -> Material:
    return whole()


@pytest.fixture(scope="session")
def page(material: Material) -> str:
    return to_html(material)
