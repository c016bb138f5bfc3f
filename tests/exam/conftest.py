"""The exam's rig as plain Python, without waiting for a compiler, and laboratories that record for less time."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from pneucli.exam.laboratory import RecordingPlan
from pneucli.exam.recording_programme import RecordingProgramme
from pneucli.exam.rig import gas, kernel, simulation
from pneucli.exam.rig.excitations import MotionMachine, SteadyRows
from pneucli.exam.rig.simulation import Excitation


@pytest.fixture
def plain(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """All functions of the kernel and of its loop, not compiled; they call each other uncompiled too."""
    for module in (gas, kernel, simulation):
        for name, value in list(vars(module).items()):
            if hasattr(value, "py_func"):
                monkeypatch.setattr(module, name, value.py_func)
    return SimpleNamespace(**{**vars(gas), **vars(kernel), **vars(simulation)})


@pytest.fixture
def a_quarter(monkeypatch: pytest.MonkeyPatch) -> None:
    """Laboratories that record for a quarter of the time: what they write of each sample is the same."""
    whole = RecordingProgramme.plans

    def plans(programme: RecordingProgramme, kind: str) -> list[RecordingPlan]:
        return [replace(one, excitation=first_quarter(one.excitation)) for one in whole(programme, kind)]

    monkeypatch.setattr(RecordingProgramme, "plans", plans)


def first_quarter(one: Excitation | MotionMachine | SteadyRows) -> Excitation | MotionMachine | SteadyRows:
    if not isinstance(one, Excitation):
        return one
    kept = one.command.size // 4
    return replace(one, command=one.command[:kept], imposed=one.imposed[:kept])
