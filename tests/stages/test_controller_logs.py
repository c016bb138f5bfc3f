"""Logs of a running controller within ``compare``: u as a channel, and what was foretold beside what came."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from pneucli.closed_loop.simulation import simulate
from pneucli.compare import Comparison
from pneucli.controller import layout as at
from pneucli.errors import InputError
from pneucli.export import export_files
from pneucli.export.controller_program import ExportedController, load_controller
from pneucli.noise import NoiseModel
from pneucli.recording import Recording
from pneucli.simulate.preparation import prepare
from pneucli.stages import compare
from tests.design import axis

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
