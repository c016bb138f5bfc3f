"""What is said of changes, and of a fleet."""

from __future__ import annotations

from pneucli import messages
from pneucli.messages.diagnose import changes_since_baseline

CHANGE = {"name": "piston-leak.area", "before": 0.0, "after": 5.2e-8, "unit": "m^2", "ci95": [5.0e-8, 5.4e-8],
          "confidence": 0.9999, "indistinguishable_from": []}  # fmt: skip
LIMITS = [
    {"name": "end-cushion.damping", "size": 900.0, "unit": "N s/m", "plausible": False},
    {"name": "friction.coulomb", "size": 0.2, "unit": "N", "plausible": True},
]


def answer(*changes: dict[str, object]) -> dict[str, object]:
    return {"changes": list(changes), "since": {"unseen": LIMITS}}


def test_a_change_states_its_size_equivalents_and_false_alarm_probability() -> None:
    text = changes_since_baseline(answer(CHANGE | {"indistinguishable_from": ["chamber-leak"]}))
    assert text.startswith("piston-leak.area, or chamber-leak changed from 0 mm² to")
    assert text.endswith("(chance of a false alarm 0.0001)")


def test_without_a_change_the_detection_limits_are_stated() -> None:
    text = changes_since_baseline(answer())
    assert "no change detected in 2 parameters and effects" in text
    assert "friction.coulomb by 0.20 N" in text
    assert "end-cushion" not in text
    assert text.endswith("is unknown (--repeat)")
    known = {"unseen": LIMITS, "repeatability": {"dates": 3}}
    assert changes_since_baseline({"changes": [], "since": known}).endswith("0.20 N")


def test_a_fleet_states_its_changes_and_failures() -> None:
    one = {"rig": "axis-7", "date": "2026-11-22", "since": "2026-11-01", "changes": [CHANGE]}
    told = {"changed": 12, "rigs": 400, "failed": 3, "rows": 800, "missing": {"stribeck": 4}, "changes": [one] * 12,
            "failures": [{"cause": "no file …", "rows": 3}], "done": 5, "unchanged": 795, "seconds": 7.0, "out": "a",
            "verdicts": {"adequate": 797}, "repeatability": None}  # fmt: skip
    text = messages.render("fleet", told, "fleet.toml")
    assert "12 of 400 rigs changed, 3 of 800 rows failed; missing from the model: stribeck (4)" in text
    assert text.count("axis-7") == 10
    assert "and 2 more" in text
    assert "is unknown: state [fleet] healthy" in text
    known = {"rigs": 24, "dates": 4, "parameters": {"friction.coulomb": 0.0312, "friction.viscous": 0.0}}
    said = "a healthy rig differs by friction.coulomb 3.1 % (24 rigs, 4 dates each)"
    assert said in messages.render("fleet", told | {"repeatability": known}, "fleet.toml")
    assert "3 rows: no file …" in text
    assert messages.render("fleet", told, "fleet.toml", verbose=True).count("axis-7") == 12
