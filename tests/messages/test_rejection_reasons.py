"""What is said of a candidate comes from its reason, and from nothing else."""

from __future__ import annotations

from typing import Any, get_args

import pytest

from pneucli.diagnose.candidate import Reason
from pneucli.messages.diagnose import REJECTION_REASONS, VALIDATION_PHRASES, reason_sentence

LEAK: dict[str, Any] = {
    "effect": "piston-leak",
    "title": "Leak across the piston",
    "error_before": 9.4,
    "error_after": 1.05,
    "indistinguishable_from": [],
}


def said(reason: str, missing: list[str] | None = None, held_out: str = "apart", **changes: Any) -> str:
    candidate = LEAK | {"reason": reason, "supported": reason == "supported"} | changes
    return reason_sentence(candidate, missing or [], held_out, "The pressures creep toward each other.")


def test_every_reason_has_a_sentence_of_its_own() -> None:
    assert set(REJECTION_REASONS) == set(get_args(Reason)) - {"supported"}
    assert len(set(REJECTION_REASONS.values())) == len(REJECTION_REASONS)


@pytest.mark.parametrize("reason", sorted(set(get_args(Reason)) - {"supported", "not-significant"}))
def test_chance_is_stated_only_where_it_decided(reason: str) -> None:
    assert "chance" not in said(reason)
    assert "chance" in said("not-significant")


def test_a_named_effect_states_its_reduction_and_appearance() -> None:
    text = said("supported", ["piston-leak"])
    assert "from 9.40 to 1.05 times the noise on recordings that were not fitted" in text
    assert text.endswith("The pressures creep toward each other.")


@pytest.mark.parametrize("held_out", VALIDATION_PHRASES)
def test_the_recordings_of_an_error_are_stated(held_out: str) -> None:
    assert VALIDATION_PHRASES[held_out] in said("supported", ["piston-leak"], held_out)


def test_an_equivalent_names_the_named_effect() -> None:
    text = said("supported", ["chamber-leak"], indistinguishable_from=["chamber-leak", "heat-transfer"])
    assert "in place of chamber-leak" in text
    assert "heat-transfer" not in text
