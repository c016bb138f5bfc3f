"""The commands over toy stages."""

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from pneucli import cli
from pneucli.executors import dask_cluster
from pneucli.executors.engine import ThreadEngine
from pneucli.pipeline.graph import STAGES
from tests.cli.toys import PIPELINE

FRICTION = """
[pipeline]
name = "slow"
[signals]
time = { column = "t", unit = "s" }
force = { column = "F", unit = "N" }
x = { column = "X", unit = "mm" }
[[recordings]]
name = "strokes"
file = "strokes.csv"
experiment = "friction"
use = "train"
chamber_2 = "open"
"""


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
def strokes(tmp_path: Path) -> Path:
    """A pipeline of one slow to-and-fro motion, with its raw file."""
    time = 0.01 * np.arange(400)
    rows = np.column_stack([time, 30.0 * np.sign(np.cos(time)), 50.0 * np.sin(time), 2.0 + 0.1 * np.sin(time)])
    np.savetxt(tmp_path / "strokes.csv", rows, delimiter=",", header="t,F,X,P", comments="", fmt="%.6f")
    file = tmp_path / "slow.toml"
    file.write_text(FRICTION)
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
