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
