"""First guesses by linear least squares, restarts and what a start's error becomes, and where rests end."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.identify.guesses import base_model
from pneucli.identify.guesses.base_model import TINY, guess_base_model, guess_friction
from pneucli.identify.guesses.flow_paths import flow_path_data
from pneucli.identify.guesses.valve_areas import guess_gain, guess_map, guess_overlap
from pneucli.identify.residuals import base as initial_state
from pneucli.identify.residuals.chambers import breakaway_velocities, uncertain_direction
from pneucli.physics.gas import CRITICAL_RATIO
from pneucli.recording import Rig
from pneucli.simulate import layout as at
from pneucli.simulate.valve_forms import LinearValve
from tests.simulate.synthetic_experiments import RIG, held_commands, make_experiment, model, time_grid

TIME = time_grid(4.0)
X = 0.1 + 0.03 * np.sin(2 * np.pi * TIME)
V, A = np.gradient(X, TIME), np.gradient(np.gradient(X, TIME), TIME)


def pushed(
    coulomb: float = 12.0, viscous: float = 40.0, mass: float = 2.2, constant: float = 0.0, rig: Rig = RIG
) -> Any:
    """A motion whose pressures balance mass, friction and a constant force; chamber 2 at ambient."""
    force = mass * A + coulomb * np.sign(V) + viscous * V + constant
    p1 = rig.ambient_pressure + force / rig.piston_area_1
    return make_experiment("friction", TIME, {"p1": p1, "p2": rig.ambient_pressure, "x": X, "v": V, "a": A}, rig=rig)


def test_friction_is_guessed_from_the_balance_of_forces() -> None:
    found = guess_friction([pushed()], RIG)
    assert found == {
        "friction.coulomb": pytest.approx(12.0, rel=1e-3),
        "friction.viscous": pytest.approx(40.0, rel=1e-3),
    }


def test_a_constant_force_does_not_lean_on_friction() -> None:
    for constant in (30.0, -30.0):
        found = guess_friction([pushed(constant=constant)], RIG)
        assert found["friction.coulomb"] == pytest.approx(12.0, rel=1e-3)


def test_friction_is_never_guessed_below_zero() -> None:
    found = guess_friction([pushed(coulomb=-5.0, viscous=60.0)], RIG)
    assert found["friction.coulomb"] == pytest.approx(0.0, abs=1e-6)
    assert guess_friction([pushed(coulomb=30.0, viscous=-60.0)], RIG)["friction.viscous"] == pytest.approx(
        0.0, abs=1e-6
    )


def test_an_unknown_mass_is_guessed_too() -> None:
    unknown = replace(RIG, moving_mass=None)
    found = guess_friction([pushed(mass=3.3)], unknown)
    assert found["rig.moving_mass"] == pytest.approx(3.3, rel=1e-3)
    force, moving = -3.0 * A + 12.0 * np.sign(V) + 40.0 * V, np.abs(V) > 0.02 * np.abs(V).max()
    least = 1e-3 * np.abs(force[moving]).max() / np.abs(A[moving]).max()
    assert guess_friction([pushed(mass=-3.0)], unknown)["rig.moving_mass"] == pytest.approx(least, rel=1e-3)


def test_all_recordings_count_and_those_without_position_do_not() -> None:
    blind = replace(pushed(coulomb=1e3), motion_smoother=None)
    assert guess_friction([blind, pushed()], RIG)["friction.coulomb"] == pytest.approx(12.0, rel=1e-3)
    assert guess_friction([blind], RIG) == {}
    mean = guess_friction([pushed(coulomb=10.0), pushed(coulomb=20.0)], RIG)["friction.coulomb"]
    assert mean == pytest.approx(15.0, rel=1e-2)


def test_hardly_any_motion_gives_no_friction() -> None:
    """Below a fiftieth of the largest speed the force is anything."""
    e = pushed()
    e.inputs[np.abs(V) < 0.019 * np.abs(V).max(), at.IN_P1] += 1e6
    assert guess_friction([e], RIG)["friction.coulomb"] == pytest.approx(12.0, rel=1e-2)


def test_the_force_is_that_of_both_pressures_over_ambient_and_of_the_drive() -> None:
    e = make_experiment("axis", TIME, {"p1": 3e5, "p2": 2e5})
    e.inputs[:, at.IN_FORCE] = 7.0
    area_1, area_2 = RIG.piston_areas
    wanted = area_1 * (3e5 - RIG.ambient_pressure) - area_2 * (2e5 - RIG.ambient_pressure) + 7.0
    assert base_model._driving_force(e, RIG)[0] == pytest.approx(wanted)
    assert base_model._driving_force(e, replace(RIG, piston_area_2=None))[0] == pytest.approx(area_1 * 1e5 + 7.0)
    assert base_model._driving_force(e, replace(RIG, piston_area_1=None, piston_area_2=None))[0] == 7.0


# --- the valve


def per_area(u: float, p: float, rig: Rig = RIG) -> float:
    """kg/(s m^2) that an opening makes (2.46), toward the chamber positive."""
    up, down = (rig.supply_pressure, p) if u > 0 else (p, rig.ambient_pressure)
    s = max(down / up - CRITICAL_RATIO, 0.0) / (1.0 - CRITICAL_RATIO)
    k = np.sqrt(2.0 / (rig.gas_constant * rig.gas_temperature))
    return float(np.sign(u) * up * k * 0.484 * np.sqrt(1.0 - s * s))


@pytest.mark.parametrize("u", [5.0, -5.0])
@pytest.mark.parametrize("p", [2e5, 6e5])
def test_flow_is_the_balance_of_mass_and_the_valves_share_of_it_by_area(u: float, p: float) -> None:
    slope = 4e5
    e = make_experiment("axis", TIME, {"u": u, "p1": p + slope * (TIME - 2.0), "x": 0.12, "v": 0.3})
    (shown,) = flow_path_data([e], RIG, 1, 1.0)
    flow, unit = shown.flow, shown.mass_flux
    volume = RIG.dead_volume_1 + RIG.piston_area_1 * 0.12
    gas = RIG.heat_capacity_ratio * RIG.gas_constant * RIG.gas_temperature
    middle = 2000
    assert e.inputs[middle, at.IN_P1] == pytest.approx(p)
    assert flow[middle] == pytest.approx((slope * volume + RIG.heat_capacity_ratio * p * RIG.piston_area_1 * 0.3) / gas)
    assert unit[middle] == pytest.approx(per_area(u, p), rel=1e-6)


def test_a_vessel_has_its_own_volume_and_no_piston() -> None:
    e = make_experiment("valve", TIME, {"u": 5.0, "p1": 2e5 + 1e5 * TIME})
    gas = RIG.heat_capacity_ratio * RIG.gas_constant * RIG.gas_temperature
    assert next(flow_path_data([e], RIG, 1, 3e-4)).flow[2000] == pytest.approx(1e5 * 3e-4 / gas)


AREAS = {u: 2e-7 * (abs(u) - 0.2) ** 1.2 for u in (-8.0, -4.0, -2.0, -1.0, 1.0, 2.0, 4.0, 8.0)}


def driven(levels: list[float], areas: dict[float, float] = AREAS, each: float = 0.5) -> Any:
    """A vessel of 1 l at a pressure that follows the areas exactly, its slope as a smoother would tell it."""
    time = time_grid(each * len(levels))
    u = held_commands(time, levels, each)
    p = np.full(time.size, 3e5)
    slope = np.array([areas[c] * per_area(c, 3e5) for c in u]) * 1.4 * RIG.gas_constant * RIG.gas_temperature / 1e-3
    e = make_experiment("valve", time, {"u": u, "p1": p})
    gas = RIG.heat_capacity_ratio / 1.4
    e.smoothers["p1"] = SimpleNamespace(slope=lambda raw: slope * gas)
    return e


LEVELS = list(AREAS)


def shown(experiments: list[Any], values: dict[str, float]) -> list[Any]:
    """What they show of the paths of chamber 1, of a vessel of a litre unless known."""
    return list(flow_path_data(experiments, RIG, 1, values.get("rig.vessel_volume", base_model.PLACEHOLDER_VOLUME)))


def test_areas_are_guessed_at_the_commands_that_were_held() -> None:
    found = guess_map(shown([driven(LEVELS)], {"rig.vessel_volume": 1e-3}), "valve")
    assert found.commands == tuple(AREAS)
    assert found.areas == pytest.approx(tuple(AREAS.values()), rel=1e-6)
    assert found.overlap_fill == pytest.approx(0.2, abs=0.011)
    assert found.overlap_vent == pytest.approx(0.2, abs=0.011)


def test_a_vessel_of_unknown_volume_counts_as_a_litre() -> None:
    assert guess_map(shown([driven(LEVELS)], {}), "valve").areas == pytest.approx(tuple(AREAS.values()), rel=1e-6)


def test_both_directions_have_their_own_areas_and_overlap() -> None:
    uneven = {u: 2e-7 * (abs(u) - (0.1 if u > 0 else 0.5)) for u in LEVELS}
    found = guess_map(shown([driven(LEVELS, uneven)], {}), "valve")
    assert found.areas == pytest.approx(tuple(uneven.values()), rel=1e-6)
    assert found.overlap_fill == pytest.approx(0.1, abs=0.011)
    assert found.overlap_vent == pytest.approx(0.5, abs=0.011)


def test_five_samples_after_a_jump_of_the_command_are_left_out_on_a_vessel() -> None:
    e = driven(LEVELS)
    spoiled = e.smoothers["p1"].slope(None).copy()
    for jump in range(500, spoiled.size - 1, 500):
        spoiled[jump : jump + 5] = 1e9
    e.smoothers["p1"] = SimpleNamespace(slope=lambda raw: spoiled)
    assert guess_map(shown([e], {}), "valve").areas == pytest.approx(tuple(AREAS.values()), rel=1e-6)


def test_commands_held_only_shortly_get_no_knot_where_enough_are_held_longer() -> None:
    short = [u for u in LEVELS for _ in (0, 1)]
    e = driven(short, AREAS | {3.0: 1e-6, -3.0: 1e-6}, 0.25)
    brief = e.inputs[:, at.IN_U].copy()
    brief[-38:-19], brief[-19:] = 3.0, -3.0  # of 4000 samples, 20 make a knot
    e.inputs[:, at.IN_U] = brief
    assert guess_map(shown([e], {}), "valve").commands == tuple(AREAS)


def test_readings_of_a_command_that_scatter_by_less_than_a_ten_thousandth_are_one_level() -> None:
    """0.8 mV of 8 V; each of the many readings by itself would be held for a moment only."""
    time = time_grid(4.0)
    u = held_commands(time, LEVELS, 0.5)
    read = u + np.random.default_rng(1).uniform(-2e-4, 2e-4, time.size)
    e = make_experiment("axis", time, {"u": read, "p1": 3e5, "x": 0.1, "v": 0.0})
    gas = RIG.heat_capacity_ratio * RIG.gas_constant * RIG.gas_temperature
    volume = RIG.dead_volume_1 + RIG.piston_area_1 * 0.1
    slope = np.array([AREAS[c] * per_area(c, 3e5) for c in u]) * gas / volume
    e.smoothers["p1"] = SimpleNamespace(slope=lambda raw: slope)
    found = guess_map(shown([e], {}), "valve")
    assert found.commands == pytest.approx(tuple(AREAS), rel=1e-3)
    assert found.areas == pytest.approx(tuple(AREAS.values()), rel=1e-3)


def test_neighbouring_commands_share_a_knot() -> None:
    """ln(2.2 / 2) = 0.1 is nearer than 0.2; the longer held one has it."""
    both = AREAS | {2.2: 3e-7}
    found = guess_map(shown([driven([*LEVELS, 2.0, 2.2], both)], {}), "valve")
    assert found.commands == tuple(AREAS)


def test_a_command_that_is_never_held_has_knots_of_its_own() -> None:
    """A closed loop: areas are means over a tenth either side of usual commands."""
    time = time_grid(20.0)
    u = np.round(12.0 * np.sin(2 * np.pi * 0.3 * time), 6)
    e = make_experiment("axis", time, {"u": u, "p1": 3e5, "x": 0.1})
    gas = RIG.heat_capacity_ratio * RIG.gas_constant * RIG.gas_temperature
    volume = RIG.dead_volume_1 + RIG.piston_area_1 * 0.1
    slope = np.array([1e-9 * abs(c) ** 3 * (per_area(c, 3e5) if c else 0.0) for c in u]) * gas / volume
    e.smoothers["p1"] = SimpleNamespace(slope=lambda raw: slope)
    found = guess_map(shown([e], {}), "valve")
    assert [c for c in found.commands if c > 0] == pytest.approx([0.6, 1.2, 2.4, 4.2, 6.0, 9.0, 12.0])
    inner = found.commands[1:-1]  # at the ends there is only one side
    assert found.areas[1:-1] == pytest.approx(tuple(1e-9 * abs(c) ** 3 for c in inner), rel=0.04)


def test_a_linear_valve_has_one_gain() -> None:
    straight = {u: 3e-7 * abs(u) for u in LEVELS}
    assert guess_gain(shown([driven(LEVELS, straight)], {}), "valve").gain == pytest.approx(3e-7)
    assert guess_gain(shown([driven(LEVELS, dict.fromkeys(LEVELS, -1e-7))], {}), "valve").gain == TINY


@pytest.mark.parametrize("overlap", [0.0, 0.3, 0.8])
@pytest.mark.parametrize("exponent", [0.8, 1.5])
def test_an_overlap_makes_areas_a_power_law(overlap: float, exponent: float) -> None:
    commands = np.array([1.0, 2.0, 4.0, 8.0])
    assert guess_overlap(commands, 3e-7 * (commands - overlap) ** exponent) == pytest.approx(overlap, abs=0.011)


def test_two_areas_tell_no_overlap() -> None:
    assert guess_overlap(np.array([1.0, 2.0]), np.array([1e-7, 3e-7])) == 0.0


def test_the_first_guess_uses_each_experiment_for_its_own_subsystem() -> None:
    found = guess_base_model([driven(LEVELS), pushed()], RIG)
    assert found.effects == ()
    assert found.values["friction.coulomb"] == pytest.approx(12.0, rel=1e-3)
    assert found.values["rig.vessel_volume"] == 1e-3
    assert found.valve.commands == tuple(AREAS)
    known = guess_base_model([driven(LEVELS)], replace(RIG, vessel_volume=2e-3), "linear")
    assert known.values == {"rig.vessel_volume": 2e-3}
    assert isinstance(known.valve, LinearValve)
    shut = replace(driven(LEVELS), recording=replace(driven(LEVELS).recording, valve_shut=True))
    assert guess_base_model([pushed(), shut], RIG).valve.commands == ()


# --- restarts


STARTS = np.array([0, 300, 700])
ERROR = np.concatenate([np.linspace(2.0, 1.0, 300), np.linspace(0.5, 0.4, 400), np.zeros(300)])


def covariance(first: int, last: int) -> np.ndarray:
    e = ERROR[first:last]
    return np.eye(e.size) + np.outer(e, e)


def test_with_several_errors_the_squares_are_those_of_the_inverse_covariance_and_the_volume_its_determinant() -> None:
    """Errors that are far from orthogonal: R'R of the whitened residual R is r' C^-1 r with C = I + sum of e e'."""
    rng = np.random.default_rng(2)
    several = np.vstack([ERROR, 3.0 * ERROR + rng.standard_normal(1000), rng.standard_normal(1000)])
    residual = rng.standard_normal(1000)
    found, volume = (
        initial_state.apply_whitening(residual, several, STARTS),
        initial_state.log_determinant(several, STARTS),
    )
    for first, last in ((0, 300), (300, 700), (700, 1000)):
        e, r = several[:, first:last], residual[first:last]
        covariance = np.eye(last - first) + e.T @ e
        assert found[first:last] @ found[first:last] == pytest.approx(r @ np.linalg.solve(covariance, r), rel=1e-9)
        assert volume[first:last].sum() == pytest.approx(np.linalg.slogdet(covariance)[1], rel=1e-9)


def test_without_any_error_nothing_is_whitened() -> None:
    none, residual = np.zeros((0, 1000)), np.arange(1000.0)
    assert initial_state.apply_whitening(residual, none, STARTS) == pytest.approx(residual)
    assert not initial_state.log_determinant(none, STARTS).any()


class Read:
    """An experiment whose readings, smoothed, err by noise that falls to a half, and by its slope."""

    channels = ("p1", "p2")

    def __init__(self) -> None:
        self.smoothers = dict.fromkeys(self.channels, lambda noise: 0.5 * noise)
        self.time = 1e-3 * np.arange(4000)
        self.restarts = np.arange(0, 4000, 10)
        self.inputs = np.full((4000, len(at.INPUTS)), 3e5)
        self.noise = {c: SimpleNamespace(rms=50.0) for c in self.channels}
        self.recent_sensitivities: dict[tuple[object, ...], np.ndarray] = {}

    def draw_noise(self, rng: np.random.Generator) -> dict[str, np.ndarray]:
        return {"p1": rng.standard_normal(4000), "p2": 3.0 * rng.standard_normal(4000)}


def test_initial_state_errors_are_the_smoothed_noise() -> None:
    """White noise of 1 (3), of which the smoother leaves a half: 1.4 times that."""
    found = initial_state.initial_state_errors(Read())  # type: ignore[arg-type]
    assert found["p1"] == pytest.approx(0.7, rel=0.03)
    assert found["p2"] == pytest.approx(0.7 * 3.0, rel=0.03)


def test_an_initial_error_persists_as_the_model_keeps_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """A model that keeps half of an error of p1 and none of p2."""
    monkeypatch.setattr(
        initial_state,
        "simulate",
        lambda model, e, inputs=None: {
            "p1": 0.5 * (e.inputs if inputs is None else inputs)[:, at.IN_P1] + 7.0, "p2": np.full(4000, 9.0),
        },
    )  # fmt: skip
    errors = {"p1": 100.0, "p2": 100.0}
    e: Any = Read()
    found = initial_state.initial_state_sensitivity(model(), e, errors)
    assert found["p1"] == pytest.approx(np.full((1, 4000), 0.5 * 100.0 / 50.0))
    assert found["p2"] == pytest.approx(np.zeros((1, 4000)))


@pytest.mark.parametrize(
    "changed",
    [
        {"smoothers": {"p2": 1}},
        {"channels": ("p2",)},
        {"noise": {c: SimpleNamespace(rms=50.0 * (c == "p2")) for c in ("p1", "p2")}},
    ],
)
def test_unsmoothed_noiseless_or_absent_pressures_have_no_initial_error(
    monkeypatch: pytest.MonkeyPatch, changed: dict[str, Any]
) -> None:
    monkeypatch.setattr(
        initial_state, "simulate", lambda model, e, inputs=None: {c: np.zeros(4000) for c in ("p1", "p2")}
    )
    e: Any = Read()
    for name, value in changed.items():
        setattr(e, name, value)
    assert list(initial_state.initial_state_sensitivity(model(), e, dict.fromkeys(("p1", "p2"), 1.0))) == ["p2"]


# --- rests


def test_a_break_away_has_the_direction_of_the_motion_and_at_least_a_creep() -> None:
    for sign in (1.0, -1.0):
        smoothed = sign * np.concatenate([np.zeros(40), 1e-3 * np.arange(1, 60)])
        v = np.where(np.abs(smoothed) < 0.5e-3, 0.0, smoothed)
        leaving = breakaway_velocities(v, smoothed, 0.2e-3, 20)
        assert np.flatnonzero(leaving).tolist() == [39]
        assert leaving[39] == sign * 1e-9


def test_a_velocity_that_never_was_below_the_threshold_leaves_at_the_last_rest() -> None:
    smoothed = np.full(100, 1e-3)
    v = np.where(np.arange(100) < 50, 0.0, 2e-3)
    assert np.flatnonzero(breakaway_velocities(v, smoothed, 0.5e-3, 20)).tolist() == [49]
    assert breakaway_velocities(v, smoothed, 0.5e-3, 20)[49] == 1e-3


@pytest.mark.parametrize(("rest", "found"), [(20, False), (21, True)])
def test_twenty_samples_before_the_last_must_rest(rest: int, found: bool) -> None:
    v = np.concatenate([np.ones(30), np.zeros(rest), np.ones(40)])
    assert bool(breakaway_velocities(v, v, 0.5, 20).any()) == found


@pytest.mark.parametrize(("moving", "found"), [(19, False), (20, True)])
def test_twenty_samples_after_it_must_move_one_way(moving: int, found: bool) -> None:
    v = np.concatenate([np.zeros(40), np.ones(moving), -np.ones(40)])
    assert bool(breakaway_velocities(v, v, 0.5, 20).any()) == found


def test_five_samples_about_each_reversal_and_at_both_ends_are_uncertain() -> None:
    v = np.concatenate([np.ones(50), -np.ones(50)])
    doubtful = uncertain_direction(v, np.zeros(100), 5)
    assert np.flatnonzero(doubtful).tolist() == [*range(5), *range(45, 55), *range(95, 100)]


def test_samples_after_a_break_away_are_uncertain_until_the_piston_certainly_moves() -> None:
    v = np.concatenate([np.zeros(60), np.ones(40)])
    leaving = np.zeros(100)
    leaving[40] = 1e-9
    assert np.flatnonzero(uncertain_direction(v, leaving, 5)).tolist() == [*range(5), *range(41, 65), *range(95, 100)]
