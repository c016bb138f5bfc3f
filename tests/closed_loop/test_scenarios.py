"""Scenarios: what the reference, the load, the supply and the sensors do over time."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pneucli.closed_loop import metrics
from pneucli.closed_loop.metrics import Metrics, evaluate_run, sliding_shares
from pneucli.closed_loop.scenarios import equilibrium_at, read_scenario, read_scenarios
from pneucli.closed_loop.simulation import ClosedLoopSetup, Run, Scenario, initial_log
from pneucli.controller import layout
from pneucli.errors import InputError
from pneucli.simulate import layout as at
from tests.design import axis
from tests.stored import hold_rows_against

CONTROLLER = axis.controller()


def scene(**table: Any):
    return read_scenarios([table], CONTROLLER, "file, scenarios")[0]


def told(one: Scenario) -> dict[str, Any]:
    """Its courses each 250 samples with the steps that they take, its largest speed and jerk, and all the rest."""
    found = {"name": one.name, "dropouts": one.dropouts, "controls pressure": one.controls_pressure}
    for name in ("reference", "force", "supply"):
        course = getattr(one, name)
        jumps = [k for k in range(1, course.size) if course[k] != course[k - 1]]
        found[name] = {"at": course[::250].tolist(), "size": course.size, "first": jumps[:1], "last": jumps[-1:]}
        found[name] |= {f"difference {n}": float(np.abs(np.diff(course, n)).max()) for n in (1, 2)}
    modes = [] if one.operating_mode is None else one.operating_mode
    found["modes"] = {int(k): layout.OPERATING_MODES[int(modes[k])] for k in np.flatnonzero(modes)}
    text = json.dumps(found | {"start": one.start})
    rounded: dict[str, Any] = json.loads(text, parse_float=lambda number: float(f"{float(number):.9g}"))
    return rounded


def test_each_table_makes_the_scenario_that_is_stored() -> None:
    """A row has the keys of a table, numbers of the controller that are others, and what was recorded."""

    def gives(row: dict[str, Any]) -> list[dict[str, Any]]:
        seen = {name: (np.array(t), np.array(y)) for name, (t, y) in row.get("recorded", {}).items()}
        controller = CONTROLLER.with_values(**row.get("controller", {}))
        return [told(one) for one in read_scenarios(row.get("tables", []), controller, "here", seen)]

    hold_rows_against(Path(__file__).parent / "stored" / "scenarios.json", gives, rel=1e-6)


def test_it_starts_in_balance_where_the_reference_does() -> None:
    found = scene(centre="80 mm")
    x, p1, p2 = found.start
    assert x == pytest.approx(0.08)
    c = CONTROLLER.values
    force = c["C_AREA_1"] * (p1 - c["C_AMBIENT"]) - c["C_AREA_2"] * (p2 - c["C_AMBIENT"])
    assert force == pytest.approx(0.0, abs=1e-9)
    assert p2 < equilibrium_at(c, 0.12)[2]


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


# --- what a closed-loop run is judged by, on runs that are made up


METRICS_CONTROLLER, MODEL = axis.controller(), axis.model()
TIME = 1e-3 * np.arange(6000)
METRICS_SUPPLY = axis.RIG.supply_pressure


def made_up(x: Any, reference: Any = 0.1, force: Any = 0.0, u: Any = 0.0, load: Any = 0.0, **more: Any) -> Run:
    def row(value: Any) -> np.ndarray:
        return np.broadcast_to(np.asarray(value, float), TIME.shape).copy()

    model, log = np.zeros((TIME.size, at.OUTPUTS)), np.zeros((TIME.size, layout.L_ROW))
    model[:, at.X], model[:, at.P1], model[:, at.P2] = x, more.get("p1", 3e5), 3e5
    log[:, layout.L_U1], log[:, layout.L_LOAD], log[:, layout.L_U2] = u, load, more.get("u2", 0.0)
    scenario = Scenario("made up", row(reference), row(force), row(more.get("supply", METRICS_SUPPLY)), (0.1, 3e5, 3e5))
    return Run(scenario, TIME, model, log)


def judged(*args: Any, **more: Any) -> Metrics:
    return evaluate_run(made_up(*args, **more), MODEL, METRICS_CONTROLLER)


def late(reference: np.ndarray) -> np.ndarray:
    """The reference one sample later."""
    return np.concatenate([reference[:1], reference[:-1]])


def test_at_rest_the_last_four_tenths_of_a_second_count() -> None:
    x = np.full(TIME.size, 0.1 + 3e-6)
    x[-400:] += 4e-6 * np.sin(np.arange(400))
    x[-401] = 0.2
    found = judged(x)
    assert found.steady_um == pytest.approx(7.0, rel=0.01)
    assert found.cycle_um == pytest.approx(8.0, rel=0.01)


def test_the_worst_of_all_rests_counts_and_those_below_1_2_s_do_not() -> None:
    reference = np.where(TIME < 2.0, 0.1, np.where(TIME < 3.1, 0.11, 0.12))
    x = late(reference)
    x[1900:2000] += 5e-6  # before the first step
    x[2900:3100] += 9e-3  # within the short rest
    found = judged(x, reference)
    assert found.steady_um == pytest.approx(5.0)
    rest = np.where(TIME < 2.0, 0.1, np.where(TIME < 3.25, 0.11, 0.12))
    off = late(rest) + np.where((TIME > 3.0) & (TIME < 3.2), 9e-6, 0.0)
    assert judged(off, rest).steady_um == pytest.approx(9.0)


def test_what_a_run_does_not_show_is_not_a_number() -> None:
    found = judged(0.1)
    for name in (
        "tracking_rms_um",
        "tracking_max_um",
        "overshoot_um",
        "rise_s",
        "settling_s",
        "recovery_s",
        "peak_um",
        "load_error",
    ):
        assert np.isnan(getattr(found, name)), name
    assert found.switching_hz == found.fast_share == found.fast_v == found.air_kg == 0.0


def test_tracking_counts_while_the_reference_moves_smoothly_from_one_second_on() -> None:
    reference = 0.1 + 0.01 * np.clip(TIME - 0.5, 0.0, 2.5)
    x = reference - 2e-5
    x[:1000] -= 1e-3
    x[1500] -= 3e-5
    x[4000:] -= 1e-2
    found = judged(x, reference)
    assert found.tracking_max_um == pytest.approx(50.0)
    assert found.tracking_rms_um == pytest.approx(20.0, rel=0.01)


def first_order(height: float, constant: float = 0.1, begin: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    reference = np.where(TIME < 1.5, begin, begin + height)
    return np.where(TIME < 1.5, begin, begin + height * (1 - np.exp(-(TIME - 1.5) / constant))), reference


@pytest.mark.parametrize("height", [0.03, -0.03])
def test_a_step_is_told_by_rise_overshoot_and_settling(height: float) -> None:
    """First order with 0.1 s: 10 to 90 % take 0.1 ln 9; 50 um of 30 mm are left after 0.1 ln 600."""
    found = judged(*first_order(height))
    assert found.rise_s == pytest.approx(0.1 * np.log(9.0), abs=2e-3)
    assert found.settling_s == pytest.approx(0.1 * np.log(600.0), abs=1e-3)  # a sample
    assert found.overshoot_um == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("height", [0.03, -0.03])
def test_overshoot_is_beyond_the_target_in_the_direction_of_the_step(height: float) -> None:
    x, reference = first_order(height)
    x[2000] = reference[2000] + np.sign(height) * 2e-4
    assert judged(x, reference).overshoot_um == pytest.approx(200.0)


def test_a_step_that_never_arrives_neither_rises_nor_settles() -> None:
    reference = np.where(TIME < 1.5, 0.1, 0.13)
    found = judged(np.where(TIME < 1.5, 0.1, 0.126), reference)
    assert found.rise_s == found.settling_s == np.inf
    assert found.overshoot_um == 0.0


def test_an_observer_slides_while_its_estimate_moves_by_less_than_its_bound() -> None:
    bound = METRICS_CONTROLLER.values["C_LOAD_STEP_MAX"]
    run = made_up(0.1, load=np.cumsum(np.where(TIME < 1.5, 0.5 * bound, bound)))
    assert sliding_shares(run, METRICS_CONTROLLER)["load"] == pytest.approx(0.25, abs=1e-3)
    assert np.isnan(sliding_shares(run, METRICS_CONTROLLER.with_values(C_DISTURBANCE_OBSERVERS=0.0))["load"])


def test_a_load_is_told_by_the_peak_and_the_time_to_recover() -> None:
    force = np.where(TIME < 1.5, 0.0, -50.0)
    x = 0.1 - np.where((TIME >= 1.5) & (TIME < 1.8), 4e-4, 4e-5)
    found = judged(x, 0.1, force, load=0.8 * force)
    assert found.recovery_s == pytest.approx(0.3, abs=2e-3)
    assert found.peak_um == pytest.approx(400.0)
    assert found.load_error == pytest.approx(0.2)


def test_a_load_that_is_never_made_up_for_has_no_end() -> None:
    found = judged(0.1 - np.where(TIME < 1.5, 0.0, 6e-5), 0.1, np.where(TIME < 1.5, 0.0, -50.0))
    assert found.recovery_s == np.inf


def test_the_estimate_of_the_load_is_judged_by_its_mean_at_each_rest() -> None:
    force = np.where(TIME < 3.0, 40.0, 0.0)
    load = np.where(TIME < 3.0, 44.0, -10.0) + np.where(np.arange(TIME.size) % 2, 1.0, -1.0)
    assert judged(0.1, 0.1, force, load=load).load_error == pytest.approx(0.25)


# --- the command


@pytest.mark.parametrize(("amplitude", "hertz"), [(0.3, 4.0), (0.09, 0.0)])
def test_reversals_beyond_a_hundredth_of_the_range_are_counted(amplitude: float, hertz: float) -> None:
    """A sine of 2 Hz turns four times a second; its swing counts from 0.2 V on."""
    found = judged(0.1, u=amplitude * np.sin(2 * np.pi * 2.0 * TIME))
    assert found.switching_hz == pytest.approx(hertz, abs=0.2)


def test_a_ramp_never_turns_and_a_small_turn_does_not_hide_a_large_one() -> None:
    count = metrics._reversals.py_func  # type: ignore[attr-defined]
    assert count(np.linspace(0.0, 5.0, 50), 0.2) == 0
    assert count(np.array([0.0, 1.0, 0.9, 2.0, 1.0, 1.1, 0.0, 3.0]), 0.2) == 2
    assert count(np.array([0.0, 0.0, -1.0, 0.5]), 0.2) == 1
    assert count(np.array([0.0, -1.0, -0.9, -0.85, -0.7]), 0.2) == 1


def test_chattering_is_what_the_command_has_above_50_hz() -> None:
    u = 2.0 * np.sin(2 * np.pi * 10.0 * TIME) + 1.0 * np.sin(2 * np.pi * 120.0 * TIME)
    found = judged(0.1, u=u)
    assert found.fast_v == pytest.approx(2**-0.5, rel=0.02)
    assert found.fast_share == pytest.approx(0.2, rel=0.05)


def test_air_is_drawn_while_a_valve_fills_by_the_flow_law() -> None:
    """Choked at 3 bar of 7: 6 s at 5 V, through either valve; none while venting."""
    base = MODEL.base_values()
    k = np.sqrt(2.0 / (base["rig.gas_constant"] * base["rig.gas_temperature"]))
    choked = axis.area(5.0) * METRICS_SUPPLY * k * 0.484 * 6.0
    assert judged(0.1, u=5.0).air_kg == pytest.approx(choked, rel=2e-3)
    two = METRICS_CONTROLLER.with_values(C_TWO_VALVES=1.0)
    assert evaluate_run(made_up(0.1, u2=5.0), MODEL, two).air_kg == pytest.approx(choked, rel=2e-3)
    assert judged(0.1, u2=5.0).air_kg == 0.0
    assert judged(0.1, u=-5.0).air_kg == 0.0
    ratio, b = 0.8, base["valve.critical_ratio"]
    throttled = judged(0.1, u=5.0, p1=ratio * METRICS_SUPPLY).air_kg
    assert throttled == pytest.approx(choked * np.sqrt(1 - ((ratio - b) / (1 - b)) ** 2), rel=2e-3)
    assert judged(0.1, u=5.0, p1=1.2 * METRICS_SUPPLY).air_kg == 0.0
