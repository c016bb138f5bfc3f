"""Laws that the numbers of a controller keep, and what is asked for and refused before there are any."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pneucli.design import cascade_design
from pneucli.design.bandwidths import (
    LOAD_OBSERVER_RATIO,
    UNMODELLED_DELAY,
    Bandwidths,
    Timing,
    chamber_2_pressure,
    controller_gains,
)
from pneucli.design.cascade_design import inverse_table
from pneucli.design.requirements import Requirements, read_requirements
from pneucli.errors import InputError
from pneucli.simulate.valve_forms import ValveArea
from tests.design import axis

MODEL = axis.model()
PLAIN = Requirements()
VALUES = axis.controller().values
CORNERS = Bandwidths(100.0, 10.0, 80.0, 12.0)
PROMPT = Timing(0.0, 0.0, 0.0, 0.0, 0.0, UNMODELLED_DELAY)


# --- gains


def test_the_position_loop_has_the_poles_of_the_rule() -> None:
    """(s + w)(s^2 + 2 d w s + w^2) with w = 10 and d = 0.7."""
    found = controller_gains(CORNERS, {"C_MASS": 2.0}, replace(PLAIN, damping=0.7), PROMPT)
    wanted = np.polymul([1.0, 10.0], [1.0, 14.0, 100.0])
    assert [1.0, found["C_KD"], found["C_KP"], found["C_KI"]] == pytest.approx(wanted)


def test_observers_have_their_poles_that_of_the_load_a_calmer_one() -> None:
    """Of x, v and load (a double integrator with a constant disturbance), and of a pressure with a constant flow."""
    h, mass = 1e-3, 2.0
    found = controller_gains(CORNERS, {"C_MASS": mass}, PLAIN, PROMPT)
    predict = np.array([[1.0, h, h * h / (2 * mass)], [0.0, 1.0, h / mass], [0.0, 0.0, 1.0]])
    innovation = np.array([[found["C_OBS_X"]], [found["C_OBS_V"]], [found["C_OBS_LOAD"]]])
    error = (np.eye(3) - innovation @ np.array([[1.0, 0.0, 0.0]])) @ predict
    poles = [math.exp(-80.0 * h)] * 2 + [math.exp(-LOAD_OBSERVER_RATIO * 100.0 * h)]
    assert np.poly(error) == pytest.approx(np.poly(poles), rel=1e-6)
    assert found["C_OBS_P"] == pytest.approx(1.0 - math.exp(-0.1))
    assert found["C_OBS_FLOW"] == pytest.approx((1.0 - math.exp(-0.012)) ** 2 / h)


# --- the reference and standstill


@pytest.mark.parametrize("x", [0.05, 0.1, 0.17])
def test_a_closed_chamber_2_is_an_isentropic_spring(x: float) -> None:
    volume = VALUES["C_DEAD_VOLUME_2"] + VALUES["C_AREA_2"] * (VALUES["C_STROKE"] - x)
    middle = VALUES["C_DEAD_VOLUME_2"] + VALUES["C_AREA_2"] * VALUES["C_STROKE"] / 2
    p = chamber_2_pressure(VALUES, np.array([x]))
    assert p * volume ** VALUES["C_GAMMA"] == pytest.approx(VALUES["C_P_MEAN"] * middle ** VALUES["C_GAMMA"])
    two = chamber_2_pressure({**VALUES, "C_TWO_VALVES": 1.0}, np.array([x]))
    assert two.tolist() == [VALUES["C_P_MEAN"]]


# --- the axis and the valve


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_the_inverse_table_leads_back_to_its_areas(direction: float) -> None:
    """201 commands whose areas are even over the root, from the closing edge to the largest command tested."""
    commands, largest = inverse_table(MODEL, MODEL.valve, direction)
    assert len(commands) == 201
    assert commands[-1] == direction * 10.0
    assert largest == pytest.approx(axis.area(10.0), rel=1e-3)
    wanted = largest * (np.arange(201) / 200) ** 2
    assert np.abs([MODEL.valve(np.array([u]))[0] for u in commands] - wanted).max() < 2e-3 * largest
    assert commands[0] == pytest.approx(direction * axis.TRUTH["overlap"], abs=0.02)
    assert np.all(np.diff(direction * np.array(commands)) >= 0.0)


@pytest.mark.parametrize(
    ("field", "key"),
    [
        ("piston_area_1", "cylinder.piston_area_1"),
        ("stroke", "cylinder.stroke"),
        ("dead_volume_1", "cylinder.dead_volume_1"),
        ("dead_volume_2", "cylinder.dead_volume_2"),
        ("moving_mass", "cylinder.moving_mass"),
        ("supply_pressure", "supply_pressure"),
    ],
)
def test_what_a_controller_needs_and_is_not_known_is_asked_for(field: str, key: str) -> None:
    poor = replace(MODEL, rig=replace(axis.RIG, **{field: None}))
    with pytest.raises(InputError, match=rf"(?s)\[rig\] {key}.*not known.*its value"):
        cascade_design.design_cascade(poor, axis.REQUIREMENTS)


def test_what_was_identified_need_not_be_stated() -> None:
    poor = replace(MODEL, rig=replace(axis.RIG, moving_mass=None, supply_pressure=None))
    cascade_design._require(poor.with_values({"rig.moving_mass": 2.0, "rig.supply_pressure": 7e5}))


@pytest.mark.parametrize("commands", [(2.0, 5.0), (-5.0, -2.0)])
def test_a_valve_known_in_one_direction_controls_nothing(commands: tuple[float, float]) -> None:
    one = replace(MODEL, valve=ValveArea(commands, (1e-7, 2e-7)))
    with pytest.raises(InputError, match=r"(?s)the valve.*both directions.*recordings that fill and that vent"):
        cascade_design._require(one)


# --- requirements


def test_requirements_are_read_with_their_units_over_what_is_known() -> None:
    table = {
        "period": "2 ms", "tolerance": "20 um", "pressure_bandwidth": "30 Hz", "damping": 0.7, "max_speed": "0.4 m/s",
        "max_acceleration": "3 m/s^2", "delay": "1 ms", "chamber_2": "valve", "position_bandwidth": "3 Hz",
        "sector_ratio": 3, "noise_x": "0 um", "quantum_x": "1 um",
    }  # fmt: skip
    assert read_requirements(table, "here", noise_p=400.0, noise_x=1.0) == Requirements(
        2e-3, pytest.approx(2e-5), 30.0, 3.0, 0.7, 3.0, 0.4, 3.0, 0.0, pytest.approx(1e-6), 400.0, 1e-3, "valve"
    )
    assert read_requirements({}, "here") == Requirements(
        1e-3, None, None, None, 1.0, 2.0, None, None, 0.0, 0.0, 0.0, 0.0, "closed"
    )


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ({"chamber_2": "ajar"}, r"here\.chamber_2: 'ajar'.*\"closed\", \"open\" or \"valve\""),
        ({"peroid": "1 ms"}, r"here\.peroid: unknown key.*period"),
        ({"period": "1 m"}, r"here\.period.*a quantity such as \"1 s\""),
        ({"damping": 0}, r"here\.damping: 0.*above 0"),
        ({"sector_ratio": 1}, r"here\.sector_ratio: 1.*above 1: the slope of one line"),
        ({"period": "2 s"}, r"here\.period: 2 s.*from 1·10⁻⁵ s to 1 s"),
        ({"period": "5 us"}, r"here\.period: 5·10⁻⁶ s.*from 1·10⁻⁵ s to 1 s"),
        ({"max_speed": "-1 m/s"}, r"here\.max_speed: −1.*above 0"),
    ],
)
def test_a_requirement_that_cannot_be_read_says_how_to_mend_it(table: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError, match=f"(?s){says}"):
        read_requirements(table, "here")


@pytest.mark.parametrize("period", ["10 us", "1 s"])
def test_the_longest_and_the_shortest_period_are_allowed(period: str) -> None:
    assert read_requirements({"period": period}, "here").period in (1e-5, pytest.approx(1e-5), 1.0)
