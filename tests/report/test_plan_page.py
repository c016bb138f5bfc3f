"""The page of a plan: drawings that a person can read, and where each rival shows most."""

from typing import Any

import numpy as np
import pytest

from pneucli.figure import read
from pneucli.messages.plan import Answer
from pneucli.plan.bench import Outcome
from pneucli.plan.power import Difference, Prediction
from pneucli.report.plan_page import plan_page
from tests.messages.stored_calls import stored

RECORDING, ANSWER = (stored("plan")["answers"][f"answer {k}"] for k in (1, 2))
TIME = 1e-3 * np.arange(3000)


def page(differences: dict[str, Difference], **more: Any) -> str:
    answer: dict[str, Any] = ANSWER | {"seconds": 8.0, "expected": [], "rivals": [], "manual": [], "refused": []}
    answer |= {"recordings": [RECORDING]} | more
    readings = {"x_ref": 0.1 + 0.0 * TIME, "x": 0.1 + 0.0 * TIME, "p1": 3e5 + TIME}
    outcome = Outcome(TIME, readings, readings["p1"], readings["p1"], readings["x"], 0.0 * TIME)
    return plan_page(
        read(Answer, answer), [Prediction(outcome, np.zeros((0, 0)), differences)] * len(answer["recordings"])
    )


@pytest.mark.parametrize("size", [0.5, 5.0, 500.0])
def test_the_axis_of_the_differences_has_plain_numbers(size: float) -> None:
    made = page({"leak": Difference("p1", size * np.sin(TIME))})
    assert "leak (p1)" in made
    assert "mathdefault" not in made


def test_each_rival_has_the_recording_that_shows_it_most() -> None:
    expected = [
        {"effect": "leak", "rival": "without leak", "probability_before": 0.2, "power": 0.9},
        {"effect": "lag", "rival": "lag", "probability_before": None, "power": 0.0},  # no bench shows it
    ]
    recordings = [
        RECORDING | {"name": f"plan_{i}", "times_noise": {"leak": size}} for i, size in ((1, 2.0), (2, 7.5), (3, 1.0))
    ]
    made = page({}, rivals=[{"name": "best model"}], expected=expected, recordings=recordings)
    row = made[made.index("without leak") :]
    assert [row.index(text) for text in ("20 %", "90 %", "7.5", "plan_2")] == sorted(
        row.index(text) for text in ("20 %", "90 %", "7.5", "plan_2")
    )
    assert "1 of 2" in made
