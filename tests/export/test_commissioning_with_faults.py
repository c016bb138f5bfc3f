"""The exported C commissions itself on the exam's rig while something is wrong: it names it and changes nothing."""

import shutil
from functools import cache
from pathlib import Path

import pytest

from benchmarks.robust import FAULTS, commissioned_with, designed_rig
from pneucli.closed_loop.commissioning import SHUT
from pneucli.controller.parameters import Controller
from pneucli.exam.rig.parameters import Parameters
from pneucli.export.export_files import write_c_source

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
BY_ARRANGEMENT = {"valve stuck in its middle", "valve stuck open", "valve reversed", "supply lost"}
MAX_ERROR = 50e-6  # m, once the fault is gone


@cache
def rig(condition: str) -> tuple[Parameters, Controller]:
    return designed_rig(3, condition)


OTHERS = [(name, condition) for name in sorted(BY_ARRANGEMENT) for condition in ("5/3", "two-valves")]


@pytest.mark.parametrize(
    ("name", "condition"),
    [*((name, "usual") for name in FAULTS), *(pytest.param(*one, marks=[pytest.mark.slow]) for one in OTHERS)],
)
def test_a_fault_is_named_within_the_limits_and_the_gains_stay(name: str, condition: str, tmp_path: Path) -> None:
    par, made = rig(condition)
    write_c_source(tmp_path, made, "faults")
    found = commissioned_with(FAULTS[name], par, made, tmp_path)
    assert found.state in FAULTS[name].states
    assert found.unchanged == (found.state in SHUT)
    assert found.travel < 1.0
    assert found.pressure < 1.0
    assert found.error < MAX_ERROR
