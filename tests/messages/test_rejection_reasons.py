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
def test_chance_is_spoken_of_only_where_chance_decided(reason: str) -> None:
    assert "chance" not in said(reason)
    assert "chance" in said("not-significant")


def test_what_is_named_says_what_it_takes_and_how_it_looks() -> None:
    text = said("supported", ["piston-leak"])
    assert "from 9.40 to 1.05 times the noise on recordings that were not fitted" in text
    assert text.endswith("The pressures creep toward each other.")


@pytest.mark.parametrize("held_out", VALIDATION_PHRASES)
def test_what_the_errors_are_errors_of_is_said(held_out: str) -> None:
    assert VALIDATION_PHRASES[held_out] in said("supported", ["piston-leak"], held_out)


def test_a_twin_says_of_what_it_cannot_be_told() -> None:
    text = said("supported", ["chamber-leak"], indistinguishable_from=["chamber-leak", "heat-transfer"])
    assert "in place of chamber-leak" in text
    assert "heat-transfer" not in text
