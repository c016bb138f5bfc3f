"""What a closed-loop run is judged by, on runs that are made up."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pneucli.closed_loop import metrics
from pneucli.closed_loop.metrics import Metrics, evaluate_run, sliding_shares
from pneucli.closed_loop.simulation import Run, Scenario
from pneucli.controller import layout
from pneucli.simulate import layout as at
from tests.design import axis

CONTROLLER, MODEL = axis.controller(), axis.model()
TIME = 1e-3 * np.arange(6000)
SUPPLY = axis.RIG.supply_pressure


def made_up(x: Any, reference: Any = 0.1, force: Any = 0.0, u: Any = 0.0, load: Any = 0.0, **more: Any) -> Run:
    def row(value: Any) -> np.ndarray:
        return np.broadcast_to(np.asarray(value, float), TIME.shape).copy()

    model, log = np.zeros((TIME.size, at.OUTPUTS)), np.zeros((TIME.size, layout.L_ROW))
    model[:, at.X], model[:, at.P1], model[:, at.P2] = x, more.get("p1", 3e5), 3e5
    log[:, layout.L_U1], log[:, layout.L_LOAD], log[:, layout.L_U2] = u, load, more.get("u2", 0.0)
    scenario = Scenario("made up", row(reference), row(force), row(more.get("supply", SUPPLY)), (0.1, 3e5, 3e5))
    return Run(scenario, TIME, model, log)


def judged(*args: Any, **more: Any) -> Metrics:
    return evaluate_run(made_up(*args, **more), MODEL, CONTROLLER)


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
    bound = CONTROLLER.values["C_LOAD_STEP_MAX"]
    run = made_up(0.1, load=np.cumsum(np.where(TIME < 1.5, 0.5 * bound, bound)))
    assert sliding_shares(run, CONTROLLER)["load"] == pytest.approx(0.25, abs=1e-3)
    assert np.isnan(sliding_shares(run, CONTROLLER.with_values(C_DISTURBANCE_OBSERVERS=0.0))["load"])


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


def test_what_stays_within_50_um_has_recovered_at_once() -> None:
    assert metrics._recovery(TIME, np.full(TIME.size, -4.9e-5)) == (0.0, pytest.approx(4.9e-5))


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
    choked = axis.area(5.0) * SUPPLY * k * 0.484 * 6.0
    assert judged(0.1, u=5.0).air_kg == pytest.approx(choked, rel=2e-3)
    two = CONTROLLER.with_values(C_TWO_VALVES=1.0)
    assert evaluate_run(made_up(0.1, u2=5.0), MODEL, two).air_kg == pytest.approx(choked, rel=2e-3)
    assert judged(0.1, u2=5.0).air_kg == 0.0
    assert judged(0.1, u=-5.0).air_kg == 0.0
    ratio, b = 0.8, base["valve.critical_ratio"]
    throttled = judged(0.1, u=5.0, p1=ratio * SUPPLY).air_kg
    assert throttled == pytest.approx(choked * np.sqrt(1 - ((ratio - b) / (1 - b)) ** 2), rel=2e-3)
    assert judged(0.1, u=5.0, p1=1.2 * SUPPLY).air_kg == 0.0
