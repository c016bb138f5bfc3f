"""Stages run one after the other in this process, as the runner does it, on a pipeline file or an edit of one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.stages.chain import run_stages

DEMO = Path(__file__).parents[2] / "fixtures" / "demo" / "complete.toml"  # with the effect that pipeline.toml lacks


@pytest.fixture(scope="session")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """Artifacts and answers of ingest, identify and compare on the example with every kind of recording."""
    out = tmp_path_factory.mktemp("demo")
    return out, run_stages(DEMO, out)
