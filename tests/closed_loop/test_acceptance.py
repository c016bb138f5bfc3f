"""The gate: what was asked of the loop, on the model and on axes like it, and why the plant cannot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pneucli.closed_loop import acceptance as gating
from pneucli.closed_loop.acceptance import (
    NOMINAL_AXIS,
    Criterion,
    acceptance_criteria,
    axis_variants,
    check_acceptance,
    limiting_cause,
)
from pneucli.closed_loop.metrics import without_component
from pneucli.closed_loop.scenarios import read_scenarios
from pneucli.messages import design as words
from tests.design import axis

MODEL, CONTROLLER, WANTED = axis.model(), axis.controller(), axis.REQUIREMENTS
SCENARIOS = [s for s in read_scenarios([], CONTROLLER, "") if s.name in gating.ACCEPTANCE_SCENARIOS]
INTERVALS = {"friction.coulomb": (10.0, 30.0), "not.there": (0.0, 1.0), "friction.viscous": (1.0, np.inf)}


def found(wanted=WANTED, controller=CONTROLLER, axes=((NOMINAL_AXIS, MODEL),)):
    return check_acceptance(controller, wanted, SCENARIOS, axis.BENCH, axes)


def test_what_is_asked_by_default_is_kept_and_nothing_is_said() -> None:
    assert found().violations == ()
    assert [d.name for d in found().criteria] == ["tolerance", "no limit cycle"]


def test_axes_are_the_model_both_ends_of_each_interval_and_draws() -> None:
    axes = list(axis_variants(MODEL, INTERVALS, {"friction.coulomb": 2.0}, draws=3))
    assert [name for name, _ in axes] == [NOMINAL_AXIS, "friction.coulomb low", "friction.coulomb high", *3 * ["draws"]]
    assert [m.base_values()["friction.coulomb"] for _, m in axes[1:3]] == [10.0, 30.0]
    assert len({m.base_values()["friction.coulomb"] for _, m in axes[3:]}) == 3


def test_a_controller_that_does_not_come_to_rest_is_stopped() -> None:
    """Without its estimates and its term at standstill the cascade stays where friction leaves it."""
    bare = without_component(CONTROLLER, "all but the map")
    missed = found(controller=bare).violations
    assert missed[0].demand == "tolerance"
    assert missed[0].axis == NOMINAL_AXIS
    assert missed[0].found > missed[0].limit == 2.0 * CONTROLLER.values["C_HOLDING_BAND"]


def test_an_end_of_an_interval_counts_and_few_draws_do_not(monkeypatch: pytest.MonkeyPatch) -> None:
    weak = replace(MODEL, valve=MODEL.valve.scaled(0.1))
    wanted = replace(WANTED, tracking_error=200e-6)
    assert found(wanted, axes=[(NOMINAL_AXIS, MODEL)]).violations == ()
    at_end = found(wanted, axes=[(NOMINAL_AXIS, MODEL), ("valve low", weak)]).violations
    assert [(m.demand, m.axis) for m in at_end if m.demand == "tracking_error"] == [("tracking_error", "valve low")]
    many, few = 3 * [("draws", MODEL)], [("draws", weak)]
    assert found(wanted, axes=[(NOMINAL_AXIS, MODEL), *many, *few]).violations[-1].share == 0.25
    monkeypatch.setattr(gating, "ALLOWED_FAILURE_RATE", 0.25)
    assert found(wanted, axes=[(NOMINAL_AXIS, MODEL), *many, *few]).violations == ()


@pytest.mark.parametrize(
    ("stated", "why"),
    [
        ({"settling_time": 0.01}, "the valve is too small: 60 mm take at least"),
        ({"stiffness": 1e9}, "the valve is too small and the air spring too soft"),
        ({"tracking_error": 1e-6}, ""),
        ({"overshoot": 1e-9}, ""),
    ],
)
def test_what_cannot_be_reached_is_said_with_its_cause(stated: dict[str, float], why: str) -> None:
    (missed,) = found(replace(WANTED, **stated)).violations
    assert missed.demand == next(iter(stated))
    assert missed.cause.startswith(why)
    assert bool(missed.cause) == bool(why)


def test_no_loop_is_stiffer_than_what_valve_and_spring_give_together() -> None:
    """By the deflection of a mass that a ramp of force stops, stepped here in time."""
    c = CONTROLLER.values
    push, rate = gating.nominal_load(c), gating.max_force_rate(c)
    left, x, v, dt = push - c["C_STATIC"], 0.0, 0.0, 1e-6
    for k in range(10_000_000):
        v += dt * (left - rate * k * dt) / c["C_MASS"]
        x += dt * v
        if v <= 0.0:
            break
    assert gating.max_load_stiffness(c) - gating.min_air_stiffness(c) == pytest.approx(push / x, rel=1e-2)
    shown = check_acceptance(
        CONTROLLER, replace(WANTED, stiffness=1e-3), SCENARIOS, axis.BENCH, [(NOMINAL_AXIS, MODEL)]
    )
    assert shown.violations == ()


def test_a_sensor_that_is_too_coarse_is_a_cause_too() -> None:
    coarse = replace(WANTED, quantum_x=20e-6)
    asked = acceptance_criteria(coarse, CONTROLLER)[0]
    cause = limiting_cause(asked.name, asked.limit, CONTROLLER, coarse, SCENARIOS)
    assert words.cause_text(*cause) == "the position sensor is too coarse: 20 um"
    assert limiting_cause(asked.name, asked.limit, CONTROLLER, WANTED, SCENARIOS) == ("", {})


def test_the_spring_is_that_of_both_chambers_of_enclosed_gas() -> None:
    """With no dead volume and equal areas k = gamma p A (1 / x + 1 / (L - x)), least in the middle."""
    known = {
        "C_DEAD_VOLUME_1": 0.0,
        "C_DEAD_VOLUME_2": 0.0,
        "C_AREA_1": 1e-3,
        "C_AREA_2": 1e-3,
        "C_MIRRORED": 1.0,
        "C_P_MEAN": 4e5,
    }
    c = CONTROLLER.with_values(**known, C_STROKE=0.2, C_GAMMA=1.4).values
    assert gating.min_air_stiffness(c) == pytest.approx(1.4 * 4e5 * 1e-3 * 2 / 0.1)


@pytest.mark.parametrize(
    ("value", "at_least", "missed"), [(2.0, False, True), (0.5, False, False), (0.5, True, True), (np.nan, True, False)]
)
def test_a_demand_is_missed_on_its_side_of_the_limit(value: float, at_least: bool, missed: bool) -> None:
    assert Criterion("one", 1.0, "m", lambda _: 0.0, at_least).is_violated(value) == missed
