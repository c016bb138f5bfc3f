"""The numbers of a controller: laws that they keep, what is refused, all as stored, and what effects change."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pneucli.controller.parameters import Controller
from pneucli.design import cascade_design
from pneucli.design.bandwidths import (
    LOAD_OBSERVER_RATIO,
    UNMODELLED_DELAY,
    Bandwidths,
    Timing,
    chamber_2_pressure,
    choose_bandwidths,
    controller_gains,
)
from pneucli.design.cascade_design import design_cascade, inverse_table
from pneucli.design.effect_compensation import has_restoring_force, moving_mass, restoring_force
from pneucli.design.requirements import Requirements, read_requirements
from pneucli.errors import InputError
from pneucli.physics.declaration import Effect, Parameter
from pneucli.physics.effects import catalogue
from pneucli.simulate.model import Model
from pneucli.simulate.valve_forms import ValveArea
from pneucli.stages.control_laws import valve_warnings
from tests.design import axis
from tests.simulate.synthetic_experiments import model, typical_values
from tests.stored import hold_rows_against

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


# --- the numbers of a controller, as stored, and how each situation of axis, effects and requirements changes them


STORED = Path(__file__).parent / "stored" / "numbers.json"


def model_of(row: dict[str, Any]) -> Model:
    """The axis with the effects, parameters, rig and valve of a row."""
    base, values = axis.model(), row.get("values", {})
    names = {name.partition(".")[0] for name in values} | {e.name for e in base.effects}
    effects = tuple(catalogue()[name] for name in sorted(names & catalogue().keys() - set(row.get("without", ()))))
    rig = replace(axis.RIG, **row.get("rig", {}))
    valve = ValveArea(*(tuple(part) for part in row["valve"])) if "valve" in row else base.valve
    return replace(base, rig=rig, valve=valve, effects=effects).with_values(values)


def told(row: dict[str, Any]) -> dict[str, float]:
    """All numbers of its controller, of tables a few, and the corners of loops that predict or do not."""
    model, wanted = model_of(row), replace(axis.REQUIREMENTS, **row.get("requirements", {}))
    made: Controller = design_cascade(model, wanted, row.get("sealed", axis.SEALED))
    found = dict(made.values)
    for name, table in made.tables().items():
        found |= {f"{name} mean": np.mean(table), f"{name} end": table[-1], f"{name} way": np.abs(np.diff(table)).sum()}
    for predicted in (True, False):
        corners = vars(choose_bandwidths(model, wanted, made.values, predicted=predicted))
        found |= {f"{name}{'' if predicted else ', unpredicted'}": corner for name, corner in corners.items()}
    return {name: float(f"{round(float(one), 15):.6g}") for name, one in found.items()}


def test_the_numbers_of_each_situation_are_as_stored() -> None:
    usual = told({})

    def gives(row: dict[str, Any]) -> dict[str, float]:
        found = told(row)
        return {name: one for name, one in found.items() if one != usual[name] or row.keys() <= {"gives"}}

    hold_rows_against(STORED, gives, rel=1e-4)


def test_each_row_changes_what_a_controller_is_given() -> None:
    rows = json.loads(STORED.read_text(encoding="utf-8"))
    assert all(row["gives"] for row in rows)


# --- the controller takes what it knows of the effects from the ports where they enter, a user's own included


def with_(name: str, **values: float) -> Model:
    added = replace(model(), effects=(catalogue()[name],))
    return added.with_values({f"{name}.{key}": value for key, value in values.items()})


def payload(mass: float) -> float:
    return mass


OWN = Effect(
    name="my-payload",
    title="A payload",
    part="cylinder",
    parameters=(Parameter("mass", "kg", 0.0, 0.0, 100.0, (1.0,)),),
    ports={"mass": payload},
    equation="",
    looks_like="",
    shows_over="a",
    twins=(),
    separate="",
    source="",
)


def test_a_mass_counts_whatever_the_effect_is_called():
    own = replace(model(), effects=(OWN,)).with_values({"my-payload.mass": 3.0})
    bare = model().base_values()["rig.moving_mass"]
    assert moving_mass(own) == pytest.approx(bare + 3.0)
    assert moving_mass(with_("extra-mass", mass=3.0)) == moving_mass(own)


def test_springs_and_weights_pull_toward_the_start_of_the_stroke() -> None:
    spring = with_("spring-force", stiffness=1000.0, rest_position=-0.05)
    assert restoring_force(spring, np.array([0.0, 0.1])) == pytest.approx([50.0, 150.0])
    assert has_restoring_force(spring)
    assert has_restoring_force(with_("constant-force", force=20.0))
    assert not has_restoring_force(model())
    assert not has_restoring_force(
        with_("spring-force", stiffness=1000.0, rest_position=0.01)
    )  # pushes outward at the start


def test_a_design_for_a_valve_that_opens_or_shuts_says_that_it_has_no_pulses() -> None:
    timed = model(["switching-time"], {"switching-time.open": 0.021, "switching-time.close": 0.031})
    (told,) = valve_warnings(timed)
    assert "pulses, which are not designed" in told
    assert "dead times of up to 0.031 s, 0.010 s of it unpredicted" in told
    assert valve_warnings(model()) == []


@pytest.mark.parametrize("name", ["pressure-control", "pump-flow"])
def test_a_design_for_a_command_that_sets_no_area_says_that_its_loops_do_not_hold(name: str) -> None:
    (told,) = valve_warnings(model([name], typical_values([catalogue()[name]])))
    assert told.startswith("the laws ask the valve for an area, which its command does not set")
    assert name in told
