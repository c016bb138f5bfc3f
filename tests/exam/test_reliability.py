"""Stated probabilities against the truth: sets of twins count once, and every effect that was fitted counts."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from pneucli.exam.graded_case import GradedCase
from pneucli.exam.grading import reliability


def stating(*stated: tuple[float, bool]) -> Any:
    return SimpleNamespace(stated_probabilities=list(stated))


def candidate(effect: str, confidence: float | None, *twins: str, fitted: bool = True) -> dict[str, Any]:
    parameters = {"size": {"value": 1.0}} if fitted else {}
    return {"effect": effect, "confidence": confidence, "indistinguishable_from": list(twins), "parameters": parameters}


def graded(hidden: list[str], missing: list[str], *candidates: dict[str, Any]) -> GradedCase:
    truth = {"hidden": {name: {} for name in hidden}, "outside_the_catalogue": None, "verdict": "missing-effect"}
    return GradedCase("case", truth, {"verdict": "missing-effect", "missing": missing, "candidates": list(candidates)})


def test_scores_are_the_mean_square_and_the_mean_logarithm() -> None:
    found = reliability([stating((0.8, True), (0.6, False)), stating((0.0, True))])
    assert found is not None
    assert found.of == 3
    assert found.brier == pytest.approx((0.04 + 0.36 + 1.0) / 3)
    assert found.log == pytest.approx(-(math.log(0.8) + math.log(0.4) + math.log(1e-3)) / 3)  # no surer than 1e-3


def test_probabilities_are_gathered_by_what_was_stated() -> None:
    """A bin has its lower edge; 1 is in the last one. Empty bins are left out."""
    found = reliability([stating((0.5, True), (0.68, False), (0.7, True), (1.0, True), (1.3, True))])
    assert found is not None
    assert [(b.from_, b.to, b.there, b.of) for b in found.bins] == [
        (0.5, 0.7, 1, 2), (0.7, 0.9, 1, 1), (0.9, 1.0, 2, 2),
    ]  # fmt: skip
    assert [b.stated for b in found.bins] == pytest.approx([0.59, 0.7, 1.0])
    assert "| 0.5 to 0.7 | 0.59 | 1 | 2 |" in found.table


def test_without_probabilities_there_is_no_reliability() -> None:
    assert reliability([stating()]) is None


def test_the_probability_of_a_set_counts_as_true_if_one_member_is() -> None:
    """The twin of a named effect has the set's probability; it is not counted again."""
    one = graded(
        ["twin"], ["named"],
        candidate("named", 0.9, "twin"), candidate("twin", 0.9, "named"), candidate("refused", 0.2),
        candidate("screened", 0.01, fitted=False), candidate("silent", None),
    )  # fmt: skip
    assert one.stated_probabilities == [(0.9, True), (0.2, False)]


def test_the_probability_of_a_refused_effect_counts_only_for_itself() -> None:
    one = graded(["other"], [], candidate("refused", 0.4, "other"), candidate("other", 0.1))
    assert (0.4, True) not in one.stated_probabilities


@pytest.mark.parametrize(("confidence", "found"), [(0.9, [True, False]), (0.89, [False, False]), (None, [False] * 2)])
def test_a_true_effect_is_confidently_found_if_it_or_an_equivalent_is_named(
    confidence: float | None, found: list[bool]
) -> None:
    one = graded(["a", "b"], ["c"], candidate("c", confidence, "a"))
    assert one.confident_detections == found


@pytest.mark.parametrize(
    ("part", "subsystem", "variable", "over", "right"),
    [
        ("force", "mechanics: friction", "x", [], True),
        ("force", "gas, valve and their sensors", "x", [], False),
        ("flow", "gas, valve and their sensors", None, ["p1", "x"], True),  # told among what remains
        ("force", "mechanics: friction", "v", ["p1"], False),
        ("sensor", "the complete simulation", "x", [], True),
        (None, None, None, [], True),  # a truth that does not say where it is
    ],
)
def test_a_disturbance_is_located_by_subsystem_and_signal(
    part: str | None, subsystem: str | None, variable: str | None, over: list[str], *, right: bool
) -> None:
    truth = {"hidden": {}, "outside_the_catalogue": "a stranger", "verdict": "unexplained", "part": part, "over": "x"}
    about = {"subsystem": subsystem, "variable": variable}
    said = {
        "verdict": "unexplained", "missing": [], "unexplained": about, "discrepancy": [{"over": o} for o in over],
    }  # fmt: skip
    assert GradedCase("case", truth, said).verdict_is_correct == right
    assert not GradedCase("case", truth, said | {"verdict": "adequate"}).verdict_is_correct
