"""The stage ``compare`` on the example: the interface's answer and table, and the error near the noise floor."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli import messages
from pneucli.closed_loop.simulation import simulate
from pneucli.compare import Comparison
from pneucli.config import load
from pneucli.controller import layout as at
from pneucli.errors import InputError
from pneucli.export import export_files
from pneucli.export.controller_program import ExportedController, load_controller
from pneucli.figure import read
from pneucli.io.artifacts import read_table
from pneucli.messages.compare import Answer
from pneucli.noise import NoiseModel
from pneucli.pipeline.graph import Context, Progress
from pneucli.quantities import CHANNELS, RESIDUAL_VARIABLES
from pneucli.recording import Recording
from pneucli.simulate.preparation import prepare
from pneucli.stages import compare
from pneucli.stages.diff import Difference, ErrorChange, RunAnswers, difference
from pneucli.stages.pipeline_data import PipelineData
from tests.design import axis
from tests.stages.conftest import DEMO

Demo = tuple[Path, dict[str, Any]]


@pytest.fixture
def answer(demo: Demo) -> dict[str, Any]:
    return demo[1]["compare"]


def test_the_answer_has_the_interfaces_keys(answer: dict[str, Any]) -> None:
    json.dumps(answer, allow_nan=False)
    assert answer["schema"] == "pneucli/compare/1"
    assert answer["horizon_s"] == 0.5
    assert answer["model"]["effects"] == ["stribeck", "piston-leak"]
    assert {c["channel"] for c in answer["channels"]} <= set(CHANNELS)
    for region in answer["where"]:
        assert region["signal"] in RESIDUAL_VARIABLES
        assert region["from"] < region["to"]
        assert region["share_of_samples"] < region["share_of_error"] <= 1.0


def test_every_recording_and_channel_is_there(answer: dict[str, Any]) -> None:
    channels: dict[str, set[str]] = {}
    for c in answer["channels"]:
        channels.setdefault(c["recording"], set()).add(c["channel"])
    assert channels["step_+5.0V"] == {"p1"}
    assert channels["driven_1"] == {"x", "v", "a"}
    assert channels["axis_1"] == {"p1", "p2", "x", "v", "a"}
    assert len(channels) == 26


def test_the_right_model_is_near_the_noise_floor(answer: dict[str, Any]) -> None:
    """Single break-aways may miss by more: a piston at the brink is as the noise has it. The middle of all does not.

    Of the six test recordings one is friction alone; its break-aways leave twice the noise.
    """
    ratios = [c["ratio_to_noise"] for c in answer["channels"] if c["ratio_to_noise"] is not None]
    assert np.median(ratios) == pytest.approx(1.0, abs=0.15)
    pressures = [c["ratio_to_noise"] for c in answer["channels"] if c["channel"] == "p1"]
    assert max(pressures) < 1.2
    assert 0.8 < answer["error"]["test"] < 1.5
    judged = answer["lack_of_fit"]
    assert (judged["present"], judged["undetermined"], judged["use"]) == (False, False, "test")
    assert answer["error"]["test"] == judged["error"] < judged["limit"] < 2.0
    within = [c["ratio_to_noise"] < c["ratio_limit"] for c in answer["channels"] if c["ratio_limit"]]
    assert np.mean(within) > 0.75  # 95 % of independent channels; friction alone leaves twice the noise


def test_residuals_add_up_to_the_answer(demo: Demo, answer: dict[str, Any]) -> None:
    table = {k: np.asarray(v) for k, v in read_table(demo[0] / "compare" / "residuals.parquet").items()}
    columns = {"recording", "use", "time", "channel", "unit", "measured", "model", "residual", "segment"}
    assert columns <= table.keys()
    for c in answer["channels"][::7]:
        mine = (table["recording"] == c["recording"]) & (table["channel"] == c["channel"])
        assert np.sqrt(np.nanmean(table["residual"][mine] ** 2)) == pytest.approx(c["rmsd"], rel=1e-9)
        assert table["residual"][mine] == pytest.approx((table["measured"] - table["model"])[mine], nan_ok=True)
        span = table["time"][mine][-1] - table["time"][mine][0]
        assert np.unique(table["segment"][mine]).size == int(np.ceil(span / answer["horizon_s"]))


def test_people_read_the_test_recordings_first(answer: dict[str, Any]) -> None:
    told = messages.render("compare", answer, "demo.toml", verbose=True).splitlines()
    uses = [line.split()[1] for line in told[-len(answer["channels"]) :]]
    assert uses == sorted(uses)  # test, then train
    assert told[0].startswith("error ")


@pytest.mark.parametrize("period", [2.0, 0.5, 0.2])
def test_time_in_the_wrong_unit_is_refused_before_anything_is_simulated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, period: float
) -> None:
    """Milliseconds taken as seconds: 0.5 to 5 kHz look like one sample every 2 s to 0.2 s; 0.5 s are stated."""
    monkeypatch.setattr("pneucli.stages.pipeline_data.prepare", lambda *arguments: pytest.fail("it was simulated"))
    time = period * np.arange(50)
    slow = Recording("slow", "valve", "train", time, {"u": time, "p1": 1e5 + time}, {})
    study = PipelineData(Context(DEMO, load(DEMO), tmp_path, tmp_path))
    monkeypatch.setitem(study.__dict__, "_loaded", ([slow], [], load(DEMO).compare.horizon))
    with pytest.raises(InputError, match=f"slow has a sample every {period:g} s, the horizon is 0.5 s") as error:
        _ = study.experiments
    assert 'unit = "ms"' in str(error.value)


def test_hours_of_recordings_are_told_before_they_are_simulated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A horizon that is stated long enough is taken; but so is time in the wrong unit."""
    told: list[str] = []
    monkeypatch.setattr(
        "pneucli.stages.pipeline_data.prepare", lambda *arguments: SimpleNamespace(channels=(), recording=slow)
    )
    monkeypatch.setattr("pneucli.stages.pipeline_data.with_intersample_commands", lambda experiments, rig: experiments)
    monkeypatch.setattr("pneucli.stages.pipeline_data.with_common_command_range", lambda experiments: experiments)
    time = 0.1 * np.arange(72_000)
    slow = Recording("slow", "valve", "train", time, {"u": time, "p1": 1e5 + time}, {})

    class Told(Progress):
        def __call__(self, message: str, share: float | None = None) -> None:
            told.append(message)

    study = PipelineData(Context(DEMO, load(DEMO), tmp_path, tmp_path, progress=Told()))
    monkeypatch.setitem(study.__dict__, "_loaded", ([slow], [], load(DEMO).compare.horizon))
    _ = study.experiments
    assert told[0] == "2 h of recordings, if the unit of time is right: this takes long"


def test_a_dead_sensor_is_refused_but_an_open_chamber_may_stand_still(tmp_path: Path) -> None:
    study = PipelineData(Context(DEMO, load(DEMO), tmp_path, tmp_path))
    dead: Any = SimpleNamespace(channels=("p2",), noise={"p2": NoiseModel(0.0)})
    for chamber_2, refused in (("closed", True), ("open", False)):
        dead.recording = SimpleNamespace(name="axis_1", chamber_2=chamber_2)
        if refused:
            with pytest.raises(InputError, match="p2 never changes in axis_1"):
                study._require_noise(dead)
        else:
            study._require_noise(dead)


# --- two runs side by side


def run(effects: list[str], error: float, data: str = "d", **parameters: tuple[float, float]) -> RunAnswers:
    """A run with one recording; a parameter is its value and half of its interval."""
    found = {
        name.replace("_", "."): {"value": value, "unit": "N", "ci95": [value - half, value + half]}
        for name, (value, half) in parameters.items()
    }
    channel = {"recording": "slow", "use": "test", "channel": "x", "ratio_to_noise": error}
    compare = {
        "pipeline": "bench",
        "model": {"effects": effects, "parameters": found},
        "error": {"train": None, "test": error},
        "data": data,
        "channels": [channel],
    }
    return RunAnswers("bench.toml", read(Answer, compare), None)


def shown(answer: Difference, *, verbose: bool = False) -> str:
    return " ".join("\n".join(answer.lines("bench.toml", verbose)).split())


def test_effects_and_errors_of_both_are_told() -> None:
    answer = difference(run(["stribeck"], 9.0), run(["piston-leak"], 1.1))
    assert answer.effects == {"only_a": ["stribeck"], "only_b": ["piston-leak"]}
    assert answer.recordings == [ErrorChange("slow", "test", 9.0, 1.1)]
    assert "only A: stribeck; only B: piston-leak" in shown(answer)
    assert "9.00 → 1.10 × noise on test recordings" in shown(answer)


def test_parameters_beyond_their_intervals_come_first_and_alone_are_shown() -> None:
    a = run([], 1.0, friction_coulomb=(10.0, 3.0), friction_viscous=(50.0, 1.0))
    b = run([], 1.0, friction_coulomb=(14.0, 4.0), friction_viscous=(60.0, 1.0))
    answer = difference(a, b)
    assert [(row.name, row.beyond) for row in answer.parameters] == [
        ("friction.viscous", True),
        ("friction.coulomb", False),
    ]
    assert answer.parameters[1].difference == pytest.approx(4.0)
    assert answer.parameters[1].ci95 == pytest.approx([-1.0, 9.0])
    assert answer.parameters[1].distance == pytest.approx(0.8)
    assert "1 of 2 parameters differ" in shown(answer)
    assert "friction.coulomb" not in shown(answer)
    assert "friction.coulomb" in shown(answer, verbose=True)


def test_a_parameter_that_one_model_lacks_is_no_difference() -> None:
    (row,) = difference(run([], 1.0), run([], 1.0, leak_area=(1.0, 0.1))).parameters
    assert (row.a, row.beyond, row.distance) == (None, None, None)


def test_errors_on_other_recordings_are_said_not_to_compare() -> None:
    answer = difference(run([], 9.0, "monday"), run([], 1.1, "tuesday"))
    assert not answer.same_data
    assert "do not compare" in shown(answer)
    assert "do not compare" not in shown(difference(run([], 9.0), run([], 1.1)))


# --- logs of a running controller within ``compare``: u as a channel, and what was foretold beside what came


MODEL, CONTROLLER = axis.model(), axis.controller()
TIME = 1e-3 * np.arange(3000)
REFERENCE = np.where(TIME < 0.5, 0.1, 0.12)


@pytest.fixture(scope="module")
def recording() -> Recording:
    log = simulate(MODEL, CONTROLLER, axis.scenario(CONTROLLER, REFERENCE), axis.BENCH, seed=4).log
    read = {"x": at.L_READ_X, "p1": at.L_READ_P1, "p2": at.L_READ_P2, "u": at.L_U1}
    digits = {"x": 9, "p1": 1, "p2": 1, "u": 5}
    signals = {"x_ref": REFERENCE, **{name: np.round(log[:, place], digits[name]) for name, place in read.items()}}
    noise = {"x": NoiseModel(white=0.0, step=1e-6), "u": NoiseModel(white=0.0, step=1e-5)}
    noise |= {name: NoiseModel(white=400.0, step=0.1) for name in ("p1", "p2")}
    return Recording("log", "closed-loop", "test", TIME, signals, noise, chamber_2="closed")


def compared(recording: Recording, controller=CONTROLLER) -> Comparison:
    looked = compare.replay_recording(MODEL, recording, ExportedController(controller, "float64", "hash"))
    bare = Comparison(prepare(recording, axis.RIG, 0.5), (), {}, {})
    return compare.with_commands(bare, {"log": looked}, MODEL)


def test_the_command_of_the_controller_that_ran_stands_within_its_rounding(recording: Recording) -> None:
    (u,) = compared(recording).results
    assert (u.channel, u.unit) == ("u", "V")
    assert 1e-6 < u.noise < 1e-3
    assert 0.2 < u.ratio_to_noise < 2.0


def test_the_command_of_another_controller_does_not(recording: Recording) -> None:
    (u,) = compared(recording, CONTROLLER.with_values(C_P_KP=0.5 * CONTROLLER.values["C_P_KP"])).results
    assert u.ratio_to_noise > 100.0


def test_a_recording_without_a_known_controller_is_left_as_it_is(recording: Recording) -> None:
    bare = Comparison(prepare(recording, axis.RIG, 0.5), (), {}, {})
    assert compare.with_commands(bare, {}, MODEL) is bare


def test_what_was_foretold_stands_beside_what_came(recording: Recording) -> None:
    told = compare.log_answer(
        compare.replay_recording(MODEL, recording, ExportedController(CONTROLLER, "float64", "hash")), MODEL
    )
    assert told.measured["steady_um"] < 10.0
    assert told.foretold["settling_s"] == pytest.approx(told.measured["settling_s"], rel=0.3)
    assert told.sentence.startswith("log, best: error at rest ")
    assert "predicted" in told.sentence


def test_controllers_are_found_beside_the_pipeline_and_an_unknown_one_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    export_files.write_replay(tmp_path, CONTROLLER, "demo", "float64")
    tables = {"a": "pneucli_controller.c", "b": "unknown", "c": None}
    found = [
        SimpleNamespace(name=n, where="pipeline.toml", table=SimpleNamespace(controller=c)) for n, c in tables.items()
    ]
    monkeypatch.setattr(compare, "recording_sources", lambda config: found)
    context = SimpleNamespace(config=None, path=tmp_path / "pipeline.toml")
    assert compare.controllers_by_recording(context) == {
        "a": load_controller(tmp_path / "pneucli_controller.c", "here")
    }
    found[0].table.controller = "nowhere/controller.c"
    with pytest.raises(InputError, match="controller"):
        compare.controllers_by_recording(context)
