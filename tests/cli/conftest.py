"""The commands over toy stages."""

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from pneucli import cli
from pneucli.executors import dask_cluster
from pneucli.executors.engine import ThreadEngine
from pneucli.pipeline.graph import STAGES
from tests.cli.toys import PIPELINE


@dataclass
class Result:
    """What a command printed, and its exit code."""

    code: int
    out: str
    err: str


Command = Callable[..., Result]


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    """A pipeline file with one raw file."""
    (tmp_path / "raw.csv").write_text("t,p\n0,1\n1,2\n")
    file = tmp_path / "bench.toml"
    file.write_text(PIPELINE)
    return file


@pytest.fixture
def pneucli(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Command:
    """The program, run in this process with toy stages in the places of the real ones."""
    for name, stage in list(STAGES.items()):
        monkeypatch.setitem(STAGES, name, replace(stage, package="tests.cli.toys"))
    monkeypatch.setattr(
        dask_cluster, "ProcessEngine", lambda slots, preload: ThreadEngine(1)
    )  # other processes would have the real stages

    def run(*words: object) -> Result:
        monkeypatch.setattr(sys, "argv", ["pneucli", *map(str, words)])
        with pytest.raises(SystemExit) as exit_:
            cli.main()
        return Result(int(exit_.value.code or 0), *capsys.readouterr())

    return run
