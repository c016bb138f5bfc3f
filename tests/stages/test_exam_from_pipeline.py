"""The user's bench as the exam's own rig has it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pneucli.config import load
from pneucli.errors import InputError
from pneucli.exam.from_pipeline import exam_rig
from pneucli.exam.rig.kernel import valve_area
from pneucli.pipeline.context import Context
from pneucli.recording import Rig
from pneucli.stages.model_file import load_model
from pneucli.stages.pipeline_data import PipelineData
from tests.stages.conftest import DEMO


def test_the_rig_is_set_to_what_was_identified(demo: tuple[Path, dict[str, Any]]) -> None:
    out, answers = demo
    study = PipelineData(Context(DEMO, load(DEMO), out, out, answers=answers))
    model = load_model(out / "identify", study.rig, study.effects)
    bench = exam_rig(study, model)
    par = bench.parameters
    assert (par.coulomb, par.stroke, par.supply) == (
        model.values["friction.coulomb"],
        study.rig.stroke,
        study.rig.supply_pressure,
    )
    assert [r.name for r in bench.recordings] == [r.name for r in study.recordings]
    assert bench.vessel_volume == study.rig.vessel_volume
    assert bench.sensors.pressure == pytest.approx(np.median([r.noise["p1"].rms for r in study.recordings]))
    commands = np.array([c for c in model.valve.commands if c > 0.0])
    areas = [valve_area(par, float(c), 0.0) for c in commands]
    assert areas == pytest.approx(list(model.valve(commands)), rel=0.3)  # one power law for all knots, both sides


def test_a_rig_that_the_exams_cannot_be_is_refused(
    demo: tuple[Path, dict[str, Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    out, answers = demo
    study = PipelineData(Context(DEMO, load(DEMO), out, out, answers=answers))
    model = load_model(out / "identify", study.rig, study.effects)
    other: Rig = replace(study.rig, valve_kind="switching")
    monkeypatch.setitem(study.__dict__, "rig", other)
    with pytest.raises(InputError, match="switching"):
        exam_rig(study, model)
