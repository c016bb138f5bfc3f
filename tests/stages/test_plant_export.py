"""The demo's plant from its recordings to the FMU, and the budgets of its valve."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pneucli import messages
from pneucli.config import load
from pneucli.errors import InputError
from pneucli.exam.from_pipeline import exam_rig
from pneucli.exam.rig.kernel import valve_area
from pneucli.io.artifacts import read_table
from pneucli.pipeline.graph import Context, NotApplicable
from pneucli.recording import Rig
from pneucli.stages import export
from pneucli.stages.pipeline_data import PipelineData
from tests.stages.conftest import DEMO

Demo = tuple[Path, dict[str, Any]]


def exported(demo: Demo, out: Path, *targets: str) -> dict[str, Any]:
    answers = {name: demo[1][name] for name in ("ingest", "identify")}  # no controller was designed
    return export.run(Context(DEMO, load(DEMO), out, demo[0], answers=answers, options={"to": list(targets)}))


def test_the_plant_has_the_identified_numbers_with_their_intervals(demo: Demo, tmp_path: Path) -> None:
    fmpy = pytest.importorskip("fmpy", reason="needs FMPy")
    answer = exported(demo, tmp_path, "fmu")
    assert answer["files"] == ["pneucli_plant.fmu"]
    identified = demo[1]["identify"]["model"]["parameters"]["friction.coulomb"]
    assert answer["plant"]["parameters"]["friction.coulomb"] == identified
    assert answer["plant"]["inputs"] == ["u", "p_supply", "force"]
    described = {v.name: v for v in fmpy.read_model_description(tmp_path / "pneucli_plant.fmu").modelVariables}
    assert float(described["friction.coulomb"].start) == identified["value"]
    assert "95 % interval" in described["friction.coulomb"].description
    assert float(described["u"].start) == 5.0  # the null command
    assert "plant with" in messages.render("export", answer, "demo.toml", verbose=False)


def test_without_a_design_there_is_no_controller_to_export(demo: Demo, tmp_path: Path) -> None:
    with pytest.raises(NotApplicable, match="no controller"):
        exported(demo, tmp_path, "c")


def test_one_interval_of_c_stands_everywhere(demo: Demo) -> None:
    answer, out = demo[1]["identify"], demo[0] / "identify"
    table, budgets = read_table(out / "parameters.parquet"), answer["uncertainty"]["budgets"]
    ends = {n: [low, high] for n, low, high in zip(table["name"], table["ci_low"], table["ci_high"], strict=True)}
    of_c = {name: one for name, one in budgets.items() if "sonic_conductance" in name}
    assert len(of_c) >= 10
    for name, one in of_c.items():
        label = name.partition(".")[0]
        assert one["interval"] == pytest.approx(ends[name])
        assert one["interval"] == pytest.approx(answer[label]["iso"][name]["ci95"])
        assert sum(source["share"] for source in one["sources"]) == pytest.approx(1.0)
    rows = read_table(out / "uncertainty_budget.parquet")
    assert set(of_c) <= set(rows["name"])
    assert "budget" in messages.render("identify", answer, "demo.toml", verbose=False)


# --- the user's bench as the exam's own rig has it


def test_the_rig_is_set_to_what_was_identified(demo: tuple[Path, dict[str, Any]]) -> None:
    out, answers = demo
    study = PipelineData(Context(DEMO, load(DEMO), out, out, answers=answers))
    model = study.identified_model
    bench = exam_rig(study)
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
    other: Rig = replace(study.rig, valve_kind="switching")
    monkeypatch.setitem(study.__dict__, "rig", other)
    with pytest.raises(InputError, match="switching"):
        exam_rig(study)
