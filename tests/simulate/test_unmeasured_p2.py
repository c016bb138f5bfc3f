"""An unmeasured p2 follows from the model, and its start from the force balance of the moving piston."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.identify.estimation.model_fit import fit_model
from pneucli.identify.residuals import ForceBalance, ForceBalanceInferredPressure, residual_models
from pneucli.physics.effects import catalogue
from pneucli.recording import Recording
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.motion_smoother import MeasuredMotion
from pneucli.simulate.outputs import required_force, simulate_outputs, with_estimated_pressures
from pneucli.simulate.preparation import prepare, substitute_missing_inputs
from pneucli.simulate.run import run, with_inferred_pressures
from pneucli.stages.diagnose import unmeasured_pressure_warnings
from tests.simulate.synthetic_experiments import BALANCED, RIG, held_commands, make_experiment, model, time_grid

SHUT_IN = float(BALANCED["p2"])  # Pa, in chamber 2 at the start
LOAD = {"constant-force.force": 20.0}
TRUE = {"closed": model(["constant-force"], LOAD), "valve": model(["constant-force"], LOAD)}
NOISE = {"x": 5e-6, "p1": 300.0, "a": 0.02}


@pytest.fixture(scope="module", params=["closed", "valve"])
def unread(request: pytest.FixtureRequest) -> tuple[Experiment, np.ndarray]:
    """A piston driven to and fro under a load, read without p2; and the true p2."""
    time, rng = time_grid(4.0), np.random.default_rng(5)
    u = held_commands(time, [2.0, -2.0, 3.0, -2.5, 1.5, -1.5, 2.5, -3.0], 0.5)
    given = {"u": u} | ({"u2": -u} if request.param == "valve" else {})
    exact = make_experiment("axis", time, {**given, "x": 0.1, "p1": BALANCED["p1"]}, request.param)
    out = run(TRUE[request.param], exact)
    signals = {n: out[:, c] for n, c in (("x", at.X), ("a", at.A), ("p1", at.R1))}
    signals = {n: y + rng.normal(scale=NOISE[n], size=time.size) for n, y in signals.items()}
    recording = replace(exact.recording, signals={**given, **signals})
    return prepare(recording, replace(RIG, valve_arrangement="two"), 0.5), out[:, at.P2]


def test_only_an_unmeasured_pressure_that_acts_is_inferred(unread: tuple[Experiment, np.ndarray]):
    e, p2 = unread
    read = replace(e.recording, signals={**e.recording.signals, "p2": p2})
    still = {n: y for n, y in e.recording.signals.items() if n != "x"}
    assert e.inferred_pressures == ("p2",)
    of_ends = {c: replace(e, recording=replace(e.recording, chamber_2=c)) for c in ("closed", "valve", "open")}
    assert [one.p2_is_unmeasured for one in of_ends.values()] == [True, True, False]
    assert not prepare(read, e.rig, 0.5).p2_is_unmeasured
    assert not prepare(read, e.rig, 0.5).inferred_pressures
    assert not prepare(replace(e.recording, chamber_2="open"), e.rig, 0.5).inferred_pressures
    assert not replace(e, raw=still).inferred_pressures
    assert not replace(e, rig=replace(e.rig, piston_area_1=None, piston_area_2=None)).inferred_pressures
    assert next(type(v) for v in residual_models([e])) is ForceBalanceInferredPressure
    assert next(type(v) for v in residual_models([prepare(read, e.rig, 0.5)])) is ForceBalance


def test_the_estimated_p2_follows_from_the_force_balance(unread: tuple[Experiment, np.ndarray]):
    """Within 0.5 % of the truth from a start that errs by a third: sensors and smoothing leave no more."""
    e, p2 = unread
    true = TRUE[e.recording.chamber_2]
    wrong = e.inputs.copy()
    wrong[:, at.IN_P2] = 1.33 * SHUT_IN
    for _ in range(2):  # a valve that lets the gas out is not quite linear in the start
        wrong = with_estimated_pressures(true, e, wrong)
    assert wrong[0, at.IN_P2] == pytest.approx(SHUT_IN, rel=0.005)
    assert with_inferred_pressures(true, e, wrong)[:, at.IN_P2] == pytest.approx(p2, rel=0.005)


def test_the_offset_of_the_accelerometer_is_no_force(unread: tuple[Experiment, np.ndarray]):
    """A known bias of 0.5 m/s^2, 1.1 N of this mass, changes neither the start of p2 nor an imposed force."""
    e, _ = unread
    true = TRUE[e.recording.chamber_2]
    biased = model(["constant-force", "acceleration-bias"], {**LOAD, "acceleration-bias.bias": 0.5})
    tilted = replace(e, raw=e.raw | {"a": e.raw["a"] + 0.5})
    assert with_estimated_pressures(biased, tilted, e.inputs) == pytest.approx(
        with_estimated_pressures(true, e, e.inputs)
    )
    assert with_estimated_pressures(true, tilted, e.inputs) != pytest.approx(
        with_estimated_pressures(true, e, e.inputs)
    )
    assert required_force(biased, replace(tilted, motion_smoother=MeasuredMotion(e.time))) == pytest.approx(
        required_force(true, replace(e, motion_smoother=MeasuredMotion(e.time)))
    )


def test_p2_restarts_after_gaps_only(unread: tuple[Experiment, np.ndarray]):
    e, p2 = unread
    later = e.time + np.where(np.arange(e.time.size) >= 2000, 1.0, 0.0)
    torn = replace(e, recording=replace(e.recording, time=later))
    given = e.inputs.copy()
    given[0, at.IN_P2], given[2000, at.IN_P2] = SHUT_IN, 2.0 * p2[2000]
    inferred = with_inferred_pressures(TRUE[e.recording.chamber_2], torn, given)[:, at.IN_P2]
    assert inferred[:2000] == pytest.approx(p2[:2000], rel=0.005)
    assert inferred[2000] == pytest.approx(2.0 * p2[2000])


def test_p2_of_the_model_continues_over_a_restart(unread: tuple[Experiment, np.ndarray]):
    """Every 0.5 s the piston is set to what was measured; p2, which was not, goes on."""
    e, p2 = unread
    given = e.inputs.copy()
    given[:, at.IN_P2] = SHUT_IN
    replayed = run(TRUE[e.recording.chamber_2], e, given)[:, at.P2]
    assert replayed[e.restarts] == pytest.approx(p2[e.restarts], rel=0.01)


def test_a_correct_model_deviates_by_noise_without_a_sensor_of_p2(unread: tuple[Experiment, np.ndarray]):
    """Within 0.3 mm after each 0.5 s: an ambient p2, as before, would let the piston run to its end."""
    e, _ = unread
    modelled = simulate_outputs(TRUE[e.recording.chamber_2], e)
    assert np.abs(modelled["x"] - e.inputs[:, at.IN_X]).max() < 3e-4


def test_an_effect_on_the_piston_is_found_without_a_sensor_of_p2(unread: tuple[Experiment, np.ndarray]):
    """The load within 10 %: a start of p2 that is not known takes the place of a part of it."""
    e, _ = unread
    found = fit_model(TRUE[e.recording.chamber_2], residual_models([e]), [catalogue()["constant-force"]])
    assert found["constant-force.force"].value == pytest.approx(20.0, rel=0.1)


def test_a_diagnosis_states_where_p2_was_inferred_and_where_not(unread: tuple[Experiment, np.ndarray]):
    e, p2 = unread
    read = prepare(replace(e.recording, signals={**e.recording.signals, "p2": p2}), e.rig, 0.5)
    assert unmeasured_pressure_warnings(residual_models([read])) == []
    inferred, blind = unmeasured_pressure_warnings([*residual_models([e]), ForceBalance(e)])
    assert inferred.startswith("bench: p2 not recorded and inferred from the model")
    assert "record p2" in blind


# --- substitutes for pressures that a recording lacks


TIME = time_grid(4.0)
COMMANDS = held_commands(TIME, [2.0, -2.0, 3.0, -2.5, 1.5, -1.5, 2.5, -3.0], 0.5)


@pytest.fixture(scope="module")
def moved() -> np.ndarray:
    """The kernel's output for a piston that is driven to and fro against a gas shut in chamber 2."""
    return run(model(), make_experiment("axis", TIME, {"u": COMMANDS, "x": 0.1, "p1": BALANCED["p1"]}))


def filled(out: np.ndarray, recorded: set[str], chamber_2: str, **rig: float | None) -> np.ndarray:
    """Inputs of a recording of some signals, with what stands in for the others."""
    inputs = np.zeros((TIME.size, len(at.INPUTS)))
    for column, shown in ((at.IN_P1, at.P1), (at.IN_X, at.X), (at.IN_V, at.V)):
        inputs[:, column] = out[:, shown]
    signals = dict.fromkeys(recorded, np.zeros(TIME.size))
    substitute_missing_inputs(
        inputs, Recording("bench", "axis", "train", TIME, signals, chamber_2=chamber_2), replace(RIG, **rig)
    )
    return inputs


def test_trapped_gas_has_the_pressure_of_the_force_balance(moved: np.ndarray):
    """Within 2 % of the truth, whatever dry and viscous friction are."""
    assert filled(moved, {"p1", "x"}, "closed")[:, at.IN_P2] == pytest.approx(moved[:, at.P2], rel=0.02)


def test_behind_a_valve_p2_starts_at_the_pressure_that_holds_the_piston(moved: np.ndarray):
    """3 bar on 8.04 cm^2 are held by what ``BALANCED`` has on 7 cm^2; how p2 goes on, no reading tells."""
    assert filled(moved, {"p1", "x"}, "valve")[:, at.IN_P2] == pytest.approx(float(BALANCED["p2"]), rel=0.001)


@pytest.mark.parametrize(
    ("recorded", "chamber_2", "rig"),
    [({"p1"}, "closed", {}), ({"p1", "x"}, "open", {}),
     ({"p1", "x"}, "closed", {"stroke": None}),
     ({"p1", "x"}, "closed", {"piston_area_1": None, "piston_area_2": None})],
)  # fmt: skip
def test_other_missing_pressures_are_ambient(moved: np.ndarray, recorded: set[str], chamber_2: str, rig: dict):
    assert filled(moved, recorded, chamber_2, **rig)[:, at.IN_P2] == pytest.approx(RIG.ambient_pressure)


def test_without_any_pressure_an_axis_starts_amid_ambient_and_supply(moved: np.ndarray):
    inputs, amid = filled(moved, {"x"}, "valve"), 0.5 * (RIG.ambient_pressure + 7e5)
    held = RIG.ambient_pressure + RIG.piston_areas[0] / RIG.piston_areas[1] * (amid - RIG.ambient_pressure)
    assert inputs[:, at.IN_P1] == pytest.approx(amid)
    assert inputs[:, at.IN_P2] == pytest.approx(held)


def test_recorded_signals_are_not_substituted(moved: np.ndarray):
    inputs = filled(moved, {"p1", "p2", "p_supply"}, "closed")
    assert inputs[:, at.IN_P1] == pytest.approx(moved[:, at.P1])
    assert not inputs[:, [at.IN_P2, at.IN_SUPPLY]].any()
    assert filled(moved, {"p1", "p2"}, "closed")[:, at.IN_SUPPLY] == pytest.approx(7e5)
