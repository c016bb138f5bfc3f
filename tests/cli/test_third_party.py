"""A package adds a command by an entry point; the program itself has one file a command."""

from __future__ import annotations

import json
import os
import pkgutil
import subprocess
import sys
from pathlib import Path

from pneucli.cli import commands
from pneucli.cli.program import build

PACKAGE = Path(__file__).parents[1] / "third_party"


def pneucli(*words: str) -> subprocess.CompletedProcess[str]:
    """The program beside that package."""
    environment = {**os.environ, "PYTHONPATH": str(PACKAGE)}
    return subprocess.run(
        [sys.executable, "-m", "pneucli", *words],
        env=environment, capture_output=True, text=True, encoding="utf-8", check=False,
    )  # fmt: skip


def test_each_file_of_the_folder_is_the_command_of_its_name_in_the_order_of_their_places() -> None:
    files = {one.name: __import__(f"{commands.__name__}.{one.name}", fromlist=["COMMAND"]).COMMAND
             for one in pkgutil.iter_modules(commands.__path__)}  # fmt: skip
    listed = [one.name for one in build().registered_commands]
    assert listed == sorted(files, key=lambda name: files[name].place)
    assert len({one.place for one in files.values()}) == len(files)


def test_a_command_of_another_package_runs_and_is_listed_last() -> None:
    ran = pneucli("greet", "axis-7.toml", "--json")
    assert (ran.returncode, json.loads(ran.stdout)) == (0, {"schema": "greeting/1", "pipeline": "axis-7.toml"})
    last = pneucli("--help").stdout.partition("  explain ")[2]
    assert "\n  greet     Says good morning to a pipeline.\n" in last
    assert "Example: pneucli greet axis-7/pipeline.toml" in pneucli("greet", "--help").stdout


def test_a_command_that_cannot_be_loaded_is_said_and_stops_no_other() -> None:
    ran = pneucli("greet", "axis-7.toml")
    assert (ran.returncode, ran.stdout) == (0, "good morning, axis-7\n")
    assert "torn (pneucli_torn:COMMAND) cannot be loaded: ModuleNotFoundError" in ran.stderr
    assert "torn" not in pneucli("explain", "E042").stderr  # a command of this program asks no other package


LAW = """
import numpy as np
from pneucli.controller import layout as at
from pneucli.controller.laws import LAWS
from pneucli.design.bandwidths import choose_bandwidths
from pneucli.design.control_laws import controller_for
from pneucli.design.design_data import DesignData
from pneucli.export import c_source, structured_text
from tests.design import axis

best, wanted = axis.controller(), axis.REQUIREMENTS
data = DesignData(best, wanted, choose_bandwidths(axis.model(), wanted, best.values), surface_slope=1.0)
made = controller_for("proportional", data)
c, s = made.vector(), np.zeros(at.L_STATES)
for _ in range(3):
    LAWS["proportional"].step(0.101, 0.1, 3e5, 3e5, s, c)
print(list(LAWS)[-1], made.own[1], s[at.S_FORCE] > 0.0)
print("proportional_step(" in c_source.source(made, "axis"))
print("pneucli_proportional_step" in structured_text.source(made, "axis"))
"""


def test_a_law_of_another_package_is_designed_sampled_and_exported() -> None:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(PACKAGE), str(PACKAGE.parents[1])])}
    ran = subprocess.run(
        [sys.executable, "-c", LAW],
        env=environment, capture_output=True, text=True, encoding="utf-8", check=False,
    )  # fmt: skip
    assert ran.stdout.splitlines() == ["proportional 1000.0 True", "True", "True"], ran.stderr
