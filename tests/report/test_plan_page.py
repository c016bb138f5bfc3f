"""The page of a plan: drawings that a person can read."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pneucli.plan.rivals import Rival
from pneucli.report.plan_page import Curves, RecordingCurves, plan_page
from pneucli.stages.plan_answer import expected_rows
from tests.messages.test_plan import ANSWER, RECORDING

TIME = 1e-3 * np.arange(3000)


def page(differences: dict[str, Curves]) -> str:
    answer: dict[str, Any] = ANSWER | {"seconds": 8.0, "expected": [], "rivals": [], "manual": [], "refused": []}
    answer |= {"recordings": [RECORDING], "entropy": {"before": 1.0, "after": 0.2}}
    curves = RecordingCurves("plan_1", "a sine", TIME, "x_ref", 0.1 + 0.0 * TIME, {}, differences)
    return plan_page(answer, [curves])


@pytest.mark.parametrize("size", [0.5, 5.0, 500.0])
def test_the_axis_of_the_differences_has_plain_numbers(size: float) -> None:
    made = page({"leak": Curves("p1", size * np.sin(TIME))})
    assert "leak (p1)" in made
    assert "mathdefault" not in made


@pytest.mark.parametrize(("present", "expected"), [(True, 0.8), (False, 0.2)])
def test_the_probability_of_a_rival_is_that_of_its_hypothesis(present: bool, expected: float) -> None:
    effect: Any = type("Effect", (), {"name": "leak"})()
    rival = Rival(effect, present, None, probability=0.8)  # type: ignore[arg-type]
    assert expected_rows([rival], [0.5])[0]["probability_before"] == pytest.approx(expected)
