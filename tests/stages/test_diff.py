"""Two runs side by side."""

from __future__ import annotations

import pytest

from pneucli.figure import read
from pneucli.messages.compare import Answer
from pneucli.stages.diff import Difference, ErrorChange, RunAnswers, difference


def run(effects: list[str], error: float, data: str = "d", **parameters: tuple[float, float]) -> RunAnswers:
    """A run with one recording; a parameter is its value and half of its interval."""
    found = {
        name.replace("_", "."): {"value": value, "unit": "N", "ci95": [value - half, value + half]}
        for name, (value, half) in parameters.items()
    }
    channel = {"recording": "slow", "use": "test", "channel": "x", "ratio_to_noise": error}
    compare = {
        "pipeline": "bench",
        "model": {"effects": effects, "parameters": found},
        "error": {"train": None, "test": error},
        "data": data,
        "channels": [channel],
    }
    return RunAnswers("bench.toml", read(Answer, compare), None)


def shown(answer: Difference, *, verbose: bool = False) -> str:
    return " ".join("\n".join(answer.lines("bench.toml", verbose)).split())


def test_effects_and_errors_of_both_are_told() -> None:
    answer = difference(run(["stribeck"], 9.0), run(["piston-leak"], 1.1))
    assert answer.effects == {"only_a": ["stribeck"], "only_b": ["piston-leak"]}
    assert answer.recordings == [ErrorChange("slow", "test", 9.0, 1.1)]
    assert "only A: stribeck; only B: piston-leak" in shown(answer)
    assert "9.00 → 1.10 × noise on test recordings" in shown(answer)


def test_parameters_beyond_their_intervals_come_first_and_alone_are_shown() -> None:
    a = run([], 1.0, friction_coulomb=(10.0, 3.0), friction_viscous=(50.0, 1.0))
    b = run([], 1.0, friction_coulomb=(14.0, 4.0), friction_viscous=(60.0, 1.0))
    answer = difference(a, b)
    assert [(row.name, row.beyond) for row in answer.parameters] == [
        ("friction.viscous", True),
        ("friction.coulomb", False),
    ]
    assert answer.parameters[1].difference == pytest.approx(4.0)
    assert answer.parameters[1].ci95 == pytest.approx([-1.0, 9.0])
    assert answer.parameters[1].distance == pytest.approx(0.8)
    assert "1 of 2 parameters differ" in shown(answer)
    assert "friction.coulomb" not in shown(answer)
    assert "friction.coulomb" in shown(answer, verbose=True)


def test_a_parameter_that_one_model_lacks_is_no_difference() -> None:
    (row,) = difference(run([], 1.0), run([], 1.0, leak_area=(1.0, 0.1))).parameters
    assert (row.a, row.beyond, row.distance) == (None, None, None)


def test_errors_on_other_recordings_are_said_not_to_compare() -> None:
    answer = difference(run([], 9.0, "monday"), run([], 1.1, "tuesday"))
    assert not answer.same_data
    assert "do not compare" in shown(answer)
    assert "do not compare" not in shown(difference(run([], 9.0), run([], 1.1)))
