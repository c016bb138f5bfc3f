"""Rivals: what a diagnosis names with doubt, does not tell from a name, or refused for want of better recordings."""

from __future__ import annotations

from typing import Any

import pytest

from pneucli.plan.rivals import DECIDED_PROBABILITY, MAX_RIVALS, MIN_PRIOR_ODDS, refused_effects, rivals_of_diagnosis


def entry(effect: str, reason: str, confidence: float = 0.003, **properties: Any) -> dict[str, Any]:
    known = {"effect": effect, "reason": reason, "confidence_alone": confidence, "supported": False}
    return known | {"parameters": {"size": {"value": 1.0}}} | properties


def test_refused_effects_that_better_recordings_may_show_are_in_question_the_most_probable_first() -> None:
    found = refused_effects(
        [
            entry("a leak", "vanishes"),
            entry("a lag", "not-significant"),
            entry("a scale", "raises-error", 0.5),
            entry("a mass", "at-bound", 0.4),
            entry("an offset", "contradicted-by-reading", 0.4),
            entry("a cushion", "not-promising", parameters={}),
            entry("a droop", "supported", 0.9, supported=True),
        ]
    )
    assert found == [(pytest.approx(1.0), "a scale"), (MIN_PRIOR_ODDS, "a lag"), (MIN_PRIOR_ODDS, "a leak")]


def named(effect: str, confidence: float, *equivalents: str) -> dict[str, Any]:
    known = {"confidence": confidence, "indistinguishable_from": list(equivalents), "supported": True}
    return entry(effect, "supported", confidence) | known


def answer(*candidates: dict[str, Any]) -> dict[str, Any]:
    missing = [c["effect"] for c in candidates if c["supported"]]
    return {"missing": missing, "candidates": list(candidates)}


def test_a_named_effect_is_in_question_as_far_as_it_is_doubtful_and_its_equivalents_with_it() -> None:
    others = entry("mass", "needless", 0.2), entry("droop", "needless", 0.6)
    told = answer(named("leak", 0.6, "droop"), named("lag", DECIDED_PROBABILITY), *others)
    found = rivals_of_diagnosis(told, ["leak", "lag"])
    assert [r.name for r in found] == ["droop in place of leak", "without leak", "mass"]
    assert [r.own_probability for r in found] == [0.6, pytest.approx(0.4), 0.2]


def test_the_most_probable_rivals_are_kept() -> None:
    many = [entry(f"effect {i}", "needless", 0.01 * i) for i in range(10, 30)]
    assert [r.effect for r in rivals_of_diagnosis(answer(*many), [])] == [f"effect {i}" for i in range(29, 21, -1)]
    assert MAX_RIVALS == 8


def test_effects_that_are_asked_for_are_in_question_whatever_the_diagnosis_says() -> None:
    told = answer(named("leak", 0.99), entry("mass", "at-bound", 0.2), entry("lag", "needless", 0.3))
    found = rivals_of_diagnosis(told, ["leak"], ["leak", "mass", "spring"])
    assert [(r.effect, r.present, r.probability) for r in found] == [
        ("leak", False, 0.99),
        ("mass", True, 0.2),
        ("spring", True, None),
    ]
