"""An exam like one's own bench: sizes that fit the rig, manoeuvres that follow the recordings, and the page."""

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pneucli.errors import InputError
from pneucli.exam.graded_case import GradedCase
from pneucli.exam.hidden_effects import BY_NAME
from pneucli.exam.like import UserRecording, UserRig, excitation_for, summarize, with_hidden_effect, write_like
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.sensors import Sensors
from pneucli.exam.rig.simulation import simulate_rig
from tests.exam.chosen import Chosen

TIME = np.arange(0.0, 3.0, 2e-3)
MOVED = UserRecording("driven", "friction", "train", TIME, 0.1 + 0.04 * np.sin(3.0 * TIME), (3e5, 3e5))
BENCH = UserRig("", Parameters(coulomb=30.0, mass=1.0), Sensors(), has_cylinder=True, recordings=(MOVED,))
TWICE = replace(BENCH, parameters=BENCH.parameters._replace(piston_area_1=16e-4, piston_area_2=16e-4))


def test_hidden_effects_are_scaled_to_the_rig() -> None:
    draw = Chosen(0.5)
    force = [with_hidden_effect(b, BY_NAME["constant-force"], 1.0, draw).constant_force for b in (BENCH, TWICE)]  # type: ignore[arg-type]
    assert force[1] == pytest.approx(2.0 * force[0])
    stribeck = with_hidden_effect(BENCH, BY_NAME["stribeck"], 1.0, draw)  # type: ignore[arg-type]
    assert stribeck.static == pytest.approx(1.85 * 30.0)
    assert stribeck.coulomb == 30.0
    small, large = (with_hidden_effect(BENCH, BY_NAME["extra-mass"], s, draw).extra_mass for s in (0.1, 1.0))  # type: ignore[arg-type]
    assert (small, large) == pytest.approx((0.06, 0.6))


def test_the_rig_moves_about_as_the_recording_did() -> None:
    truth = simulate_rig(BENCH.parameters, excitation_for(BENCH, MOVED))
    wanted = np.interp(1e-3 * np.arange(truth["x"].size), TIME, MOVED.signal)
    assert np.std(truth["x"]) > 0.3 * np.std(wanted)
    assert abs(np.mean(truth["x"] - wanted)) < 0.02


def test_a_valve_test_repeats_the_commands() -> None:
    steps = UserRecording("step", "valve", "train", TIME, np.where(TIME < 0.2, 0.0, 5.0), (1e5, 1e5))
    done = excitation_for(BENCH, steps)
    assert (done.command[100], done.command[-1]) == (0.0, 5.0)
    assert done.pressure_1 == 1e5


def test_cases_have_the_users_recordings_and_sealed_effects_and_sizes(tmp_path: Path) -> None:
    names = write_like(tmp_path / "exam", BENCH, sizes=(1.0,), repeats=1, nulls=1)
    truths = [json.loads((tmp_path / "exam" / ".sealed" / f"{n}.json").read_text()) for n in names]
    hidden = [effect for t in truths for effect in t["hidden"]]
    assert len(hidden) == len(set(hidden)) == len(names) - 1
    assert not {"valve-lag", "force-skew"} & set(hidden)  # no valve, and no recorded force
    case = tomllib.loads((tmp_path / "exam" / names[0] / "pipeline.toml").read_text())
    assert [r["name"] for r in case["recordings"]] == ["driven"]
    with pytest.raises(InputError, match="not empty"):
        write_like(tmp_path / "exam", BENCH)


def case(name: str, size: float, *missing: str) -> GradedCase:
    truth = {"hidden": {name: {}} if name else {}, "outside_the_catalogue": None, "size": size}
    return GradedCase("c", truth, {"missing": list(missing), "verdict": "", "candidates": []})


def test_the_smallest_named_size_is_named_in_nine_of_ten_cases() -> None:
    small = [case("stribeck", 0.1, "stribeck"), case("stribeck", 0.1, "presliding")]
    found = summarize([*small, *[case("stribeck", 1.0, "stribeck")] * 3, case("", 0.0), case("", 0.0, "dead-volume")])
    (row,) = found.effects
    assert (row.named_from, [s.share for s in row.sizes]) == (1.0, [0.5, 1.0])
    assert (found.false_alarms, found.nulls) == (1, 2)
    text = found.page((0.1, 1.0))
    assert "| stribeck | × 1 | 1 of 2 | 3 of 3 | presliding |" in text
    assert "1 of 2 named something" in text
    assert summarize([case("stribeck", 1.0)]).effects[0].named_from is None
