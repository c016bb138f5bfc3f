"""The verdict and the warnings of a diagnosis, in words."""

from __future__ import annotations

import math

import pytest

from pneucli.messages.verdict import detection_limit_sentence, location_phrase, verdict_explanation, warning_text

STRIBECK = ("Stribeck friction", "stribeck")


def test_missing_effects_are_named_with_the_error_and_their_equivalents() -> None:
    text = verdict_explanation("missing-effect", [STRIBECK], (9.0, 1.04), ["presliding"])
    assert text == (
        "The model lacks stribeck friction (stribeck): with it the error goes from 9 to 1.04 times the noise. "
        "These recordings cannot distinguish it from presliding."
    )
    assert "with them" in verdict_explanation("missing-effect", [STRIBECK, STRIBECK], (9.0, None))


def test_an_adequate_model_states_its_error() -> None:
    assert "(error 1.02 times the noise)" in verdict_explanation("adequate", [], (1.02, 1.02))


def test_an_unexplained_residual_is_described_and_helpful_effects_are_named() -> None:
    rest = {"character": "a force", "channel": "force", "times_noise": 5.0, "subsystem": "mechanics"}
    text = verdict_explanation("unexplained", [STRIBECK], (9.0, 5.0), unexplained=rest)
    assert "force errs by 5.0 times its noise (mechanics)." in text
    assert text.endswith("These effects reduce the error: stribeck friction (stribeck).")


@pytest.mark.parametrize(
    ("null", "limit"), [(0.0, "above 2 N"), (1.0, "from a difference of 2 N"), (None, "at 2 N"), (math.inf, "at 2 N")]
)
def test_a_detection_limit_counts_from_the_null(null: float | None, limit: str) -> None:
    assert limit in detection_limit_sentence("A force", "force", 2.0, "N", null)
    assert "cannot detect it" in detection_limit_sentence("A force", "force", None, "N", null)


def test_a_detection_limit_states_where_the_effect_acts() -> None:
    where = [location_phrase("length", 0.08, "m")]
    assert "(damping; length 0.08 m)" in detection_limit_sentence("A cushion", "damping", 8.0, "N s/m", 0.0, where)


def test_warnings_state_their_numbers() -> None:
    assert warning_text("subsampled", used=10, samples=20).startswith("10 of 20 samples")
