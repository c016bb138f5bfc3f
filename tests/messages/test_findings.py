"""The findings of the stages, in words."""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Any

import pytest

import pneucli
from pneucli.messages.findings import OTHERS, VALVE, Finding

RATIO = "model A leaves 1.6 times the sensors' noise of these forces: "


def told_codes() -> set[str]:
    """The codes that the program tells, as far as they stand in a call."""
    texts = (path.read_text(encoding="utf-8") for path in Path(pneucli.__file__).parent.rglob("*.py"))
    trees = [ast.parse(text) for text in texts if "pneucli.messages.findings import" in text]
    calls = [node for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Call) and node.args]
    codes = [call.args[0] for call in calls if isinstance(call.func, ast.Name) and call.func.id in ("Finding", "tell")]
    named = [part.value for code in codes for part in ast.walk(code) if isinstance(part, ast.Constant)]
    return {str(name) for name in named}


def test_every_finding_has_one_sentence_and_every_sentence_a_finding() -> None:
    named_in_a_table = {"p2-inferred", "p2-missing"}
    assert told_codes() | named_in_a_table == VALVE.keys() | OTHERS.keys()


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
        (
            "flow-scatters",
            {"u": 2.0, "share": 0.2, "low": 1e-3, "high": 2e-3, "ratio": 0.51},
            "at 2 V the flow differs by 20 % rms from any function of the two pressures (such as 50.6 l/min ANR and "
            "101 l/min ANR near a pressure ratio of 0.51)",
        ),
        (
            "pressure-loop",
            {"correlation": 0.998, "spread": 2e3, "varied": 0.8, "offset": 1e5, "gain": 6e4, "droop": 1e6},
            "to 1.00 bar + 0.600 bar/V · u, less 0.20 bar for 1000 l/min ANR",
        ),
        (
            "cracking-pressure",
            {"u": None, "pressure": (2e4, 1.8e4, 2.2e4), "count": 1, "paths": 3},
            "below a pressure difference of 0.200 ± 0.020 bar at 1 of 3 openings, the one opening the most",
        ),
    ],
)
def test_what_is_told_of_a_valve_starts_with_its_code_and_states_its_numbers(
    code: str, numbers: dict[str, Any], text: str
) -> None:
    found = Finding(code, numbers).text
    assert found.startswith(f"{code}: ")
    assert text in found


@pytest.mark.parametrize(
    ("code", "values", "sentence"),
    [
        ("dry-friction-not-significant", {}, "dry friction is not significantly above zero"),
        (
            "models-missing",
            {"models": "D, E, F", "accelerating": 700, "slowing": 12},
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
def test_a_finding_is_worded_with_its_values(code: str, values: dict[str, Any], sentence: str) -> None:
    assert Finding(code, values).text == sentence
