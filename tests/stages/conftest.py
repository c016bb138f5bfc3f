"""Stages run one after the other in this process, as the runner does it, on a pipeline file or an edit of one."""

import os
import pickle
import shutil
import time
from pathlib import Path
from typing import Any

import pytest

from tests.stages.chain import run_stages

DEMO = Path(__file__).parents[2] / "fixtures" / "demo" / "complete.toml"  # with the effect that pipeline.toml lacks


@pytest.fixture(scope="session")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """Artifacts and answers of ingest, identify and compare on the example with every kind of recording.

    One of the processes among which the tests are shared makes them; each works on a copy of its own.
    """
    out = tmp_path_factory.mktemp("demo")
    if "PYTEST_XDIST_WORKER" not in os.environ:
        return out, run_stages(DEMO, out)
    shared = tmp_path_factory.getbasetemp().parent / "demo"
    try:
        shared.mkdir()
    except FileExistsError:
        _wait_for(shared / "answers.pickle")
    else:
        answers = run_stages(DEMO, shared / "artifacts")
        (shared / "answers.part").write_bytes(pickle.dumps(answers))
        (shared / "answers.part").rename(shared / "answers.pickle")
    shutil.copytree(shared / "artifacts", out, dirs_exist_ok=True)
    return out, pickle.loads((shared / "answers.pickle").read_bytes())


def _wait_for(file: Path, seconds: float = 600.0) -> None:
    end = time.monotonic() + seconds
    while not file.exists():
        if time.monotonic() > end:
            pytest.fail(f"the process that was to make {file} did not")
        time.sleep(0.1)
