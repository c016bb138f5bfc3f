"""The warnings about a valve, in words."""

from __future__ import annotations

import pytest

from pneucli.messages.valve import valve_warning


@pytest.mark.parametrize(
    ("code", "numbers", "text"),
    [
        ("valve-not-described", {"largest": 1e8, "measured": 2e6}, "reaches 1000 bar/s, its curves show no more than"),
        ("valve-resampled", {"count": 3, "error": 120.0, "recording": "a"}, "3 recordings are sampled unevenly"),
        ("valve-curves-not-followed", {"residual": 7.0}, "leaves 7.00 × noise on its own curves"),
        ("valve-not-foreseen", {"residual": 9.0}, "leaves 9.00 × noise on held-out curves"),
        (
            "valve-critical-ratio",
            {"count": 2, "commands": 5, "model": 0.3, "command": -4.0, "measured": (0.5, 0.4, 0.6)},
            "another critical ratio than the model has, 0.3; most at −4 V: 0.50 ± 0.10",
        ),
    ],
)
def test_a_warning_starts_with_its_code_and_states_its_numbers(code: str, numbers: dict, text: str) -> None:
    found = valve_warning(code, **numbers)
    assert found.startswith(f"{code}: ")
    assert text in found
