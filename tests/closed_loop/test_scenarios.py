"""Scenarios: what the reference, the load, the supply and the sensors do over time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pneucli.closed_loop.scenarios import equilibrium_at, read_scenario, read_scenarios
from pneucli.closed_loop.simulation import ClosedLoopSetup, _flags, _inputs, initial_log
from pneucli.controller import layout
from pneucli.errors import InputError
from pneucli.simulate import layout as at
from tests.design import axis

CONTROLLER = axis.controller()
STROKE = CONTROLLER.values["C_STROKE"]
SUPPLY = CONTROLLER.values["C_SUPPLY"]
ABOVE = SUPPLY - CONTROLLER.values["C_AMBIENT"]


def scene(**table: Any):
    return read_scenarios([table], CONTROLLER, "file, scenarios")[0]


def test_steps_go_up_down_and_back_about_the_middle() -> None:
    found = scene(reference="steps", duration="9 s")
    assert found.reference.size == 9000
    levels = [found.reference[round(1e3 * t)] / STROKE for t in (0.0, 0.5, 0.502, 2.9, 3.1, 5.4, 5.6, 8.9)]
    assert levels == pytest.approx([0.5, 0.5, 0.65, 0.65, 0.35, 0.35, 0.5, 0.5])
    stated = scene(centre="80 mm", amplitude="10 mm", dwell="1 s", duration="4 s").reference
    assert stated[[0, 1000, 2000, 3000]] == pytest.approx([0.08, 0.09, 0.07, 0.08])


def test_a_commissioning_begins_when_it_is_asked_for() -> None:
    found = scene(commission="0.2 s").operating_mode
    assert list(np.flatnonzero(found)) == [200]
    assert layout.OPERATING_MODES[int(found[200])] == "commission"
    assert scene().operating_mode is None


def test_a_sine_begins_after_half_a_second() -> None:
    found = scene(reference="sine", frequency="1 Hz", amplitude="20 mm", centre="90 mm", duration="3 s").reference
    assert np.all(found[:501] == 0.09)
    assert found[[750, 1250]] == pytest.approx([0.11, 0.07])
    assert scene(reference="sine").reference[1000] == pytest.approx((0.5 + 0.15) * STROKE)


def test_an_s_curve_goes_from_one_side_to_the_other_without_a_jerk() -> None:
    found = scene(reference="s-curve", amplitude="20 mm", centre="90 mm", dwell="2 s", duration="4 s").reference
    assert found[[0, 500, 1500, 2500, 3999]] == pytest.approx([0.07, 0.07, 0.09, 0.11, 0.11])
    speed = np.diff(found) / 1e-3
    assert speed.max() == pytest.approx(1.875 * 0.04 / 2.0, rel=1e-3)
    assert np.abs(np.diff(speed)).max() / 1e-3 < 5.78 * 0.04 / 4.0
    usual = scene(reference="s-curve").reference
    assert usual[[0, 1250, 2100]] == pytest.approx(np.array([0.35, 0.5, 0.65]) * STROKE)


def test_a_hold_stays() -> None:
    found = scene(reference="hold")
    assert found.name == "hold"
    assert found.reference.size == 6000
    assert np.all(found.reference == 0.5 * STROKE)
    assert np.all(found.force == 0.0)
    assert np.all(found.supply == SUPPLY)
    assert found.dropouts == ()


def test_loads_and_drops_have_their_time() -> None:
    load = {"load": "-50 N", "load_from": "2 s", "load_to": "3 s"}
    found = scene(name="both", reference="hold", supply_drop="1 barg", supply_from="1.5 s", **load)
    assert found.name == "both"
    assert found.force[[1999, 2000, 2999, 3000]].tolist() == [0.0, -50.0, -50.0, 0.0]
    assert found.supply[[1499, 1500, 5999]] == pytest.approx([SUPPLY, SUPPLY - 1e5, SUPPLY - 1e5])
    assert scene(reference="hold", load="1 N").force[[999, 1000, 5999]].tolist() == [0.0, 1.0, 1.0]


def test_a_sensor_is_lost_for_50_ms_from_one_second_on_unless_stated() -> None:
    assert scene(lost="p2").dropouts == (("p2", 1.0, 1.05),)
    assert scene(lost="x", lost_from="2 s", lost_to="2.5 s").dropouts == (("x", 2.0, 2.5),)


def test_it_starts_in_balance_where_the_reference_does() -> None:
    found = scene(centre="80 mm")
    x, p1, p2 = found.start
    assert x == pytest.approx(0.08)
    c = CONTROLLER.values
    force = c["C_AREA_1"] * (p1 - c["C_AMBIENT"]) - c["C_AREA_2"] * (p2 - c["C_AMBIENT"])
    assert force == pytest.approx(0.0, abs=1e-9)
    assert p2 < equilibrium_at(c, 0.12)[2]


def test_the_defaults() -> None:
    steps, sine, curve, load, drop, dropout, points, pressure = found = read_scenarios([], CONTROLLER, "here")
    assert [s.reference.size for s in found] == [8000, 6000, 5000, 6000, 8000, 8000, 8000, 6000]
    assert np.ptp(steps.reference) == np.ptp(drop.reference) == np.ptp(dropout.reference) == pytest.approx(0.3 * STROKE)
    assert np.argmax(sine.reference) == 1000
    push = 0.1 * CONTROLLER.values["C_AREA_1"] * ABOVE
    assert load.force[[999, 1000, 3499, 3500]] == pytest.approx([0.0, -push, -push, 0.0])
    assert drop.supply[[1499, 1500, 4999, 5000]] - SUPPLY == pytest.approx([0.0, -ABOVE / 6, -ABOVE / 6, 0.0])
    assert dropout.dropouts == (("p1", 3.2, 3.3),)
    assert not any(s.dropouts for s in (steps, sine, curve, load, drop))
    assert points.reference[[0, 501, 2001, 3501, 5001]] / STROKE == pytest.approx([0.5, 0.515, 0.44, 0.4385, 0.62])
    assert [s.name for s in found if s.controls_pressure] == ["pressure"]
    assert np.ptp(pressure.reference) == pytest.approx(0.2 * ABOVE)
    assert pressure.reference[0] == pytest.approx(pressure.start[1])


def test_sizes_that_are_not_stated_suit_the_rig() -> None:
    """A sine is as fast as the reference may be, at most, an S-curve takes the time that it needs for that."""
    slow = CONTROLLER.with_values(C_V_MAX=0.02, C_AREA_1=2e-3)
    sine, curve, load = (
        read_scenarios([table], slow, "here")[0]
        for table in (
            {"reference": "sine", "frequency": 0.5},
            {"reference": "s-curve", "duration": 12.0},
            {"load_from": 0},
        )
    )
    assert np.ptp(sine.reference) == pytest.approx(2 * 0.02 / np.pi, rel=1e-3)
    assert np.abs(np.diff(curve.reference)).max() / 1e-3 == pytest.approx(0.02, rel=1e-3)
    assert load.force[0] == pytest.approx(-0.1 * 2e-3 * ABOVE)


def test_points_are_visited_in_turn() -> None:
    found = scene(reference="points", points=["50 mm", "0.1 m", 0.07], dwell="1 s", duration="4 s").reference
    assert found[[0, 501, 1501, 3999]] == pytest.approx([0.05, 0.1, 0.07, 0.07])


def test_a_pressure_may_be_asked_for_and_its_sizes_are_pressures() -> None:
    found = scene(control="pressure", reference="sine", centre="3 bar", amplitude="20 kPa", frequency="1 Hz")
    assert found.controls_pressure
    assert found.start[0] == 0.5 * STROKE
    assert found.reference[[0, 750, 1250]] == pytest.approx([3e5, 3.2e5, 2.8e5])
    asked = {"axis_1, pressure": (np.array([0.0, 10.0]), np.array([2e5, 4e5])), "axis_1": (np.zeros(1), np.ones(1))}
    table = {"control": "pressure", "reference": "recorded", "recording": "axis_1", "duration": 10.0}
    assert read_scenarios([table], CONTROLLER, "here", asked)[0].reference[5000] == pytest.approx(3e5)


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ({"name": 3}, r"here\.name: 3.*a text"),
        ({"duration": "1 mm"}, r'here\.duration.*a quantity such as "1 s"'),
        ({"speed": "1 m/s"}, r"here\.speed: unknown key"),
        ({"reference": "step"}, r'here\.reference: "step".*steps'),
        ({"duration": "0 s"}, r"here\.duration: 0.*above 0"),
        ({"dwell": "-1 s"}, r"here\.dwell: −1.*above 0"),
        ({"frequency": "0 Hz"}, r"here\.frequency: 0.*above 0"),
        ({"control": "force"}, r'here\.control: "force"'),
        ({"control": "pressure", "centre": "3 mm"}, r'here\.centre.*a quantity such as "1 Pa"'),
        ({"points": ["1 mm", "1 bar"]}, r'here\.points.*a quantity such as "1 m"'),
        ({"lost": "a"}, r'here\.lost: "a".*"x", "p1" or "p2"'),
    ],
)
def test_a_table_that_cannot_be_read_says_how_to_mend_it(table: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError, match=f"(?s){says}"):
        read_scenario(table, "here")


@pytest.mark.parametrize("lost", ["x", "p1", "p2"])
def test_each_of_three_sensors_may_be_lost(lost: str) -> None:
    assert read_scenario({"lost": lost}, "here")["lost"] == lost


def test_a_scenario_too_long_is_refused() -> None:
    with pytest.raises(
        InputError, match=r"(?s)scenarios\[0\]\.duration: 20000 s in steps of 0\.001 s.*at most 10000000"
    ):
        scene(duration="20000 s")
    with pytest.raises(InputError, match=r'(?s)scenarios\[0\]\.recording: "x1".*a recording with x_ref or x'):
        scene(reference="recorded", recording="x1")


# --- what goes into the loop


def test_sensors_rows_hold_their_noise_and_what_is_missing() -> None:
    found = scene(reference="hold", lost="p1", lost_from="2 s", lost_to="3 s")
    time = 1e-3 * np.arange(6000)
    rows = initial_log(found, ClosedLoopSetup(noise_x=1e-5, noise_p=300.0), time, 1)
    assert rows.shape == (6000, layout.L_ROW)
    assert np.nanstd(rows[:, :3], axis=0) == pytest.approx([1e-5, 300.0, 300.0], rel=0.05)
    assert np.flatnonzero(np.isnan(rows[:, 1])).tolist() == list(range(2000, 3000))
    assert not np.isnan(rows[:, [0, 2]]).any()
    assert not rows[:, 3:].any()


def test_the_kernels_inputs_are_reference_force_supply_and_start() -> None:
    found = scene(reference="hold", load="5 N")
    rows = _inputs(found)
    assert rows[1500, [at.IN_U, at.IN_FORCE, at.IN_SUPPLY]].tolist() == [0.5 * STROKE, 5.0, SUPPLY]
    assert rows[0, [at.IN_X, at.IN_P1, at.IN_P2]].tolist() == list(found.start)


def test_the_flags_say_loop_and_which_chambers_have_a_valve() -> None:
    one, two = (_flags(CONTROLLER.with_values(C_TWO_VALVES=t)) for t in (0.0, 1.0))
    assert [one[f] for f in (at.MECHANICS, at.PNEUMATICS, at.LOOP, at.U_MAX)] == [1.0, 1.0, 1.0, 10.0]
    assert (one[at.CHAMBER_2], two[at.CHAMBER_2]) == (at.CLOSED, at.VALVE_2)
