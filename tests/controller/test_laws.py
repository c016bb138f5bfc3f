"""The laws of the bench: each does what its equations say, in numbers to check by hand, and commands as stored."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pneucli.closed_loop.metrics import COMPONENTS, compare_laws, evaluate_run, without_component
from pneucli.closed_loop.scenarios import read_scenarios
from pneucli.closed_loop.simulation import simulate
from pneucli.controller import layout as at
from pneucli.controller import observers, valve_dynamics
from pneucli.controller.laws import LAWS, find_law, pdc, sector
from pneucli.controller.laws.base import callees_first, own_constants
from pneucli.controller.operation import active_reference, finish_commands
from pneucli.controller.parameters import Controller
from pneucli.design.bandwidths import choose_bandwidths
from pneucli.design.cascade_design import design_cascade
from pneucli.design.control_laws import controller_for, design_controllers, design_variants, sliding_surfaces
from pneucli.design.requirements import read_requirements
from pneucli.design.sliding import axis_systems
from pneucli.errors import InputError
from pneucli.physics.effects import catalogue
from pneucli.simulate import layout as out
from tests.design import axis
from tests.design.test_cascade_design import model_of
from tests.stored import hold_against

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


def test_the_line_of_the_relay_is_by_poles_or_by_stated_weights() -> None:
    mechanical = axis_systems(V, 0.1, 3e5, 3e5)["mechanical"]
    corners = choose_bandwidths(MODEL, PLAN.requirements, V)
    wanted = replace(PLAN.requirements, surface="lq", surface_weights=(2500.0, 1.0))
    poles, lq = sliding_surfaces(mechanical, corners, wanted)
    assert (poles.taken, lq.taken) == (False, True)
    assert poles.slope == pytest.approx(corners.position)
    assert lq.slope == pytest.approx(math.sqrt(2500.0))  # x1' = x2: the root of the weights' ratio


SECTOR = dict(zip(LAWS["sector"].parameters, MADE["sector"].own, strict=True))


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


@pytest.mark.parametrize("effect", ["valve-lag", "valve-hysteresis"])
def test_the_command_undoes_lag_and_play_as_far_as_it_is_asked_to(effect: str) -> None:
    c, s = valve_dynamics_numbers(effect), np.zeros(at.L_STATES)
    for wanted in (0.5, -0.3, 0.1, 0.8):
        before = s[at.S_SPOOL1]
        u = valve_dynamics.compensate_valve_dynamics(wanted, 0.0, at.S_PLAY1, at.S_SPOOL1, -10.0, 10.0, s, c)
        valve_dynamics.apply_valve_dynamics(u, at.S_PLAY1, at.S_SPOOL1, s, c)
        assert s[at.S_SPOOL1] - before == pytest.approx(c[at.C_SPOOL_LEAD] * (wanted - before), abs=1e-12)


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


# --- what each law commands, as stored, at readings that are the same whatever it commands


K = np.arange(600)
SHOWN = (0, 1, 60, 62, 70, 90, 120, 180, 240, 301, 303, 306, 340, 400, 450, 520, 599)
TOLD = (at.S_U1, at.S_U2, at.S_V, at.S_LOAD, at.S_FORCE, at.S_RATE1, at.S_FLOW1)
EFFECTS = (
    {"valve-lag.time_constant": 0.017}, {"valve-hysteresis.half_width": 0.2}, {"valve-deadband.width": 0.8},
    {"line-delay.delay": 0.011}, {"pressure-lag.time_constant": 0.012}, {"time-skew.delay": 0.012},
    {"pressure-scale.scale": 1.05}, {"pressure-offset.offset": 1e4}, {"chamber-leak.area": 3e-8},
    {"piston-leak.area": 3e-8}, {"valve-leak.area": 3e-8}, {"pressure-friction.gain": 0.2},
    {"position-friction.from": 0.08, "position-friction.to": 0.12, "position-friction.gain": 1.5},
    {"friction-hysteresis.drop": 0.4}, {"friction-hysteresis.drop": 0.0},
    {"friction-asymmetry.asymmetry": 0.2, "friction-asymmetry.viscous_asymmetry": 0.1},
    {"end-cushion.length": 0.1, "end-cushion.damping": 200.0},
    {"spring-force.stiffness": 200.0, "spring-force.rest_position": 0.1},
)  # fmt: skip


def readings() -> np.ndarray:
    """Reference, position and both pressures, (n, 4): it moves 20 mm, sticks 20 um off, loses p1, is pushed away."""
    rig, values = axis.RIG, axis.model().values
    reference = 0.1 + 0.01 * (1.0 - np.cos(np.pi * np.clip(K - 60, 0, 240) / 240))
    x = np.interp(K - 4, K, reference) - 20e-6 * (K > 200) - 1e-4 * np.clip(K - 480, 0, 20)
    v = np.gradient(x, 1e-3)
    force = values["friction.coulomb"] * np.tanh(100.0 * v) + values["friction.viscous"] * v + 3.0 * (K > 350)
    p2 = 3e5 + 5e3 * np.sin(0.02 * K)
    p1 = rig.ambient_pressure + (force + rig.piston_areas[1] * (p2 - rig.ambient_pressure)) / rig.piston_areas[0]
    p1[302:305] = np.nan
    return np.column_stack([reference, x, p1, p2])


def commanded(controller: Controller) -> str:
    """Commands in V, the speed, load, force and rate of pressure that it knows or asks for, at some of the samples."""
    s, c, told = np.zeros(at.L_STATES), controller.vector(), []
    for k, (x_ref, *read) in enumerate(readings().tolist()):
        LAWS[controller.law].step(active_reference(x_ref, *read, s, c), *read, s, c)
        finish_commands(s, c)
        if k in SHOWN:
            told.append(" ".join(f"{round(float(s[i]), 7) + 0.0:.7g}" for i in TOLD))
    return " | ".join(told)


def test_what_each_law_commands_is_as_stored() -> None:
    """But for the PDC, whose gains are as exact as a solver finds them."""
    made = {
        f"{law}, {one}": c for one in axis.ARRANGEMENTS for law, c in axis.bench_of_laws(one)[1].items() if law != "pdc"
    }
    made |= design_variants(axis.plan(), LAWS)
    made |= {str(one): design_cascade(model_of({"values": one}), axis.REQUIREMENTS, axis.SEALED) for one in EFFECTS}
    lines = [f"{name}: {commanded(controller)}" for name, controller in made.items()]
    hold_against(Path(__file__).parent / "stored" / "commands.txt", "\n".join(lines) + "\n", rel=1e-4)
