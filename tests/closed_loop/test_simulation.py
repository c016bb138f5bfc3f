"""The cascade on the identified axis: what issue 4 asks of it, and what it must survive."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.arrays import read_only
from pneucli.closed_loop.metrics import evaluate_run, without_component
from pneucli.closed_loop.scenarios import read_scenarios
from pneucli.closed_loop.simulation import ClosedLoopSetup, closed_loop_kernel, simulate
from pneucli.controller import layout
from pneucli.controller.codegen import controller_source
from pneucli.design.cascade_design import design_cascade
from pneucli.design.requirements import Requirements
from pneucli.physics.effects import catalogue, with_catalogue
from pneucli.simulate import layout as at
from pneucli.simulate.build import build
from pneucli.simulate.kernel_settings import max_motion_step
from tests.design import axis

MODEL, CONTROLLER = axis.model(), axis.controller()
ALONE = without_component(CONTROLLER, "all but the map")
TIME = 1e-3 * np.arange(6000)
STEPS = 0.1 + 0.03 * (TIME >= 0.5) - 0.06 * (TIME >= 3.0)
SINE = 0.1 + 0.03 * np.sin(2 * np.pi * 0.5 * np.maximum(TIME - 0.5, 0.0))
LOAD = -50.0 * ((TIME >= 1.0) & (TIME < 3.5))


def figures(reference, force=0.0, controller=CONTROLLER, bench=axis.BENCH, seed=0, **more):
    result = simulate(MODEL, controller, axis.scenario(controller, reference, force, **more), bench, seed)
    return evaluate_run(result, MODEL, controller)


@pytest.mark.parametrize("seed", range(3))
def test_it_rests_within_10_um_without_a_limit_cycle_though_friction_is_stribeck(seed: int) -> None:
    found = figures(STEPS, seed=seed)
    assert found.steady_um <= 10.0
    assert found.cycle_um <= 10.0


@pytest.mark.parametrize("seed", range(3))
def test_a_step_in_load_of_50_n_is_rejected_to_50_um_within_half_a_second_and_known(seed: int) -> None:
    found = figures(np.full(TIME.size, 0.1), LOAD, seed=seed)
    assert found.recovery_s <= 0.5
    assert found.load_error <= 0.1


def test_compensation_makes_the_tracking_error_of_a_sine_five_times_smaller() -> None:
    assert 5.0 * figures(SINE).tracking_rms_um <= figures(SINE, controller=ALONE).tracking_rms_um


def test_held_it_leaves_the_valve_alone() -> None:
    result = simulate(MODEL, CONTROLLER, axis.scenario(CONTROLLER, np.full(2000, 0.1)), axis.BENCH)
    shut = np.abs(result.log[500:, layout.L_U1]) <= axis.TRUTH["overlap"]
    assert shut.mean() > 0.99


def test_what_the_valve_cannot_do_saturates_and_is_recovered_from() -> None:
    """100 N pull the piston where the air spring and the supply cannot hold it; afterwards it comes back."""
    pull = 1000.0 * ((TIME >= 1.0) & (TIME < 2.0))
    result = simulate(MODEL, CONTROLLER, axis.scenario(CONTROLLER, np.full(TIME.size, 0.1), pull), axis.BENCH)
    assert np.abs(result.log[:, layout.L_U1]).max() == CONTROLLER.values["C_U_MAX"]
    assert result.model[1900, at.X] > 0.12
    assert np.abs(result.model[-500:, at.X] - 0.1).max() <= 10e-6


@pytest.mark.parametrize("seed", range(3))
def test_a_load_on_one_way_alone_that_was_taken_for_friction_does_not_make_it_hunt_at_rest(seed: int) -> None:
    """25 N push on the way back of a sine; then the reference rests, behind 10 ms that the model does not know."""
    reference = 0.1 + 0.03 * np.sin(np.pi * np.clip(TIME - 0.5, 0.0, 2.0))
    push = 25.0 * ((TIME >= 0.95) & (TIME < 1.95))
    scene = axis.scenario(CONTROLLER, reference, push)
    found = simulate(MODEL, CONTROLLER, scene, replace(axis.BENCH, delay=10), seed)
    assert np.abs(found.model[-500:, at.X] - 0.1).max() <= 0.5e-3


@pytest.mark.parametrize("lost", ["x", "p1", "p2"])
def test_a_sensor_that_drops_out_for_20_ms_does_not_upset_it(lost: str) -> None:
    found = figures(STEPS, dropouts=((lost, 3.3, 3.32),))
    assert found.steady_um <= 10.0
    assert found.overshoot_um <= 500.0


def test_without_a_sensor_of_p2_it_still_rests_on_the_reference() -> None:
    found = figures(STEPS, dropouts=(("p2", 0.0, 1e9),))
    assert found.steady_um <= 10.0


def test_it_rests_too_where_two_valves_drive_the_piston() -> None:
    two = axis.controller(replace(axis.REQUIREMENTS, chamber_2="valve"))
    result = simulate(MODEL, two, axis.scenario(two, STEPS), axis.BENCH)
    assert evaluate_run(result, MODEL, two).steady_um <= 10.0
    assert np.abs(result.log[:, layout.L_U2]).max() > axis.TRUTH["overlap"]


def test_it_rests_where_a_spring_pulls_the_piston_back_from_an_open_chamber() -> None:
    """Chamber 2 is the surroundings; what the valve can do is told at the pressures that hold the spring."""
    spring = {"spring-force.stiffness": 300.0, "spring-force.rest_position": -0.15}
    model = replace(MODEL, effects=(*MODEL.effects, catalogue()["spring-force"]))
    model = replace(model, values=MODEL.values | spring)
    controller = design_cascade(model, replace(axis.REQUIREMENTS, chamber_2="open"))
    result = simulate(model, controller, axis.scenario(controller, STEPS), axis.BENCH)
    assert np.ptp(result.model[:, at.P2]) == 0.0
    assert evaluate_run(result, model, controller).steady_um <= 10.0
    alone = design_cascade(MODEL, replace(axis.REQUIREMENTS, chamber_2="open"))
    assert controller.values["C_V_MAX"] > alone.values["C_V_MAX"]


def test_a_run_repeats_bit_for_bit_and_another_seed_differs() -> None:
    scene = axis.scenario(CONTROLLER, STEPS)
    once, again, other = (simulate(MODEL, CONTROLLER, scene, axis.BENCH, seed).model for seed in (7, 7, 8))
    assert np.array_equal(once, again)
    assert not np.array_equal(once, other)


def test_a_command_takes_effect_only_after_its_delay() -> None:
    """A step of reference moves the pressure first in the sample after the command arrives."""
    reference = 0.1 + 0.03 * (TIME[:1000] >= 0.1)
    late = ClosedLoopSetup(delay=5)
    begin = [
        np.argmax(
            np.abs(np.diff(simulate(MODEL, CONTROLLER, axis.scenario(CONTROLLER, reference), b).model[:, at.P1])) > 1.0
        )
        for b in (ClosedLoopSetup(), late)
    ]
    assert begin[1] - begin[0] == late.delay


def test_what_the_controller_reads_is_rounded_to_the_sensors_quanta() -> None:
    result = simulate(
        MODEL,
        CONTROLLER,
        axis.scenario(CONTROLLER, STEPS),
        ClosedLoopSetup(noise_p=400.0, quantum_x=1e-5, quantum_p=10.0),
    )
    for column, quantum in ((layout.L_READ_X, 1e-5), (layout.L_READ_P1, 10.0)):
        counts = result.log[:, column] / quantum
        assert np.abs(counts - np.round(counts)).max() < 1e-6


def test_the_compiled_loop_is_the_python_text() -> None:
    """The same text, run by the interpreter: every number of 0.2 s agrees to rounding."""
    from pneucli.closed_loop import simulation

    scene = axis.scenario(CONTROLLER, 0.1 + 0.01 * (TIME[:200] >= 0.05))
    plain, times = build(with_catalogue(()), compiled=False, control=controller_source()), read_only(TIME[:200])
    outs = []
    for kernel in (plain, closed_loop_kernel(())):
        state = np.concatenate(
            [np.zeros(layout.L_STATES), simulation.initial_log(scene, axis.BENCH, TIME[:200], 0).ravel()]
        )
        out = np.zeros((200, at.OUTPUTS))
        base = np.array([MODEL.base_values()[name] for name in at.BASE_NAMES])
        cp = np.concatenate([CONTROLLER.vector(), [1e-6, 0.0, 0, 0]])
        flags = simulation._flags(CONTROLLER)
        kernel.run(
            times, simulation._inputs(scene), np.zeros(1, dtype=np.int64), base, kernel.effect_vector({}),
            kernel.effect_switches(()), flags,
            *(read_only(valve.table(flags[at.U_MAX])) for valve in (MODEL.valve, MODEL.chamber_2_valve)),
            *2 * (max_motion_step(MODEL.rig, CONTROLLER.period),), state, cp, out,
        )  # fmt: skip
        outs.append(out)
    assert np.allclose(outs[0], outs[1], rtol=1e-9, atol=1e-12)


def test_a_slower_pressure_loop_makes_every_gain_smaller() -> None:
    slow = axis.controller(Requirements(pressure_bandwidth=20.0, quantum_x=1e-6)).values
    for gain in ("C_KP", "C_KD", "C_KI", "C_P_KP", "C_OBS_P", "C_OBS_FLOW"):
        assert slow[gain] < CONTROLLER.values[gain]


def test_a_lag_that_the_model_knows_slows_the_loops_by_what_is_left_of_it() -> None:
    known = replace(MODEL, effects=(*MODEL.effects, catalogue()["valve-lag"]))
    lagging = known.with_values({"valve-lag.time_constant": 0.02})
    from pneucli.design.bandwidths import SPOOL_LEAD, UNMODELLED_DELAY
    from pneucli.design.cascade_design import design_cascade

    assert design_cascade(lagging, axis.REQUIREMENTS).values["C_P_KP"] == pytest.approx(
        0.7 / (0.02 / SPOOL_LEAD + UNMODELLED_DELAY + 0.5e-3), rel=0.01
    )


def test_default_scenarios_show_each_kind_of_trouble() -> None:
    names = [s.name for s in read_scenarios([], CONTROLLER, "pipeline.toml, scenarios")]
    assert names == ["steps", "sine", "s-curve", "load", "supply-drop", "sensor-dropout", "points", "pressure"]


def test_a_recorded_reference_is_followed_as_recorded() -> None:
    recorded = {"axis_1": (np.array([5.0, 6.0, 7.0]), np.array([0.08, 0.1, 0.09]))}
    table = {"reference": "recorded", "recording": "axis_1", "duration": "2 s"}
    scene = read_scenarios([table], CONTROLLER, "here", recorded)[0]
    assert scene.reference[[0, 500, 1000]] == pytest.approx([0.08, 0.09, 0.1])
