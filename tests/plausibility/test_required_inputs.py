"""What recordings need of the rig: nothing that acts counts as zero because nobody stated it."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pneucli.plausibility.required_inputs import assumptions, required_inputs, volumes_to_identify
from pneucli.recording import Recording, Rig
from tests.simulate.synthetic_experiments import RIG

TIME = np.arange(5.0)


def recording(experiment: Any, signals: dict[str, float], **more: Any) -> Recording:
    full = {name: value + 0.1 * TIME for name, value in signals.items()}
    return Recording("one", experiment, "train", TIME, full, **more)


AXIS = recording("axis", {"u": 1.0, "p_supply": 7e5, "p1": 3e5, "p2": 2e5, "x": 0.1}, chamber_2="closed")
PUSHED = recording("friction", {"p1": 3e5, "x": 0.1})
MOTOR = recording("friction", {"force": 10.0, "x": 0.1})
VESSEL = recording("valve", {"u": 1.0, "p1": 3e5})


def keys(one: Recording, rig: Rig) -> set[str]:
    return {f"{need.table}.{need.key}" for need in required_inputs([one], rig)}


@pytest.mark.parametrize(
    ("one", "wanted"),
    [
        (AXIS, {"rig.cylinder.piston_area_1", "rig.cylinder.stroke"}),
        (replace(AXIS, chamber_2="open"), {"rig.cylinder.piston_area_1"}),
        (PUSHED, {"rig.cylinder.piston_area_1"}),
        (replace(PUSHED, chamber_2="closed"), {"rig.cylinder.piston_area_1", "[recordings].p2"}),
        (MOTOR, set()),
        (VESSEL, {"rig.supply_pressure"}),
        (replace(VESSEL, valve_shut=True), set()),
        (replace(VESSEL, signals=VESSEL.signals | {"u": -1.0 - TIME}), set()),  # it only vents
    ],
)
def test_what_acts_must_be_stated(one: Recording, wanted: set[str]) -> None:
    assert keys(one, Rig()) == wanted
    assert keys(one, RIG) <= {"[recordings].p2"}


def test_a_pressure_that_is_not_recorded_needs_the_volume_behind_it() -> None:
    blind = replace(AXIS, signals={n: y for n, y in AXIS.signals.items() if n != "p2"})
    bare = replace(RIG, dead_volume_2=None)
    assert keys(blind, bare) == {"rig.cylinder.dead_volume_2"}
    assert volumes_to_identify([blind], bare) == ()
    assert volumes_to_identify([AXIS], bare) == ("rig.dead_volume_2",)


def test_volumes_are_identified_where_a_motion_shows_them() -> None:
    bare = replace(RIG, dead_volume_1=None, vessel_volume=None)
    assert volumes_to_identify([AXIS], bare) == ("rig.dead_volume_1",)
    assert volumes_to_identify([AXIS, VESSEL], bare) == ("rig.dead_volume_1", "rig.vessel_volume")
    assert volumes_to_identify([VESSEL], bare) == ()  # a vessel alone tells ratios to its volume
    assert volumes_to_identify([AXIS, VESSEL], replace(RIG, vessel_volume=1e-4)) == ()


def test_what_is_taken_for_granted_is_said() -> None:
    bare = replace(RIG, piston_area_2=None)
    assert [a.instead for a in assumptions([AXIS], bare)] == ["rig.cylinder.piston_area_2"]
    assert [a.instead for a in assumptions([AXIS], RIG)] == []
    (said,) = assumptions([PUSHED], RIG)
    assert "ambient pressure in one" in said.what


def test_a_second_command_that_the_arrangement_has_not_is_said() -> None:
    both = replace(AXIS, chamber_2="valve", signals=AXIS.signals | {"u2": 1.0 + TIME})
    assert list(assumptions([both], replace(RIG, valve_arrangement="two"))) == []
    (said,) = assumptions([both], replace(RIG, valve_arrangement="5/3"))
    assert "u2 is not used" in said.what


def test_a_need_names_its_recordings_and_how_the_key_may_be_written() -> None:
    (need,) = required_inputs([PUSHED], Rig())
    assert "one" in need.wanted
    assert "cm^2" in need.example


def test_a_recorded_flow_tells_the_volume_that_it_fills() -> None:
    metered = replace(VESSEL, signals=VESSEL.signals | {"flow": 1e-3 + TIME})
    assert volumes_to_identify([metered], Rig()) == ("rig.vessel_volume",)
    assert volumes_to_identify([metered], Rig(vessel_volume=1e-4)) == (
        "rig.vessel_volume",
    )  # a stated one may be wrong
