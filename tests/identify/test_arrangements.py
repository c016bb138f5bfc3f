"""Each arrangement of the valves is identified from its own recordings, also without any sensor of pressure."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pneucli.diagnose.constraints import has_unmeasured_force
from pneucli.errors import InputError
from pneucli.figure import read
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.intervals import with_intervals
from pneucli.identify.estimation.model_fit import fit_model
from pneucli.identify.guesses.base_model import guess_base_model
from pneucli.identify.guesses.null_command import drifting_recordings, with_identified_null
from pneucli.identify.residuals import ForceBalance, residual_models
from pneucli.messages.compare import Answer
from pneucli.noise import NoiseModel
from pneucli.physics.effects import catalogue, catalogue_with_sides
from pneucli.plausibility.required_inputs import assumptions, tells_valve_map
from pneucli.recording import Recording, Rig
from pneucli.simulate import layout as at
from pneucli.simulate.end_stops import with_end_stops
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.preparation import prepare
from pneucli.simulate.run import run
from pneucli.simulate.valve_forms import LinearValve, SwitchingValve, ValveArea
from pneucli.stages.diagnose import unmeasured_pressure_warnings
from tests.simulate.synthetic_experiments import (
    BALANCED,
    FRICTION,
    RIG,
    held_commands,
    make_experiment,
    model,
    time_grid,
)
from tests.stages.chain import run_stages

FIRST = ValveArea((-4.0, -2.0, 2.0, 4.0), (8e-7, 4e-7, 4e-7, 8e-7))
SECOND = ValveArea((-4.0, -2.0, 2.0, 4.0), (6e-7, 3e-7, 3e-7, 6e-7), label="valve_2")
NOISE = {"p1": NoiseModel(300.0), "p2": NoiseModel(300.0), "x": NoiseModel(1e-5)}
LEVELS = (3.0, -2.5, 4.0, -4.0, 2.0, -2.0, 2.5, -3.0)


def axis(rig: Rig, model: Model, u: np.ndarray, u2: np.ndarray | None = None, seed: int = 1) -> Experiment:
    """A recording of both chambers behind valves, from rest in the middle at 3 bar, read with noise."""
    time, rng = 1e-3 * np.arange(u.size), np.random.default_rng(seed)
    held = {"u": u} | ({} if u2 is None else {"u2": u2})
    start = {"p1": 3e5, "p2": 3e5, "x": 0.5 * (rig.stroke or 0.0), "v": 0.0, "p_supply": rig.supply_pressure}
    flat = {name: np.full(time.size, value) for name, value in start.items()}
    blank = Recording("axis", "axis", "train", time, held | flat, dict.fromkeys(flat, NoiseModel(0.0)), "valve")
    true = run(model, prepare(blank, rig, None))
    seen = {"p1": true[:, at.P1], "p2": true[:, at.P2], "x": true[:, at.X]}
    read = {name: values + NOISE[name].draw(time, rng) for name, values in seen.items()}
    return prepare(replace(blank, signals=held | read, noise=NOISE), replace(rig, supply_pressure=7e5), 0.25)


def stairs(levels: tuple[float, ...] = LEVELS) -> np.ndarray:
    return np.repeat(levels, round(0.25 / 1e-3))


def fit(experiments: list[Experiment], form: str = "map") -> Fit:
    rig = experiments[0].rig
    ready = with_end_stops(experiments, rig)
    return fit_model(guess_base_model(ready, rig, form), residual_models(ready), [])


def fitted(experiments: list[Experiment], form: str = "map") -> Model:
    return fit(experiments, form).model


def at_command(model: Model, u: float, chamber: int) -> float:
    return float((model.chamber_2_valve if chamber == 2 else model.valve)(np.array([u]))[0])


def test_a_5_3_valve_has_paths_of_its_own_for_either_chamber():
    """Mirrored by one spool: u fills chamber 1 and vents chamber 2. 3 %: 2 s of data with 3 mbar of noise."""
    rig = replace(RIG, valve_arrangement="5/3")
    true = Model(rig, (), FRICTION, FIRST, SECOND)
    found = fitted([axis(rig, true, stairs()), axis(rig, true, stairs(LEVELS[::-1]), seed=2)])
    for u in (2.0, 4.0, -2.0, -4.0):
        assert at_command(found, u, 1) == pytest.approx(at_command(true, u, 1), rel=0.03)
        assert at_command(found, u, 2) == pytest.approx(at_command(true, u, 2), rel=0.03)


def test_two_valves_follow_commands_of_their_own():
    rig = replace(RIG, valve_arrangement="two")
    true = Model(rig, (), FRICTION, FIRST, SECOND)
    second = stairs((-2.0, 2.5, -4.0, 4.0, -2.5, 2.0, -3.0, 3.0))
    found = fitted([axis(rig, true, stairs(), second)])
    for u in (2.0, 4.0, -2.0, -4.0):
        assert at_command(found, u, 1) == pytest.approx(at_command(true, u, 1), rel=0.03)
        assert at_command(found, u, 2) == pytest.approx(at_command(true, u, 2), rel=0.03)


@pytest.mark.parametrize("null", [5.0, -0.7])
def test_the_null_command_lies_between_what_vents_and_what_fills(null: float):
    """Of a valve of 0 to 10 V that rests near 5 V, driven by a sine: within 50 mV of the truth."""
    rig = replace(RIG, valve_arrangement="5/3", valve_null=null)
    true = Model(rig, (), FRICTION, FIRST, SECOND)
    driven = axis(rig, true, null + 3.0 * np.sin(2 * np.pi * 0.5 * 1e-3 * np.arange(4000)))
    found = with_identified_null([driven.recording], replace(rig, valve_null=0.0, null_free=True))
    assert found.valve_null == pytest.approx(null, abs=0.05)
    low, high = found.null_range
    assert low <= null <= high


@pytest.mark.parametrize(("moved", "seen"), [(0.0, None), (1.2, ("before", "after"))])
def test_recordings_without_a_null_command_in_common_are_named(moved: float, seen: tuple[str, str] | None):
    rig = replace(RIG, valve_arrangement="5/3")
    swing = 3.0 * np.sin(2 * np.pi * 0.5 * 1e-3 * np.arange(4000))
    takes = {}
    for name, null in (("before", 5.0), ("after", 5.0 + moved)):
        at_null = replace(rig, valve_null=null)
        driven = axis(at_null, Model(at_null, (), FRICTION, FIRST, SECOND), null + swing)
        takes[name] = replace(driven.recording, name=name)
    assert drifting_recordings(with_identified_null(list(takes.values()), replace(rig, null_free=True))) == seen
    assert drifting_recordings(replace(rig, valve_null=5.0)) is None


@pytest.mark.parametrize("area", [2e-8, 0.0])
def test_a_leak_does_not_move_the_null_to_where_the_valve_feeds_it(area: float):
    """A valve that is shut within 0.3 V, and a leak of 2.5 % of its area: the flow alone changes sign beside it."""
    rig = replace(RIG, valve_arrangement="5/3", valve_null=0.0)
    edges = {"overlap_fill": 0.3, "overlap_vent": 0.3}
    true = Model(
        rig, (catalogue()["chamber-leak"],), FRICTION | {"chamber-leak.area": area}, replace(FIRST, **edges), SECOND
    )
    time = 1e-3 * np.arange(20_000)
    driven = axis(rig, true, np.sin(2 * np.pi * 0.2 * time) + np.sin(2 * np.pi * 1.3 * time))
    found = with_identified_null([driven.recording], replace(rig, null_free=True))
    print(found.valve_null, found.null_range)
    low, high = found.null_range
    assert found.valve_null == pytest.approx(0.0, abs=0.05)
    assert -0.5 < low < -0.2 < 0.2 < high < 0.5


def test_a_gap_between_commands_is_the_range_of_the_null():
    rig = replace(RIG, valve_arrangement="5/3", valve_null=5.0)
    true = Model(rig, (), FRICTION, FIRST, SECOND)
    stepped = axis(rig, true, 5.0 + stairs())
    low, high = with_identified_null([stepped.recording], replace(rig, valve_null=0.0, null_free=True)).null_range
    assert (low, high) == (pytest.approx(3.0, abs=0.1), pytest.approx(7.0, abs=0.1))


def test_an_unobservable_null_is_refused():
    rig = replace(RIG, valve_arrangement="5/3")
    filling = axis(rig, Model(rig, (), FRICTION, FIRST, SECOND), np.full(1000, 3.0))
    with pytest.raises(InputError, match="never both filled and vented"):
        with_identified_null([filling.recording], replace(rig, null_free=True))


def test_a_switching_valve_is_one_area_each_way():
    rig = replace(RIG, valve_arrangement="5/3", valve_kind="switching")
    one, two = SwitchingValve(8e-7, 6e-7, 10.0), SwitchingValve(5e-7, 7e-7, 10.0, "valve_2")
    true = Model(rig, (), FRICTION, one, two)
    found = fitted([axis(rig, true, np.sign(stairs()) * 1.0)], "switching")
    for valve, wanted in ((found.valve, one), (found.valve_2, two)):
        assert valve.fill == pytest.approx(wanted.fill, rel=0.03)
        assert valve.vent == pytest.approx(wanted.vent, rel=0.03)


# --- A driven piston without any sensor of pressure: command and position alone, the pressures are the model's


GAIN = 1.8e-7  # m^2/V
RIG_5_3 = replace(RIG, valve_arrangement="5/3")


def record(levels: list[float], seed: int, rig: Rig = RIG_5_3, null: float = 0.0) -> Experiment:
    """A 5/3 valve drives the piston to and fro; u and x are recorded."""
    time = time_grid(4.0)
    u = held_commands(time, levels, 0.5)
    exact = make_experiment("axis", time, {"u": u, "u2": -u, "x": 0.1, "p1": BALANCED["p1"]}, "valve", rig=rig)
    true = replace(model(rig=rig), valve=LinearValve(GAIN, 10.0))
    x = run(true, exact)[:, at.X] + np.random.default_rng(seed).normal(scale=5e-6, size=time.size)
    return prepare(replace(exact.recording, signals={"u": u + null, "x": x}), replace(rig, valve_null=null), 0.5)


@pytest.fixture(scope="module")
def blind() -> list[Experiment]:
    return [
        record([2.0, -2.0, 3.0, -2.5, 1.5, -1.5, 2.5, -3.0], 5),
        record([-1.5, 2.5, -3.0, 2.0, -2.0, 3.0, -2.5, 1.5], 6),
    ]


def test_friction_and_gain_are_identified_from_command_and_position(blind: list[Experiment]) -> None:
    """Each interval holds the truth and is no wider, but that of viscous friction, which the valve throttles alike."""
    views = residual_models(blind, whiten_initial_state=True)
    found = fit_model(guess_base_model(blind, RIG_5_3, "linear"), views, [])
    found = with_intervals(found, views)
    for name, true in (FRICTION | {"valve.gain": GAIN}).items():
        low, high = found[name].ci95
        assert low <= true <= high
        assert high - low < true or name == "friction.viscous"
    assert {e.name for e in found.estimates} == {*FRICTION, "valve.gain"}


def test_both_pressures_are_inferred_and_none_is_compared(blind: list[Experiment]) -> None:
    assert blind[0].inferred_pressures == ("p1", "p2")
    assert blind[0].channels == ("x", "v")
    assert [one.channels for one in residual_models(blind[:1])] == [("force",)]


def test_no_leak_shows_without_a_pressure(blind: list[Experiment]) -> None:
    """A leak and a valve that fills less than it vents move the piston alike; friction and lag are seen in motion."""
    can = {name for name, e in catalogue_with_sides().items() if blind[0].can_show(e)}
    assert not {"chamber-leak", "laminar-leak", "opening-leak", "piston-leak", "valve-leak", "pressure-offset"} & can
    assert {"stribeck", "position-friction", "constant-force", "valve-lag", "valve-deadband"} <= can
    with pytest.raises(InputError, match=r"(?s)piston-leak. changes nothing that can be told.*record the pressures"):
        fit_model(
            guess_base_model(blind, RIG_5_3, "linear"), residual_models(blind), [catalogue_with_sides()["piston-leak"]]
        )


def test_no_effect_is_named_from_motion_alone(blind: list[Experiment]) -> None:
    """An error of the valve's flow passes for friction and forces; a test with a measured force tells them."""
    views, stribeck = residual_models(blind), catalogue_with_sides()["stribeck"]
    assert has_unmeasured_force(views, stribeck)
    time = time_grid(1.0)
    pushed = make_experiment("friction", time, {"x": 0.1 + 0.01 * np.sin(time), "force": 20.0}, "open")
    read = replace(pushed, raw={n: pushed.raw[n] for n in ("x", "force")})
    assert not has_unmeasured_force([*views, ForceBalance(read)], stribeck)
    assert [one[:14] for one in unmeasured_pressure_warnings(views)] == ["bench, bench: ", "bench, bench: "]


def test_rests_on_a_stated_end_carry_no_force(blind: list[Experiment]) -> None:
    """The force on the piston is unknown: only where the end is, which the rig states, tells it."""
    x = np.where(blind[0].time < 1.0, 0.0, blind[0].inputs[:, at.IN_X])
    inputs = blind[0].inputs.copy()
    inputs[:, at.IN_X], inputs[blind[0].time < 1.0, at.IN_V] = x, 0.0
    (ended,) = with_end_stops([replace(blind[0], inputs=inputs)], RIG_5_3)
    assert ended.detected_ends[0] == pytest.approx(0.0, abs=1e-6)
    assert not ended.is_free[ended.time < 0.9].any()
    assert with_end_stops(blind[:1], RIG_5_3)[0].is_free.all()


def test_it_is_said_before_the_fit_what_shows(blind: list[Experiment]) -> None:
    recording = blind[0].recording
    told = [one.what for one in assumptions([recording], RIG_5_3)]
    assert any("only in ratio" in one and "no leak" in one for one in told)
    assert any("one gain" in one for one in told)
    read = replace(recording, signals={**recording.signals, "p1": np.full(recording.time.size, 3e5)})
    assert not any("only in ratio" in one.what for one in assumptions([read], RIG_5_3))
    assert [tells_valve_map([one]) for one in (recording, read)] == [False, True]


def test_the_null_command_follows_from_the_motion(blind: list[Experiment]) -> None:
    """Within the overlap of what was commanded: 1.5 V on either side of 5 V."""
    recording = replace(blind[0].recording, signals={**blind[0].recording.signals, "u": blind[0].raw["u"] + 5.0})
    found = with_identified_null([recording], replace(RIG_5_3, null_free=True))
    assert found.valve_null == pytest.approx(5.0, abs=0.5)


PIPELINE = """
[pipeline]
name = "blind"
[rig]
supply_pressure = "7 bar"
ambient_pressure = "1.013 bar"
[rig.cylinder]
piston_area_1 = "8.04 cm^2"
piston_area_2 = "7.0 cm^2"
stroke = "200 mm"
dead_volume_1 = "32 cm^3"
dead_volume_2 = "30 cm^3"
moving_mass = "2.2 kg"
[rig.valve]
arrangement = "5/3"
[signals]
time = { column = "t", unit = "s" }
u = { column = "u", unit = "V" }
x = { column = "x", unit = "m" }
[[recordings]]
file = "run_*.csv"
experiment = "axis"
use = "train"
chamber_2 = "valve"
"""


def test_a_pipeline_of_command_and_position_alone_is_identified(blind: list[Experiment], tmp_path: Path) -> None:
    for number, e in enumerate(blind):
        rows = np.column_stack([e.time, e.raw["u"], e.raw["x"]])
        np.savetxt(tmp_path / f"run_{number}.csv", rows, delimiter=",", header="t,u,x", comments="")
    path = tmp_path / "pipeline.toml"
    path.write_text(PIPELINE)
    answers = run_stages(path, tmp_path / "out")
    told = answers["identify"]
    gain = told["model"]["parameters"]["valve.gain"]
    assert gain["unit"] == "m^2/V"
    assert gain["value"] == pytest.approx(GAIN, rel=0.1)
    assert "valve" not in told
    assert any("one gain for all commands" in one["what"] for one in told["assumed"])
    assert {one["channel"] for one in answers["compare"]["channels"]} == {"x", "v"}
    compared = read(Answer, answers["compare"])
    assert replace(compared, lack_of_fit=None, error={"train": 9.0}).next_step("p.toml").startswith("record p1")
    seen = replace(compared, lack_of_fit=None, error={"train": 9.0}, without_pressure=None)
    assert seen.next_step("p.toml") == "pneucli diagnose p.toml"
