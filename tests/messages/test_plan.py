"""A plan in words: manoeuvres, steps for a person, what new recordings decided."""

from __future__ import annotations

import re
from typing import Any, get_args

import pytest

from pneucli.messages import plan as words
from pneucli.plan.manoeuvre import ManoeuvreKind

RECORDING: dict[str, Any] = {
    "name": "plan_1",
    "use": "train",
    "kind": "motion-sine",
    "bench": "cylinder",
    "drive": "position",
    "column": "x_ref",
    "chamber_2": "closed",
    "gain": 80.0,
    "centre": 0.1,
    "level": 0.02,
    "frequency": 2.0,
    "speed": None,
    "pressure": None,
    "force": 0.0,
    "start": {"x": 0.1, "p1": 3e5, "p2": 2.9e5},
    "by_hand": None,
    "begin": 0.0,
    "end": 8.0,
}
ANSWER: dict[str, Any] = {
    "schema": "pneucli/plan/1",
    "pipeline": "rig-7",
    "sentence": "One recording.",
    "recordings": [RECORDING, RECORDING | {"name": "plan_2", "use": "test", "begin": 10.0, "end": 18.0}],
    "limits": {"position": [0.01, 0.19], "max_speed": 0.5, "max_pressure": 8e5, "max_force": None},
}


def test_every_manoeuvre_has_its_words() -> None:
    assert set(words.MANOEUVRES) == set(get_args(ManoeuvreKind))


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({}, "a position sine of 20.0 mm about 100 mm at 2 Hz"),
        ({"kind": "steps", "drive": "valve", "level": 2.5}, "steps of 2.50 V and −2.50 V from the null command"),
        ({"kind": "random-steps", "drive": "valve", "level": 4.0}, "random steps of up to 4.00 V to both sides"),
        ({"kind": "hold", "drive": "valve", "level": -5.0}, "open with 5.00 V for a moment"),
        ({"kind": "machine-strokes", "speed": 0.05, "pressure": 4e5}, "at 50.0 mm/s and 4.00 bar"),
    ],
)
def test_a_manoeuvre_states_its_numbers(change: dict[str, Any], text: str) -> None:
    assert text in words.manoeuvre_text(RECORDING | change)


def test_the_steps_say_where_to_start_which_column_to_play_and_how_to_take_the_files() -> None:
    page = words.steps_page(ANSWER, "axis.toml")
    assert "Start at rest: x = 100 mm, p1 near 3.0 bar" in page
    assert "`commands.csv` from 10.00 s to 18.00 s, column `x_ref`" in page
    assert "held out: never fitted" in page
    assert "pneucli plan axis.toml --take plan_1.csv plan_2.csv" in page
    assert "between 10.0 mm and 190 mm" in page


def test_the_steps_say_for_each_group_of_recordings_how_the_bench_is_driven() -> None:
    at_the_valve = RECORDING | {"drive": "valve", "column": "u", "gain": None}
    page = words.steps_page(ANSWER | {"recordings": [RECORDING, RECORDING, at_the_valve]}, "axis.toml")
    titles = [line for line in page.splitlines() if line.startswith("**On")]
    assert titles == [
        "**On the cylinder** (a position loop with 80.0 V/m, or your own, chamber 2 closed):",
        "**On the cylinder** (commands at the valve, chamber 2 closed):",
    ]


def test_a_vessel_starts_at_a_pressure_and_no_position() -> None:
    vessel = RECORDING | {"bench": "vessel", "drive": "valve", "chamber_2": None}
    page = words.steps_page(ANSWER | {"recordings": [vessel]}, "axis.toml")
    assert "Start at rest: p1 near 3.0 bar (absolute)." in page


def test_a_weight_states_its_mass_and_direction() -> None:
    assert "2.00 kg" in words.by_hand_text("known-force", 19.62, 2.0)
    assert "away from x = 0" in words.by_hand_text("known-force", 19.62, 2.0)
    assert "toward x = 0" in words.by_hand_text("known-force", -19.62, 2.0)


def test_what_was_decided_is_said_and_what_was_not_as_well() -> None:
    after = {"missing": ["stribeck"]}
    named = [{"effect": "stribeck", "now": "named"}]
    assert words.taken_sentence({}, after, named) == "stribeck is now named."
    assert "nothing new" in words.taken_sentence({}, after, [])
    assert "no longer named" in words.taken_sentence({}, after, [{"effect": "stribeck", "now": "refused"}])


def test_the_sentence_says_what_a_plan_is_for() -> None:
    rivals = [{"name": "best model", "effect": None}, {"name": "without leak", "effect": "leak"}]
    expected = [{"power": 0.9}, {"power": 0.8}, {"power": 0.7}]
    made = ANSWER | {"first": False, "seconds": 18.0, "rivals": rivals, "expected": expected}
    begin = "1 recordings and 1 to be held out, 18 s of machine time"
    assert words.plan_sentence(made).startswith(f"{begin}, to decide about leak: 2 of 3 would be shown")
    assert f"{begin}: no effect is in question, and 2 of 3" in words.plan_sentence(made | {"rivals": rivals[:1]})
    assert f"{begin}: 2 of 3 effects" in words.plan_sentence(made | {"first": True, "rivals": []})


def test_the_recordings_of_a_first_programme_come_after_no_diagnosis() -> None:
    taken: dict[str, Any] = {
        "schema": "pneucli/plan-taken/1",
        "recordings": [{"name": "plan_1"}],
        "before": {"verdict": None, "missing": []},
        "after": {"verdict": "adequate", "missing": []},
        "effects": [],
        "parameters": [],
        "sentence": "Nothing new.",
    }
    assert "no diagnosis → adequate" in "\n".join(words.lines(taken, "axis.toml", verbose=False))


def test_the_words_of_a_plan_say_what_it_shows() -> None:
    expected = [
        {"effect": "mass", "rival": "mass", "power": 0.2},
        {"effect": "leak", "rival": "without leak", "power": 0.9},
    ]
    made = ANSWER | {"manual": [], "expected": expected, "files": ["commands.csv"], "folder": "plan", "warnings": []}
    text = " ".join(" ".join(words.lines(made, "axis.toml", verbose=False)).split())
    assert "show what is true: without leak 90 % and mass 20 %" in text


def test_what_the_recordings_changed_is_said_in_words() -> None:
    effects = [
        {"effect": "mass", "before": 0.1, "after": 0.95, "reason": "supported"},
        {"effect": "leak", "before": 0.6, "after": 0.02, "reason": "needless"},
        {"effect": "lag", "before": None, "after": 0.03, "reason": "needless"},
    ]
    taken: dict[str, Any] = {
        "schema": "pneucli/plan-taken/1",
        "recordings": [{"name": "plan_1"}],
        "before": {"verdict": "unexplained", "missing": ["leak"]},
        "after": {"verdict": "adequate", "missing": ["mass"]},
        "effects": effects,
        "parameters": [],
        "sentence": "mass is now named.",
    }
    text = " ".join(" ".join(words.lines(taken, "axis.toml", verbose=False)).split())
    assert re.search(r"mass +10 % +95 % +now\b", text)
    assert re.search(r"leak +60 % +2 % +no longer", text)
    assert "leak and lag. It helps by itself" in text
    assert "needless" not in text
