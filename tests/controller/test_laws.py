"""The laws of the bench: each does what its equations say, in numbers that can be checked by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest

from pneucli.closed_loop.metrics import COMPONENTS, compare_laws, evaluate_run, without_component
from pneucli.closed_loop.scenarios import read_scenarios
from pneucli.closed_loop.simulation import simulate
from pneucli.controller import layout as at
from pneucli.controller import observers, plant, valve_dynamics
from pneucli.controller.laws import LAWS, compensated, find_law, load_observer, pdc, pid, relay, sector, shared_blocks
from pneucli.controller.laws.base import callees_first, own_constants
from pneucli.design import effect_compensation
from pneucli.design.bandwidths import choose_bandwidths
from pneucli.design.cascade_design import design_cascade
from pneucli.design.control_laws import controller_for, design_controllers, design_variants, sliding_surfaces
from pneucli.design.gains import ackermann_gains
from pneucli.design.requirements import read_requirements
from pneucli.design.sliding import axis_systems
from pneucli.errors import InputError
from pneucli.physics.effects import catalogue
from pneucli.physics.vectorised import stribeck_friction
from pneucli.simulate import layout as out
from tests.design import axis

MODEL, MADE = axis.bench_of_laws()
PLAN = axis.plan()
V = PLAN.cascade.values
MASS, T = V["C_MASS"], V["C_PERIOD"]
assert PLAN.scheduled is not None
TP, PDC = PLAN.scheduled


def state(**given: float) -> np.ndarray:
    s = np.zeros(at.L_STATES)
    known = {"STARTED": 1.0, "X": 0.1, "X_SHAPED": 0.1, "P1": 3e5, "P2": 3e5, "BREAKAWAY_FORCE": V["C_STATIC"]}
    for name, value in (known | given).items():
        s[at.STATE.index(f"S_{name}")] = value
    return s


def numbers(law: str, **changed: float) -> np.ndarray:
    return MADE[law].with_values(**changed).vector()


def by_equation(v: float) -> float:
    """Friction in N at a speed (3.6), by the physics' own function; its sign fades as the law's does."""
    level = stribeck_friction(np.array([abs(v)]), V["C_COULOMB"], 0.0, V["C_STATIC"], V["C_STRIBECK"])[0]
    return float(level * np.clip(v / V["C_V_FLOOR"], -1, 1) + V["C_VISCOUS"] * v)


# --- the table of laws


def test_the_table_has_the_laws_of_the_interface_and_the_projects_own_is_the_default() -> None:
    assert set(LAWS) == {"pid", "pid-feedforward", "relay", "sector", "compensated", "pdc", "best"}
    assert next(iter(LAWS)) == "best"


def test_a_law_that_is_misspelt_is_mended() -> None:
    with pytest.raises(InputError, match=r"(?s)--compare: 'realy'.*relay"):
        find_law("realy", "--compare")
    with pytest.raises(InputError, match=r"design\.controller"):
        read_requirements({"controller": "pd"}, "file, key design")


@pytest.mark.parametrize("law", LAWS)
def test_every_law_has_a_place_for_each_of_its_own_numbers_and_states(law: str) -> None:
    one = LAWS[law]
    places = [one.constants[name] for name in one.parameters]
    assert places == list(range(at.FIRST_LAW_PARAMETER, at.FIRST_LAW_PARAMETER + len(places)))
    assert [one.constants[n] for n in one.states] == list(
        range(at.FIRST_LAW_STATE, at.FIRST_LAW_STATE + len(one.states))
    )
    assert len(one.states) <= at.MAX_LAW_STATES
    assert len(MADE[law].own) >= len(places)
    assert MADE[law].law == law


def test_the_compiled_text_has_the_constants_of_all_laws_in_the_order_of_their_functions_in_every_process() -> None:
    for law in LAWS.values():
        names = (own_constants(f.__globals__) for f in callees_first(law.step))
        assert list(law.constants) == list(dict.fromkeys(name for one in names for name in one))


def test_best_is_the_cascade_as_it_was() -> None:
    assert MADE["best"] == PLAN.cascade


def test_what_a_plan_lacks_is_said_and_the_other_laws_are_made() -> None:
    poor = replace(PLAN, scheduled=None, missing={"scheduled": "cvxpy is not installed"})
    made, failed = design_controllers(poor)
    assert set(failed) == {"pdc"}
    assert "cvxpy is not installed" in failed["pdc"]
    assert set(made) == set(LAWS) - set(failed)


def test_a_law_is_compared_with_the_variants_that_are_not_selected() -> None:
    assert set(design_variants(PLAN, LAWS)) == {"relay, switching", "compensated, friction in the observer"}
    other = replace(PLAN, requirements=replace(PLAN.requirements, relay="switching", friction_in_observer=True))
    assert set(design_variants(other, ["relay"])) == {"relay, implicit"}


# --- each law by its equation


def test_the_pid_is_error_rate_and_integral_and_nothing_ahead() -> None:
    s = state(X_SHAPED=0.101, V_SHAPED=0.02, A_SHAPED=0.7, V=0.015, INTEGRAL=3.0)
    force = pid.pid_force(s, numbers("pid"))
    integral = 3.0 + T * MASS * V["C_KI"] * 1e-3
    assert force == pytest.approx(MASS * (V["C_KD"] * 0.005 + V["C_KP"] * 1e-3) + integral)


def test_with_feed_forward_the_references_own_force_comes_on_top() -> None:
    alone, ahead = (
        pid.pid_force(state(X_SHAPED=0.101, V_SHAPED=0.02, A_SHAPED=0.7, V=0.02), numbers(law))
        for law in ("pid", "pid-feedforward")
    )
    assert ahead - alone == pytest.approx(MASS * 0.7 + by_equation(0.02))


def test_on_the_line_the_relay_gives_the_equivalent_control_alone() -> None:
    """ds/dt = 0 (5.9): the force that keeps x2 + lambda x1 = 0, friction included."""
    slope, x2 = PLAN.surface_slope, 0.01
    s = state(X_SHAPED=0.1 - x2 / slope, V_SHAPED=0.03 + x2, V=0.03, A_SHAPED=0.4)
    assert relay.relay_force(s, numbers("relay")) == pytest.approx(MASS * (0.4 + slope * x2) + by_equation(0.03))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_off_the_line_the_relay_is_all_of_m_and_near_it_what_one_sample_needs(side: float) -> None:
    """The implicit sign: s+ = s - T w / m is zero where |w| < M allows it."""
    c = numbers("relay")
    far, near = (relay.relay_force(state(X_SHAPED=0.1 + side * off), c) for off in (0.1, 1e-5))
    assert far == pytest.approx(side * PLAN.switching_force)
    assert PLAN.surface_slope * side * 1e-5 - T * near / MASS == pytest.approx(0.0, abs=1e-15)


def test_a_relay_without_equivalent_control_is_the_sign_alone() -> None:
    plan = replace(PLAN, requirements=replace(PLAN.requirements, equivalent_control=False))
    c = controller_for("relay", plan).vector()
    assert relay.relay_force(state(X_SHAPED=0.2, V_SHAPED=0.3, A_SHAPED=2.0), c) == pytest.approx(PLAN.switching_force)


def test_the_line_of_the_relay_is_by_poles_or_by_stated_weights() -> None:
    mechanical = axis_systems(V, 0.1, 3e5, 3e5)["mechanical"]
    corners = choose_bandwidths(MODEL, PLAN.requirements, V)
    wanted = replace(PLAN.requirements, surface="lq", surface_weights=(2500.0, 1.0))
    poles, lq = sliding_surfaces(mechanical, corners, wanted)
    assert (poles.taken, lq.taken) == (False, True)
    assert poles.slope == pytest.approx(corners.position)
    assert lq.slope == pytest.approx(math.sqrt(2500.0))  # x1' = x2: the root of the weights' ratio


def test_a_switching_relay_is_the_sign_of_the_reading() -> None:
    plan = replace(PLAN, requirements=replace(PLAN.requirements, relay="switching"))
    c = controller_for("relay", plan).vector()
    for side in (1.0, -1.0):
        force = relay.relay_force(state(X_SHAPED=0.1 + side * 1e-9), c)
        assert force == pytest.approx(side * PLAN.switching_force)
    assert relay.relay_force(state(), c) == 0.0


SECTOR = dict(zip(LAWS["sector"].parameters, MADE["sector"].own, strict=True))


def test_the_steeper_line_of_the_sector_is_the_corner_of_the_position_loop() -> None:
    assert SECTOR["C_LAMBDA_2"] == pytest.approx(PLAN.bandwidths.position)
    assert SECTOR["C_LAMBDA_2"] / SECTOR["C_LAMBDA_1"] == pytest.approx(PLAN.requirements.sector_ratio)
    assert SECTOR["C_VERTEX_1"] == pytest.approx(V["C_VISCOUS"] / MASS)


def test_the_sectors_lines_lie_as_far_apart_as_the_vertices_of_the_stated_eta() -> None:
    """lambda2 - lambda1 = a2 - a1 (6.17) with a22(0) = (Fs eta / 2 + Fv) / m (6.22)."""
    plan = replace(PLAN, requirements=replace(PLAN.requirements, eta=8.0, sector_ratio=3.0))
    made = controller_for("sector", plan)
    own = dict(zip(LAWS["sector"].parameters, made.own, strict=True))
    assert own["C_LAMBDA_2"] - own["C_LAMBDA_1"] == pytest.approx(V["C_STATIC"] * 8.0 / 2.0 / MASS)
    assert own["C_LAMBDA_2"] / own["C_LAMBDA_1"] == pytest.approx(3.0)


def test_a_model_without_dry_friction_has_no_sector() -> None:
    smooth = replace(PLAN, cascade=PLAN.cascade.with_values(C_STATIC=0.0))
    _, failed = design_controllers(smooth, ["sector"])
    assert "no dry friction" in failed["sector"]


@pytest.mark.parametrize(("x1", "v"), [(1e-3, 0.05), (-2e-4, 0.1), (5e-6, -1e-4), (-3e-2, 0.0), (1e-7, 1e-6)])
def test_the_sectors_force_is_its_law_at_the_end_of_the_sample(x1: float, v: float) -> None:
    """With the rate y that the force leads to, the force is equivalent (6.16) plus switching (5.13) of y."""
    c, s = numbers("sector"), state(X=0.1 + x1, V=v)
    y = sector.implicit_error_rate(x1, v, s, c)
    lower, upper = (c[LAWS["sector"].constants[n]] for n in ("C_LAMBDA_1", "C_LAMBDA_2"))
    force = sector.sector_force(s, c)
    s1, s2 = (y + line * (x1 + T * y) for line in (lower, upper))
    switching = -PLAN.switching_force * (s1 + s2) / (abs(s1) + abs(s2))
    assert force == pytest.approx(MASS * (SECTOR["C_VERTEX_1"] - lower) * y + switching, rel=1e-6, abs=1e-6)
    friction = MASS * (v - y) / T + force - MASS * SECTOR["C_VERTEX_1"] * y  # what the piston's balance leaves for it
    level = sector.dry_friction(abs(v), s, c)
    assert abs(friction) <= level * (1 + 1e-6)
    if abs(y) > 1e-9:
        assert friction == pytest.approx(math.copysign(level, y), rel=1e-3)


def test_a_sector_pushes_a_piston_that_sticks_with_all_of_m() -> None:
    c = controller_for("sector", replace(PLAN, requirements=replace(PLAN.requirements, switching_gain=0.1))).vector()
    assert sector.sector_force(state(X=0.1 - 1e-3), c) == pytest.approx(PLAN.switching_force / 15.0, rel=1e-6)


def test_the_observer_estimates_the_unmodelled_force_within_m_k_a_sample() -> None:
    """The reading moves as 7 N more would move it: in the end these 7 N are the equivalent value (5.20)."""
    c, rate = numbers("compensated"), LAWS["compensated"].constants["S_UNFILTERED_SPEED"]
    s = state(P1=V["C_AMBIENT"], P2=V["C_AMBIENT"])
    for k in range(400):
        s[rate] = 7.0 / V["C_VISCOUS"] * (1.0 - math.exp(-V["C_VISCOUS"] / MASS * T * k))
        load_observer.observe_load(s, c)
    assert s[at.S_LOAD] == pytest.approx(7.0, rel=0.01)
    s = state(P1=V["C_AMBIENT"], P2=V["C_AMBIENT"])
    s[rate] = 100.0
    load_observer.observe_load(s, c)
    share = 1.0 - math.exp(-PLAN.bandwidths.position * T)
    assert s[at.S_LOAD] == pytest.approx(share * PLAN.switching_force)  # (5.21)


def test_an_observer_with_friction_leaves_friction_out_of_the_load() -> None:
    """A steady speed under the force that friction takes there: the load is zero, without friction it is friction."""
    v = 0.05
    friction = by_equation(v) - V["C_VISCOUS"] * v
    known = controller_for(
        "compensated", replace(PLAN, requirements=replace(PLAN.requirements, friction_in_observer=True))
    )
    loads = []
    for c in (known.vector(), numbers("compensated")):
        s = state(P1=V["C_AMBIENT"] + by_equation(v) / V["C_AREA_1"], P2=V["C_AMBIENT"], V=v)
        for name in ("S_UNFILTERED_SPEED", "S_OBSERVED_V"):
            s[LAWS["compensated"].constants[name]] = v
        for _ in range(500):
            load_observer.observe_load(s, c)
        loads.append(float(s[at.S_LOAD]))
    assert loads == pytest.approx([0.0, -friction], abs=0.01)


def test_an_observer_with_friction_keeps_its_estimate_while_the_piston_sticks() -> None:
    plan = replace(PLAN, requirements=replace(PLAN.requirements, friction_in_observer=True))
    c = controller_for("compensated", plan).vector()
    s = state(P1=V["C_AMBIENT"] + 0.9 * V["C_STATIC"] / V["C_AREA_1"], P2=V["C_AMBIENT"])
    load_observer.observe_load(s, c)
    assert s[at.S_LOAD] == 0.0
    s = state(P1=V["C_AMBIENT"] + 1.1 * V["C_STATIC"] / V["C_AREA_1"], P2=V["C_AMBIENT"])
    load_observer.observe_load(s, c)
    assert s[at.S_LOAD] < 0.0


def test_the_bound_of_the_pressure_observer_is_the_largest_motion_term_of_the_rig() -> None:
    """M_k of (5.21): kappa p A v / V at the smallest volume, both chambers where one valve moves both."""
    c = MADE["compensated"].values
    x = np.linspace(0.0, V["C_STROKE"], 2001)
    one = V["C_AREA_1"] / (V["C_DEAD_VOLUME_1"] + V["C_AREA_1"] * x)
    two = V["C_AREA_2"] ** 2 / V["C_AREA_1"] / (V["C_DEAD_VOLUME_2"] + V["C_AREA_2"] * (V["C_STROKE"] - x))
    largest = np.max(one + two) * V["C_GAMMA"] * V["C_P_HIGH"] * V["C_V_MAX"]
    assert c["C_FLOW_STEP_MAX"] == pytest.approx(largest, rel=1e-3)


def test_the_pressures_observer_finds_a_foreign_flow() -> None:
    c, seen = numbers("compensated"), LAWS["compensated"].constants["S_OBSERVED_P1"]
    s = state()
    s[seen] = 3e5
    for k in range(1, 600):
        compensated.observe_flow(3e5 + T * k * 5e4, 2e4, seen, at.S_FLOW1, s, c)
    assert s[at.S_FLOW1] == pytest.approx(3e4, rel=0.01)


@pytest.mark.parametrize(("v", "x"), [(0.0, 0.1), (0.03, 0.09), (-0.2, 0.15), (0.05, 0.02)])
def test_the_pdc_weighs_the_vertices_gains_as_the_tp_model_does(v: float, x: float) -> None:
    s = state(X=x, V=v, X_SHAPED=0.1, P1=3.2e5)
    w_v, w_x = TP.weights_at(np.clip(v, -V["C_V_MAX"], V["C_V_MAX"]), np.clip(x, *TP.grids[1][[0, -1]]))
    gain = np.tensordot(np.outer(w_v, w_x).ravel(), PDC.gains, axes=1)[0]
    force = V["C_AREA_1"] * 3.2e5 - V["C_AREA_2"] * 3e5 - (V["C_AREA_1"] - V["C_AREA_2"]) * V["C_AMBIENT"]
    assert pdc.pdc_flow(s, numbers("pdc")) == pytest.approx(-float(gain @ [x - 0.1, v, force]), rel=1e-9)


def test_every_vertex_loop_of_the_pdc_decays_at_the_rate_that_is_told() -> None:
    a, b = TP.systems[:, :, :3], TP.systems[:, :, 3:]
    assert all(np.linalg.eigvals(a[r] - b[r] @ PDC.gains[r]).real.max() <= -PDC.rate for r in range(len(a)))


# --- readings


def test_the_speed_is_the_filtered_rate_of_position_and_a_lost_reading_is_bridged() -> None:
    c, s = numbers("pid"), state(V=0.2)
    shared_blocks.read_sensors(0.1, 0.1001, 3.1e5, 2.9e5, s, c)
    share = 1.0 - math.exp(-PLAN.bandwidths.motion_observer * T)
    assert s[at.S_V] == pytest.approx(0.2 + share * (0.1 - 0.2))
    assert (s[at.S_X], s[at.S_P1], s[at.S_P2]) == (0.1001, 3.1e5, 2.9e5)
    speed = s[at.S_V]
    shared_blocks.read_sensors(0.1, math.nan, math.nan, -1.0, s, c)
    assert s[at.S_X] == pytest.approx(0.1001 + T * speed)
    assert (s[at.S_P1], s[at.S_P2]) == (3.1e5, 2.9e5)


# --- in the loop


@pytest.mark.parametrize("arrangement", axis.ARRANGEMENTS)
@pytest.mark.parametrize("law", LAWS)
def test_every_law_moves_the_piston_the_right_way_whatever_the_valves(law: str, arrangement: str) -> None:
    """A step up and a step down, by half of the way at least."""
    model, made = axis.bench_of_laws(arrangement)
    time = 1e-3 * np.arange(2500)
    for side in (1.0, -1.0):
        moved = simulate(model, made[law], axis.scenario(made[law], 0.1 + side * 0.03 * (time > 0.1)), axis.BENCH)
        assert side * (moved.model[-1, out.X] - 0.1) > 0.015
        assert np.isfinite(moved.model[:, out.X]).all()
    assert (np.abs(moved.log[:, at.L_U2]).max() > 0.0) == (arrangement == "two")


def test_the_pressure_loop_alone_follows_a_pressure_with_the_piston_clamped() -> None:
    (scene,) = (s for s in read_scenarios([], MADE["pid"], "") if s.controls_pressure)
    for law in (name for name, one in LAWS.items() if one.controls_pressure):
        result = simulate(MODEL, MADE[law], scene, axis.BENCH)
        assert np.ptp(result.model[:, out.X]) == 0.0
        found = evaluate_run(result, MODEL, MADE[law])
        assert found.pressure_rest_pa < 1500.0
        assert np.isnan(found.steady_um)
        assert found.air_kg > 0.0


def test_a_law_without_pressure_loop_has_no_figures_of_it() -> None:
    scenes = [s for s in read_scenarios([], MADE["pid"], "") if s.name in ("s-curve", "pressure")]
    found = compare_laws(MODEL, {n: MADE[n] for n in ("pid", "pdc")}, scenes, axis.BENCH)
    assert [list(by) for by in found.values()] == [["s-curve", "pressure"], ["s-curve"]]


def test_only_laws_with_an_estimate_are_judged_by_it() -> None:
    (scene,) = (s for s in read_scenarios([], MADE["pid"], "") if s.name == "load")
    told = {n: evaluate_run(simulate(MODEL, c, scene, axis.BENCH), MODEL, c).load_error for n, c in MADE.items()}
    assert {n for n, value in told.items() if not math.isnan(value)} == {"best", "compensated", "sector"}
    assert told["sector"] < 0.05


@pytest.mark.parametrize(("law", "steady", "cycle"), [("sector", 5.0, 5.0), ("compensated", 100.0, 10.0)])
def test_a_law_rests_within_micrometres_without_a_limit_cycle(law: str, steady: float, cycle: float) -> None:
    (steps,) = (s for s in read_scenarios([], MADE[law], "") if s.name == "steps")
    found = evaluate_run(simulate(MODEL, MADE[law], steps, axis.BENCH), MODEL, MADE[law])
    assert found.steady_um < steady
    assert found.cycle_um < cycle


def test_each_component_is_taken_out_alone() -> None:
    whole = MADE["best"]
    for name, switches in COMPONENTS.items():
        left = without_component(whole, name)
        assert {n for n in whole.values if left.values[n] != whole.values[n]} == set(switches)
    assert without_component(whole, "nothing") == whole


def test_a_plan_takes_the_sliding_force_from_friction_and_a_usual_load() -> None:
    plan = replace(PLAN, requirements=replace(PLAN.requirements, switching_gain=2.0))
    supply = 0.1 * V["C_AREA_1"] * (V["C_SUPPLY"] - V["C_AMBIENT"])
    assert plan.switching_force == pytest.approx(2.0 * (V["C_STATIC"] + supply))


# --- what a model has learned reaches the controller: play, lag, delay, leaks, sensors, friction, by the ports


VALVE_DYNAMICS_MODEL, PLAIN = axis.model(), axis.controller()
SIZES = {
    "valve-lag": {"time_constant": 0.017}, "valve-hysteresis": {"half_width": 0.2}, "valve-deadband": {"width": 0.8},
    "line-delay": {"delay": 0.011}, "pressure-lag": {"time_constant": 0.012}, "time-skew": {"delay": 0.012},
    "pressure-scale": {"scale": 1.05}, "pressure-offset": {"offset": 1e4}, "chamber-leak": {"area": 3e-8},
    "piston-leak": {"area": 3e-8}, "valve-leak": {"area": 3e-8}, "dead-volume": {"volume_added": 1e-5},
    "extra-mass": {"mass": 1.0}, "constant-force": {"force": 10.0}, "critical-ratio": {"critical_ratio": 0.3},
    "pressure-friction": {"gain": 0.2}, "position-friction": {"from": 0.08, "to": 0.1, "gain": 1.5},
    "friction-hysteresis": {"drop": 0.4}, "friction-asymmetry": {"asymmetry": 0.2, "viscous_asymmetry": 0.1},
    "end-cushion": {"length": 0.06, "damping": 200.0}, "spring-force": {"stiffness": 200.0, "rest_position": 0.1},
}  # fmt: skip


def having(effect: str):
    values = {f"{effect}.{name}": value for name, value in SIZES[effect].items()}
    return replace(VALVE_DYNAMICS_MODEL, effects=(*VALVE_DYNAMICS_MODEL.effects, catalogue()[effect])).with_values(
        values
    )


def valve_dynamics_numbers(effect: str) -> np.ndarray:
    return design_cascade(having(effect), axis.REQUIREMENTS, axis.SEALED).vector()


@pytest.mark.parametrize("effect", SIZES)
def test_an_effect_of_mechanics_or_pneumatics_changes_the_controller(effect: str) -> None:
    assert not np.array_equal(valve_dynamics_numbers(effect), PLAIN.vector())


def test_play_lag_and_overlap_are_found_by_driving_the_command() -> None:
    assert effect_compensation.identify_spool(having("valve-hysteresis")).play_half_width == pytest.approx(
        0.2, rel=1e-6
    )
    assert effect_compensation.identify_spool(having("valve-lag")).lag == pytest.approx(0.017, rel=1e-3)
    found = effect_compensation.identify_spool(having("valve-deadband"))
    assert np.interp([0.3, 1.4], found.commands, found.openings) == pytest.approx([0.0, 1.0], abs=1e-9)
    assert (found.play_half_width, found.lag) == (0.0, pytest.approx(0.0, abs=1e-9))


@pytest.mark.parametrize("effect", ["valve-lag", "valve-hysteresis"])
def test_the_command_undoes_lag_and_play_as_far_as_it_is_asked_to(effect: str) -> None:
    c, s = valve_dynamics_numbers(effect), np.zeros(at.L_STATES)
    for wanted in (0.5, -0.3, 0.1, 0.8):
        before = s[at.S_SPOOL1]
        u = valve_dynamics.compensate_valve_dynamics(wanted, 0.0, at.S_PLAY1, at.S_SPOOL1, -10.0, 10.0, s, c)
        valve_dynamics.apply_valve_dynamics(u, at.S_PLAY1, at.S_SPOOL1, s, c)
        assert s[at.S_SPOOL1] - before == pytest.approx(c[at.C_SPOOL_LEAD] * (wanted - before), abs=1e-12)


def test_little_does_not_move_the_play() -> None:
    c, s = valve_dynamics_numbers("valve-hysteresis"), np.zeros(at.L_STATES)
    assert (
        valve_dynamics.compensate_valve_dynamics(
            0.9 * c[at.C_PLAY_DEADBAND], 0.123, at.S_PLAY1, at.S_SPOOL1, -10.0, 10.0, s, c
        )
        == 0.123
    )


@pytest.mark.parametrize("wait", [0.0, 1.0, 2.5])
def test_a_row_gives_back_what_was_put_in_so_many_samples_ago(wait: float) -> None:
    s = np.zeros(at.L_STATES)
    out = []
    for k in range(2 * at.DELAY_LINE_SAMPLES):
        valve_dynamics.delay_line_advance(s)
        out.append(valve_dynamics.delay_line_update(float(k), at.S_OPENING_LINE1, wait, s))
    assert out[10:] == pytest.approx([k - wait for k in range(10, 2 * at.DELAY_LINE_SAMPLES)])


def test_what_is_under_way_in_the_hose_is_looked_ahead_to() -> None:
    c, s = valve_dynamics_numbers("line-delay"), np.zeros(at.L_STATES)
    observers.initialise_state(0.1, 0.1, 3e5, 3e5, s, c)
    valve_dynamics.delay_line_fill(at.S_OPENING_LINE1, 1.0, s)  # filling, and nothing of it has arrived
    observers.predict_to_arrival(s, c)
    made = 0.011 * valve_dynamics.valve_gradient_1(1.0, 3e5, valve_dynamics.chamber_volume_1(0.1, c), s, c)
    assert s[at.S_PREDICTED_P1] - 3e5 == pytest.approx(made, rel=0.15)
    assert s[at.S_P1] == 3e5


def test_an_observer_behind_a_lagging_sensor_has_the_poles_that_are_asked_for() -> None:
    forward, poles = np.array([[0.9, 0.1, 1e-4], [0.0, 1.0, 1e-3], [0.0, 0.0, 1.0]]), (0.8, 0.8, 0.95)
    gains = np.array(ackermann_gains(forward, poles))
    left = (np.eye(3) - np.outer(gains, [1.0, 0.0, 0.0])) @ forward
    assert np.poly(left) == pytest.approx(np.poly(poles), rel=1e-6)


def test_dry_friction_knows_place_pressure_and_direction() -> None:
    s = np.zeros(at.L_STATES)
    assert plant.dry_friction_factor(0.09, 1.0, s, valve_dynamics_numbers("position-friction")) == pytest.approx(2.5)
    assert plant.dry_friction_factor(0.15, 1.0, s, valve_dynamics_numbers("position-friction")) == 1.0
    s[at.S_P1], s[at.S_P2] = (
        VALVE_DYNAMICS_MODEL.rig.ambient_pressure + 2e5,
        VALVE_DYNAMICS_MODEL.rig.ambient_pressure + 1e5,
    )
    assert plant.dry_friction_factor(0.1, 1.0, s, valve_dynamics_numbers("pressure-friction")) == pytest.approx(1.6)
    asymmetric = valve_dynamics_numbers("friction-asymmetry")
    assert [plant.dry_friction_factor(0.1, way, s, asymmetric) for way in (1.0, -1.0)] == pytest.approx([1.2, 0.8])


def test_between_both_branches_of_friction_the_speed_stays() -> None:
    c, s = valve_dynamics_numbers("friction-hysteresis"), np.zeros(at.L_STATES)
    coulomb, v = c[at.C_COULOMB], 1.0
    between = 0.8 * coulomb + c[at.C_VISCOUS] * v
    assert plant.speed_after(0.1, v, between, 1e-3, s, c) == v
    assert plant.speed_after(0.1, v, between - 0.5 * coulomb, 1e-3, s, c) < v
    assert plant.speed_after(0.1, 0.0, 0.9 * coulomb, 1e-3, s, c) == 0.0


def test_hysteresis_without_a_drop_has_no_stribeck_rise_while_slowing() -> None:
    """Between Coulomb friction and 1.8 times as much the speed stays; with one branch the piston slows."""
    c, s = valve_dynamics_numbers("friction-hysteresis").copy(), np.zeros(at.L_STATES)
    coulomb, v = c[at.C_COULOMB], 0.005
    c[at.C_STRIBECK], s[at.S_BREAKAWAY_FORCE] = 0.01, 2.0 * coulomb
    between = 1.4 * coulomb + c[at.C_VISCOUS] * v
    c[at.C_DECELERATION_RATIO] = 1.0
    assert plant.speed_after(0.1, v, between, 1e-4, s, c) == v
    c[at.C_DECELERATION_RATIO] = -1.0
    assert plant.speed_after(0.1, v, between, 1e-4, s, c) < v


def test_springs_and_weights_push_and_a_cushion_brakes_toward_its_end() -> None:
    spring, cushion = valve_dynamics_numbers("spring-force"), valve_dynamics_numbers("end-cushion")
    assert plant.stroke_table(0.15, 4, spring) == pytest.approx(-200.0 * 0.05, rel=1e-6)
    assert plant.stroke_table(0.0, 4, spring) == pytest.approx(200.0 * 0.1, rel=1e-6)
    stroke, viscous = VALVE_DYNAMICS_MODEL.rig.stroke, VALVE_DYNAMICS_MODEL.base_values()["friction.viscous"]
    assert plant.damping(stroke, 1.0, cushion) == pytest.approx(viscous + 200.0, rel=1e-6)
    assert plant.damping(stroke, -1.0, cushion) == pytest.approx(viscous)
