"""The commands over toy stages."""

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from pneucli import cli, executors
from pneucli.executors import ThreadEngine
from pneucli.pipeline.graph import STAGES
from tests.cli.toys import PIPELINE
from tests.identify.test_leak_test import decay

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


RIG = """
[pipeline]
name = "tank"
[rig.vessel]
volume = "3 l"
[signals]
time = { column = "t [s]", unit = "s" }
p1 = { column = "p1 [bar(a)]", unit = "bar" }
[[recordings]]
file = "decay.csv"
experiment = "valve"
use = "train"
valve = "shut"
"""


@pytest.fixture
def tanks(tmp_path: Path) -> Path:
    """A vessel that leaks 500 Pa/s, one that is at ambient, and one that a valve fills and vents in steps."""
    time, pressure = decay(500.0, "orifice", seconds=60.0, noise=100.0)
    flat = 1.013 + 1e-3 * np.random.default_rng(4).standard_normal(time.size)
    for name, p in (("decay.csv", pressure / 1e5), ("flat.csv", flat)):
        np.savetxt(tmp_path / name, np.c_[time, p], "%.5f", ",", header="t [s],p1 [bar(a)]", comments="")
    u = np.repeat([5.0, -4.0, 6.0, -8.0], 300)
    rows = zip(np.arange(1200) / 100, u, 1.013 + 4.0 * np.clip(np.cumsum(u) / 600, 0.0, 1.0), strict=True)
    text = "".join(f"{t:.2f},{one:g},{p:.5f},ok\n" for t, one, p in rows)
    (tmp_path / "a tank.csv").write_text(f"t [s],u [V],p1 [bar(a)],state\n{text}", encoding="utf-8")
    (tmp_path / "zorps.csv").write_text(f"t [s],u [V],p1 [zorps],state\n{text}", encoding="utf-8")
    (tmp_path / "none.csv").write_text("nothing\nhere\n", encoding="utf-8")
    (tmp_path / "rig.toml").write_text(RIG, encoding="utf-8")
    return tmp_path


@pytest.fixture
def pneucli(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Command:
    """The program, run in this process with toy stages in the places of the real ones."""
    for name, stage in list(STAGES.items()):
        monkeypatch.setitem(STAGES, name, replace(stage, package="tests.cli.toys"))
    monkeypatch.setattr(
        executors, "ProcessEngine", lambda slots, preload: ThreadEngine(1)
    )  # other processes would have the real stages

    def run(*words: object) -> Result:
        monkeypatch.setattr(sys, "argv", ["pneucli", *map(str, words)])
        with pytest.raises(SystemExit) as exit_:
            cli.main()
        return Result(int(exit_.value.code or 0), *capsys.readouterr())

    return run
