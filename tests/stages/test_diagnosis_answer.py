"""Which experiment an answer proposes."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from pneucli.diagnose.candidate import Decision
from pneucli.stages.diagnosis_answer import proposed_experiment
from tests.diagnose.candidates import candidate, diagnosis_data


def dropped(effect: str, probability: float) -> Any:
    tried = candidate(effect)
    return SimpleNamespace(decision=Decision(tried.effect, "explained-by-unknown", tried), probability=probability)


@pytest.mark.parametrize(
    ("probabilities", "tested"),
    [((0.45, 0.35), ["stribeck", "constant-force"]), ((0.45, 0.05), ["stribeck"]), ((0.2, 0.1), [])],
)
def test_with_a_discrepancy_the_effects_that_are_about_as_probable_as_not_are_tested(
    probabilities: tuple[float, float], tested: list[str]
) -> None:
    refused = [dropped("constant-force", probabilities[1]), dropped("stribeck", probabilities[0])]
    rest = SimpleNamespace(channel="force", subsystem="mechanics", variable="p1")
    found: Any = SimpleNamespace(missing=(), equivalents={}, path=SimpleNamespace(refused=refused), unexplained=rest)
    proposed = proposed_experiment(diagnosis_data(), found)
    assert proposed is not None
    assert [part.partition(":")[0] for part in proposed.split("To test ")[1:]] == tested
    assert "The discrepancy is in force (mechanics)." in proposed
