"""Default checks of the closed loop: limits from the requirements, skipped without one."""

from typing import Any

import pytest

from pneucli.stages.report import closed_loop_checks

FIGURES: dict[str, Any] = {
    "steady_um": 4.0,
    "cycle_um": 0.0,
    "tracking_rms_um": None,
    "recovery_s": None,
    "peak_um": None,
}
LOADED = FIGURES | {"recovery_s": 0.2, "peak_um": 900.0}
SINE = FIGURES | {"steady_um": None, "cycle_um": None, "tracking_rms_um": 40.0}
GATE = {"passed": True, "missed": [], "model_error": 1.0, "model_error_limit": 2.0}


def answers(**changed: Any) -> dict[str, Any]:
    design = {
        "requirements": {"controller": "best", "settling_time": None, "tracking_error": None},
        "compare": {},
        "tolerance_um": 10.0,
        "gate": GATE,
    }
    replay = {"difference_v": 0.0, "samples": 60000, "reason": ""}
    loop = {"steps": FIGURES, "load": LOADED, "sine": SINE}
    simulate = {"closed_loop": loop | changed.pop("loop", {}), "exported_c": changed.pop("replay", replay)}
    return {"design": design | changed, "simulate": simulate}


def outcome(**changed: Any) -> dict[str, str]:
    found = closed_loop_checks(answers(**changed))
    return {
        c.path.removeprefix("closed-loop."): "skipped" if c.skipped else "failed" if c.failure else "passed"
        for c in found
    }


def test_without_stated_requirements_rest_cycle_recovery_gate_and_c_are_checked() -> None:
    passed = dict.fromkeys(("gate", "rest", "limit-cycle", "recovery", "exported-c"), "passed")
    assert outcome() == passed | {"sine": "skipped"}


@pytest.mark.parametrize(
    ("name", "changed"),
    [
        ("rest", {"tolerance_um": 3.0}),
        ("limit-cycle", {"loop": {"steps": FIGURES | {"cycle_um": 11.0}}}),
        ("recovery", {"loop": {"load": LOADED | {"recovery_s": None}}}),
        ("recovery", {"requirements": {"controller": "best", "settling_time": 0.1, "tracking_error": None}}),
        ("sine", {"requirements": {"controller": "best", "settling_time": None, "tracking_error": 30e-6}}),
        ("gate", {"gate": GATE | {"passed": False}}),
        ("exported-c", {"replay": {"difference_v": 1e-6, "samples": 1, "reason": ""}}),
    ],
)
def test_what_exceeds_its_limit_fails(name: str, changed: dict[str, Any]) -> None:
    assert outcome(**changed)[name] == "failed"


def test_without_a_compiler_the_c_is_skipped_with_the_reason() -> None:
    found = closed_loop_checks(answers(replay={"difference_v": None, "samples": 0, "reason": "no C compiler (cc)"}))
    assert [c.skipped for c in found if c.path.endswith("exported-c")] == ["no C compiler (cc)"]


def test_without_a_design_there_are_none() -> None:
    assert closed_loop_checks({"compare": {}}) == []
