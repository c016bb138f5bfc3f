"""Logs of a running controller: replayed from what it read, and held against what the model foretells."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from pneucli.closed_loop import commissioning, log_replay
from pneucli.closed_loop.log_replay import (
    ControllerLog,
    find_replay,
    log_on_grid,
    logged_loop,
    predict_loop,
    replay_rounding_error,
)
from pneucli.closed_loop.metrics import evaluate_run
from pneucli.closed_loop.simulation import ClosedLoopSetup, Run, replay_log, simulate
from pneucli.controller import layout as at
from pneucli.controller.parameters import Controller
from pneucli.design.cascade_design import design_cascade
from pneucli.errors import InputError
from pneucli.export.controller_program import ExportedController
from pneucli.export.single_precision import replay_in_single_precision
from pneucli.messages.compare import Commissioned
from pneucli.physics.effects import catalogue
from pneucli.recording import Recording
from pneucli.simulate.model import Model
from pneucli.stages.compare import ReplayedLog, commissioned_machine
from tests.design import axis

MODEL, CONTROLLER = axis.model(), axis.controller()
LAG, DELAY = commissioning.added_times()
TIME = 1e-3 * np.arange(3000)
REFERENCE = np.where(TIME < 0.5, 0.1, np.where(TIME < 1.5, 0.13, 0.13 + 0.02 * np.sin(np.pi * (TIME - 1.5))))
ENGINE = partial(replay_log, MODEL, CONTROLLER)


@pytest.fixture(scope="module")
def loop() -> Run:
    return simulate(MODEL, CONTROLLER, axis.scenario(CONTROLLER, REFERENCE), axis.BENCH, seed=4)


def signals(loop: Run, first: int = 0) -> dict[str, np.ndarray]:
    places = {"x": at.L_READ_X, "p1": at.L_READ_P1, "p2": at.L_READ_P2, "u": at.L_U1}
    return {"x_ref": REFERENCE[first:], **{n: loop.log[first:, place] for n, place in places.items()}}


def recorded(loop: Run, **more: object) -> Recording:
    known = {"name": "log", "experiment": "closed-loop", "use": "test", "time": TIME, "signals": signals(loop)}
    return Recording(**(known | {"chamber_2": "closed"} | more))


def test_a_log_gives_back_the_commands_to_the_last_bit(loop: Run) -> None:
    log = log_on_grid(recorded(loop), CONTROLLER)
    found = find_replay(ENGINE, log)
    assert found.start_mode == "with"
    assert np.array_equal(found.commands[:, 0], loop.log[:, at.L_U1])
    assert np.array_equal(logged_loop(MODEL, CONTROLLER, log, found).log[:, at.L_U1], loop.log[:, at.L_U1])


def test_a_log_that_begins_while_the_controller_runs_is_replayed_from_its_first_command(loop: Run) -> None:
    """From rest, while the axis was held; what it had learned it learns again from what its commands made."""
    log = ControllerLog(signals(loop, 1450), np.arange(1550))
    found = find_replay(ENGINE, log)
    assert found.start_mode == "before"
    assert found.commands[0, 0] == log["u"][0]
    assert np.median(np.abs(found.commands[300:, 0] - log["u"][300:])) < 0.2


@pytest.mark.parametrize("told", [True, False])
def test_whether_a_logged_supply_was_told_to_the_controller_is_seen_by_its_commands(told: bool) -> None:
    scenario = axis.scenario(CONTROLLER, REFERENCE)
    scenario = replace(scenario, supply=0.9 * scenario.supply)
    loop = simulate(MODEL, CONTROLLER, scenario, replace(axis.BENCH, supply=told), seed=4)
    log = ControllerLog(signals(loop) | {"p_supply": scenario.supply}, np.arange(TIME.size))
    found = find_replay(ENGINE, log)
    assert ("p_supply" in found.readings) == told
    assert np.array_equal(found.commands[:, 0], loop.log[:, at.L_U1])


@pytest.fixture(scope="module")
def commissioning_controller() -> Controller:
    return commissioning.with_commissioning(
        MODEL, CONTROLLER, lambda model: design_cascade(model, axis.REQUIREMENTS, axis.SEALED), axis.BENCH
    )


def machine_of_log(machine: Model, controller: Controller) -> Commissioned:
    """What is read back from a log that begins with the commissioning of a machine, whose commands it gives back."""
    run = commissioning.run_commissioning(machine, controller, axis.BENCH)
    first = round(commissioning.BEGIN / controller.period)
    log = ControllerLog(
        signals(run, first) | {"x_ref": run.scenario.reference[first:]}, np.arange(run.time.size - first)
    )
    found = find_replay(partial(replay_log, MODEL, controller), log)
    assert found.start_mode == "commission"
    assert np.array_equal(found.commands[:, 0], run.log[first:, at.L_U1])
    exported = ExportedController(controller, "float64", "")
    looked = ReplayedLog(recorded(run), exported, log, partial(replay_log, MODEL, controller), found)
    machine_found = commissioned_machine(looked, MODEL)
    assert machine_found is not None
    return machine_found


@pytest.mark.parametrize(("kind", "said"), [(DELAY, "delay, as of a hose"), (LAG, "lag, as of a spool")])
def test_a_log_that_begins_with_a_commissioning_tells_what_the_machine_is(
    kind: tuple[str, str], said: str, commissioning_controller: Controller
) -> None:
    slow = commissioning.with_time(MODEL, *kind, 10e-3).with_values({"valve.null": 0.3})
    machine = machine_of_log(slow, commissioning_controller)
    assert said in machine.sentence
    assert machine.null_1 == pytest.approx(0.3, abs=0.06)
    assert machine.delay == pytest.approx(12e-3, abs=1.2e-3)


def test_a_log_of_a_commissioning_that_failed_tells_why(commissioning_controller: Controller) -> None:
    stuck = replace(MODEL, valve=MODEL.valve.scaled(1e-6))
    assert machine_of_log(stuck, commissioning_controller).sentence == "commissioning: no reversal of the pressure"


def test_another_controller_is_told_by_its_commands(loop: Run) -> None:
    other = CONTROLLER.with_values(C_KP=2.0 * CONTROLLER.values["C_KP"])
    log = log_on_grid(recorded(loop), CONTROLLER)
    found = find_replay(partial(replay_log, MODEL, other), log)
    off = np.sqrt(np.mean((found.commands[:, 0] - log["u"]) ** 2))
    assert off > 1e3 * replay_rounding_error(ENGINE, log, find_replay(ENGINE, log), {"p1": 0.1, "p2": 0.1})


def test_the_rounding_of_readings_is_carried_to_the_command(loop: Run) -> None:
    """It is in proportion to the rounding, and of the size that a replay of rounded readings shows."""
    log = log_on_grid(recorded(loop), CONTROLLER)
    found = find_replay(ENGINE, log)
    fine, coarse = (replay_rounding_error(ENGINE, log, found, {"p1": step}) for step in (0.1, 1.0))
    assert coarse > 5.0 * fine  # more than in proportion: coarse readings turn decisions too
    rounded = ControllerLog(dict(log.signals) | {"p1": np.round(log["p1"], 1)}, log.grid_indices)
    off = np.abs(find_replay(ENGINE, rounded).commands[:, 0] - log["u"])
    assert 0.2 * fine < np.sqrt(np.mean(off[off <= np.percentile(off, 99.0)] ** 2)) < 5.0 * fine


@pytest.mark.parametrize(("digits", "offset", "step"), [(1, 101_325.37, 0.1), (5, 0.0, 1e-5), (-2, 0.0, 100.0)])
def test_the_digits_of_a_log_are_seen_whatever_was_added(digits: int, offset: float, step: float) -> None:
    values = np.round(3e5 + 400.0 * np.random.default_rng(0).standard_normal(500), digits) + offset
    assert log_replay.log_resolution(values) == pytest.approx(step)


def test_a_slow_reference_is_not_taken_for_a_coarse_one() -> None:
    sine = np.round(0.1 + 0.03 * np.sin(0.003 * np.arange(2000)), 9)
    assert log_replay.log_resolution(sine) == pytest.approx(1e-9)


def test_numbers_with_all_their_digits_and_constants_show_no_rounding() -> None:
    assert log_replay.log_resolution(np.random.default_rng(0).standard_normal(500)) < 1e-9
    assert log_replay.log_resolution(np.full(5, 3.0)) == 0.0


def test_a_log_with_gaps_lies_on_the_controllers_grid(loop: Run) -> None:
    kept = np.delete(np.arange(TIME.size), slice(700, 705))
    gaps = {n: v[kept] for n, v in signals(loop).items()}
    log = log_on_grid(recorded(loop, time=TIME[kept], signals=gaps), CONTROLLER)
    assert np.array_equal(log.grid_indices, kept)
    assert np.isnan(log["x"][700:705]).all()
    assert np.array_equal(find_replay(ENGINE, log).commands[:600, 0], loop.log[:600, at.L_U1])


def test_a_log_that_is_thinned_out_is_refused(loop: Run) -> None:
    thin = {n: v[::10] for n, v in signals(loop).items()}
    with pytest.raises(InputError, match="one sample a period") as error:
        log_on_grid(recorded(loop, time=TIME[::10], signals=thin), CONTROLLER)
    assert "unknown" in error.value.mend


def test_what_is_foretold_is_what_comes_where_the_model_is_right_and_not_where_it_lacks_a_lag(loop: Run) -> None:
    lag = replace(MODEL, effects=(*MODEL.effects, catalogue()["valve-lag"])).with_values(
        {"valve-lag.time_constant": 8e-3}
    )
    late = simulate(lag, CONTROLLER, axis.scenario(CONTROLLER, REFERENCE), axis.BENCH, seed=4)
    errors = []
    for one in (loop, late):
        log = log_on_grid(recorded(one), CONTROLLER)
        pair = (
            predict_loop(MODEL, CONTROLLER, log, axis.BENCH),
            logged_loop(MODEL, CONTROLLER, log, find_replay(ENGINE, log)),
        )
        errors.append([evaluate_run(r, MODEL, CONTROLLER).tracking_rms_um for r in pair])
    (told, came), (told_too, came_late) = errors
    again = (
        simulate(MODEL, CONTROLLER, axis.scenario(CONTROLLER, REFERENCE), axis.BENCH, seed) for seed in range(20, 44)
    )
    drawn = [
        came,
        *(evaluate_run(one, MODEL, CONTROLLER).tracking_rms_um for one in again),
    ]  # noise decides how it sticks
    assert min(drawn) <= told <= max(drawn)
    assert told_too == pytest.approx(told, rel=0.3)
    assert came_late > 2.0 * max(*drawn, told_too)


def test_sensors_are_taken_as_noisy_as_in_the_log(loop: Run) -> None:
    told = ClosedLoopSetup(noise_x=1.0, quantum_x=2.0, noise_p=3.0)
    assert log_replay.setup_from_recording(recorded(loop), told) == told


def test_in_single_precision_the_replay_is_that_of_the_single_controller(loop: Run) -> None:
    """It stays near until a decision falls apart: over the first half second, at rest, none does."""
    log = {n: v[:40] for n, v in signals(loop).items()}
    single, double = replay_in_single_precision(CONTROLLER, log, "with"), ENGINE(log, "with")
    assert single[:, at.L_U1] == pytest.approx(double[:, at.L_U1], abs=0.01)
    assert not np.array_equal(single[:, at.L_U1], double[:, at.L_U1])
