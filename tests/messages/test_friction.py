"""Sentences about identified friction."""

from __future__ import annotations

from typing import Any, get_args

import pytest

from pneucli.identify.friction.warnings import Kind
from pneucli.messages.friction import PLAIN, WORDED, friction_warning

RATIO = "model A leaves 1.6 times the sensors' noise of these forces: "


def test_every_kind_of_warning_has_a_sentence() -> None:
    assert set(get_args(Kind)) == set(PLAIN) | set(WORDED)


@pytest.mark.parametrize(
    ("kind", "values", "sentence"),
    [
        ("dry-friction-not-significant", {}, "dry friction is not significantly above zero"),
        (
            "models-missing",
            {"models": ["D", "E", "F"], "samples": {"accelerating": 700, "slowing": 12}},
            "no model D, E, F: too few moving samples (700 accelerating, 12 slowing)",
        ),
        (
            "force-offset",
            {"force": 3.21},
            "a constant force of 3.21 N acts in addition to friction "
            "(or friction differs by direction, or a sensor or an area is wrong)",
        ),
        (
            "misfit",
            {"ratio": 1.56, "unmodelled": (), "better": []},
            f"{RATIO}neither A, a function of velocity alone, nor the pipeline's effects describe it; if D, E or "
            "F leave less, friction differs between acceleration and deceleration; else run pneucli diagnose",
        ),
        (
            "misfit",
            {"ratio": 1.56, "unmodelled": ("hysteresis", "position"), "better": []},
            f"{RATIO}A, a function of velocity alone, cannot represent hysteresis, position of the pipeline's model; "
            "none of A to F can",
        ),
        (
            "misfit",
            {"ratio": 1.56, "unmodelled": ("hysteresis",), "better": ["D", "E"]},
            f"{RATIO}A, a function of velocity alone, cannot represent hysteresis of the pipeline's model; "
            "D and E can represent more of it",
        ),
        (
            "levels-differ",
            {"lowest": 11.0, "highest": 13.0},
            "kinetic friction differs between recordings (11.0 to 13.0 N): model A pools them; see the level of each",
        ),
    ],
)
def test_a_warning_is_worded_with_its_values(kind: str, values: dict[str, Any], sentence: str) -> None:
    assert friction_warning(kind, values) == sentence
