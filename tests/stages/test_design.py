"""The stages ``design``, ``simulate`` (closed loop) and ``export`` on the example, after its identification."""

import json
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pneucli import messages
from pneucli.closed_loop import commissioning, ensemble
from pneucli.closed_loop.metrics import COMPONENTS
from pneucli.config import load
from pneucli.controller.laws import LAWS
from pneucli.errors import InputError
from pneucli.exam.from_pipeline import exam_rig
from pneucli.exam.rig.kernel import valve_area
from pneucli.figure import to_json
from pneucli.io.artifacts import read_metadata, read_table
from pneucli.messages.simulate import Answer
from pneucli.pipeline.graph import Context, NotApplicable
from pneucli.recording import Rig
from pneucli.stages import control_laws, design, export, simulate
from pneucli.stages.control_laws import load_controller, selected_controller
from pneucli.stages.pipeline_data import PipelineData
from tests.stages.chain import known_as_declared
from tests.stages.conftest import DEMO

Demo = tuple[Path, dict[str, Any]]
SCENARIOS = ("steps", "sine", "load", "pressure")  # in which the laws are compared
AXES = 5  # of the gate: the model, and two parameters at both ends


def context_of(demo: Demo, stage: str, path: Path = DEMO, **more: Any) -> Context:
    folder = demo[0] / stage
    folder.mkdir(exist_ok=True)
    return Context(path, load(path), folder, demo[0], answers=demo[1], **more)


def ask_less(patch: pytest.MonkeyPatch, axes: int) -> None:
    """Compare the laws in few scenarios, and hold the gate on few axes: what it does on all is tested where it is."""
    scenarios, variants = design.closed_loop_scenarios, design.axis_variants
    patch.setattr(design, "closed_loop_scenarios", lambda *of: [s for s in scenarios(*of) if s.name in SCENARIOS])
    patch.setattr(design, "axis_variants", lambda *of: islice(variants(*of), axes))


@pytest.fixture(scope="module")
def designed(demo: Demo) -> Demo:
    with pytest.MonkeyPatch.context() as few:
        ask_less(few, AXES)
        answer = design.run(context_of(demo, "design"))
    return demo[0], demo[1] | {"design": answer}


@pytest.fixture
def on_the_model_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    ask_less(monkeypatch, axes=1)


def edited(tmp_path: Path, more: str) -> Path:
    """The example with another end; raw files are found where they are."""
    text = DEMO.read_text(encoding="utf-8").replace('file = "', f'file = "{DEMO.parent}/')
    (tmp_path / "pipeline.toml").write_text(text + more, encoding="utf-8")
    return tmp_path / "pipeline.toml"


def test_the_design_says_what_it_chose_and_what_does_not_hold(designed: Demo) -> None:
    answer = designed[1]["design"]
    json.dumps(answer, allow_nan=False)
    known_as_declared("design", answer)
    assert answer["matching"]["whole"]["broken_by"] == {"friction and load": ["v"]}
    assert answer["matching"]["mechanical"]["holds"]
    assert answer["sector"]["resolved"]["steepness"] <= 0.2 < answer["sector"]["vertices"]["steepness"]
    assert "too steep" in answer["sector"]["vertices"]["remark"]
    assert answer["sector"]["design"]["steepness"] <= 0.2
    assert answer["sector"]["design"]["eta"] < answer["sector"]["vertices"]["eta"]
    assert answer["gate"]["axes"] == AXES
    assert "decay rate" in messages.render("design", answer, "demo.toml", verbose=True)


def test_the_margins_are_those_of_the_loop_that_is_exported(designed: Demo) -> None:
    found = designed[1]["design"]["margins"]
    assert found["stable"]
    assert {p["loop"] for p in found["points"]} == {"command", "position"}
    assert len(found["points"]) + 2 * len(found["stuck"]) == 12
    assert found["worst"]["position"]["delay"] == min(p["delay"] for p in found["points"] if p["loop"] == "position")
    ratios = read_table(designed[0] / "design" / "margins.parquet")
    assert set(ratios["loop"]) == {"command", "position"}
    assert "margins" in messages.render("design", designed[1]["design"], "demo.toml", verbose=False)


def test_gains_from_an_ensemble_are_chosen_compared_and_promised(
    demo: Demo, designed: Demo, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, on_the_model_alone: None
) -> None:
    for name, value in (("LAGS", (0.0, 5e-3)), ("PRESSURE_SHARES", (1.0, 0.5)), ("POSITION_SHARES", (1.4,)),
                        ("SEARCH_RIGS", 5), ("SCREENING_RIGS", 2)):  # fmt: skip
        monkeypatch.setattr(ensemble, name, value)
    for name, value in (("ADDED", commissioning.ADDED[:1]), ("MEMBER_SHARES", (1.4,)), ("MEMBER_RIGS", 2)):
        monkeypatch.setattr(commissioning, name, value)
    for name, value in (("PROOF_RIGS", 6), ("LAW_RIGS", 6), ("LAW_SEARCH_RIGS", 2)):
        monkeypatch.setattr(design, name, value)
    monkeypatch.setattr(design, "compare_weight_types", lambda *_: [])  # for a law that is not asked for
    monkeypatch.setattr(control_laws, "COMPONENTS", ())
    path = edited(tmp_path, '\n[design]\ngains = "ensemble"\n')
    chosen = {"compare": ["best", "pid"]}
    answer = design.run(Context(path, load(path), tmp_path, demo[0], answers=demo[1], options=chosen))
    json.dumps(answer, allow_nan=False)
    known_as_declared("design", answer)
    rows = answer["ensemble"]["laws"]
    assert set(rows) == {"best", "best, by the rules", "pid", "pid, ensemble"}
    assert all(row["rigs"] == 6 and 0.0 <= row["probability"] <= row["held"] / 6 for row in rows.values())
    chosen_lag = answer["ensemble"]["spool_lag"]["value"]
    assert (load_controller(tmp_path, "best").values["C_SPOOL_SHARE"] < 1.0) == (chosen_lag > 0.0)
    assert load_controller(tmp_path, "best") != load_controller(designed[0] / "design", "best")
    assert load_controller(tmp_path, "pid") == load_controller(designed[0] / "design", "pid")
    shown = " ".join(messages.render("design", answer, "demo.toml", verbose=False).split())
    assert "rigs that the search did not see" in shown


def test_every_rate_that_is_told_is_verified(designed: Demo) -> None:
    lmi = designed[1]["design"]["lmi"]
    told = [t for t in lmi["types"] if t["rate"] is not None]
    assert told
    assert all(t["verified"] and t["status"] == "optimal" for t in told)
    assert lmi["best"] == max(told, key=lambda t: t["rate"])["weight_type"]


def test_the_sensors_come_from_the_recordings(designed: Demo) -> None:
    """The example's sensors: 400 Pa, counts of 1 um; nothing is sealed where a valve drives both chambers."""
    wanted = designed[1]["design"]["requirements"]
    assert wanted["noise_p"] == pytest.approx(400.0, rel=0.05)
    assert wanted["quantum_x"] == pytest.approx(1e-6)
    assert load_controller(designed[0] / "design", "best").values["C_P_MEAN"] == pytest.approx(
        (1.013e5 * 7e5) ** 0.5, rel=1e-3
    )


def test_the_artifacts_carry_units_and_provenance(designed: Demo) -> None:
    about = read_metadata(designed[0] / "design" / "sector.parquet")
    assert about["schema"] == "pneucli/design/sector/1"
    assert about["units"]["lambda_1"] == "1/s"
    assert "identify/model.parquet" in about["inputs"]
    gains = read_table(designed[0] / "design" / "gains.parquet")
    assert dict(zip(gains["name"], gains["unit"], strict=True))["C_KP"] == "1/s^2"


def test_the_closed_loop_on_the_identified_model_does_what_issue_and_checks_ask(designed: Demo, tmp_path: Path) -> None:
    """10 um at rest, five times less tracking error, 50 N rejected in 0.5 s and known to 10 %: the project's aims."""
    more = '\n[[scenarios]]\nkind = "closed-loop"\nname = "{0}"\nreference = "{1}"\n'
    path = edited(
        tmp_path,
        more.format("steps", "steps") + 'duration = "8 s"\n' + more.format("sine", "sine")
        + more.format("load", "hold") + 'load = "-50 N"\nload_to = "3.5 s"\n'
        + '\n[[scenarios]]\nkind = "monte-carlo"\nruns = 4\n',
    )  # fmt: skip
    study = PipelineData(context_of(designed, "simulate", path))
    answer = to_json(simulate.with_closed_loop(study, Answer("", "demo", [])))
    known_as_declared("simulate", answer)
    json.dumps(answer, allow_nan=False)
    loop, alone = answer["closed_loop"], answer["pid_alone"]
    assert loop["steps"]["steady_um"] <= 10.0
    assert 5.0 * loop["sine"]["tracking_rms_um"] <= alone["sine"]["tracking_rms_um"]
    assert loop["load"]["recovery_s"] <= 0.5
    assert loop["load"]["load_error"] <= 0.1
    assert answer["robust"]["runs"] == 4
    signals = read_table(designed[0] / "simulate" / "closed_loop.parquet")
    assert set(signals["controller"]) == {"compensated", "pid_alone"}
    told = messages.render("simulate", answer, "demo.toml", verbose=True)
    assert told.startswith("holds    ")
    assert "closed loop, " in told


def test_a_study_draws_no_effect_of_a_part_that_the_rig_has_not(designed: Demo) -> None:
    study = PipelineData(context_of(designed, "simulate"))
    model = study.identified_model
    drawn = {e.name for e in simulate.effects_to_draw(study, model)}
    assert {"valve-lag", "valve-deadband", "line-delay"} <= drawn
    assert not {"switching-time", "pressure-control", "pump-flow", "chamber-leak:2"} & drawn


def test_every_law_stands_on_the_bench_with_and_without_the_map(designed: Demo) -> None:
    answer = designed[1]["design"]
    assert set(answer["compare"]) == set(LAWS) == set(answer["controllers"])
    assert answer["not_made"] == {}
    assert set(answer["without_map"]) == {f"{name}, no map" for name in LAWS}
    assert list(answer["ablation"]) == ["nothing", *COMPONENTS]
    assert answer["ablation"]["nothing"] == answer["compare"]["best"]
    rest = {name: messages.design.worst_value(by, "steady_um") for name, by in answer["compare"].items()}
    assert max(rest["best"], rest["sector"]) <= answer["tolerance_um"] < min(rest["relay"], rest["pdc"])
    told = messages.render("design", answer, "demo.toml", verbose=True)
    assert "cascade without" in told
    assert "off" in next(line for line in told.splitlines() if line.strip().startswith("pdc"))
    table = read_table(designed[0] / "design" / "comparison.parquet")
    assert set(table["group"]) == {"law", "without map", "without", "variant"}


def test_the_controller_of_the_file_is_simulated_and_exported_and_another_one_on_demand(
    designed: Demo, tmp_path: Path, on_the_model_alone: None
) -> None:
    path = edited(tmp_path, '\n[design]\ncontroller = "relay"\nsurface = "lq"\nsurface_weights = [900.0, 1.0]\n')
    folder = context_of(designed, "relays", path, options={"compare": ["pid", "relay"]})
    answer = design.run(folder)
    assert list(answer["compare"]) == ["pid", "relay"]  # only those that are asked for are compared
    assert answer["ablation"] == {}
    assert set(answer["controllers"]) == set(LAWS)  # each can be exported all the same
    assert next(line for line in answer["surface"] if line["taken"])["slope"] == pytest.approx(30.0)
    assert selected_controller(folder.out, answer).law == "relay"
    asked = context_of(designed, "export", options={"to": ["c"], "controller": "pdc"})
    assert export.run(asked)["controller"] == "pdc"
    assert "parallel distributed" in (asked.out / "pneucli_controller.h").read_text(encoding="utf-8")


def test_the_export_writes_what_is_asked_for(designed: Demo) -> None:
    answer = export.run(context_of(designed, "export", options={"to": ["c", "csv"]}))
    assert {"pneucli_controller.h", "pneucli_controller.c", "pneucli_replay.csv", "valve_map.csv"} <= {*answer["files"]}
    assert not [name for name in answer["files"] if name.endswith(".mat")]


@pytest.mark.parametrize(
    ("more", "word"),
    [
        ('\n[design]\ntolerence = "5 um"\n', "tolerance"),
        ('\n[design]\ntolerance = "5 bar"\n', "tolerance"),
        ("\n[design]\nsector_ratio = 0.5\n", "above 1"),
        ('\n[design]\ncontroller = "rely"\n', "relay"),
        ('\n[design]\nsurface = "lqr"\n', "poles"),
        ("\n[design]\nsurface_weights = [1.0, -1.0]\n", "above 0"),
        ('\n[design]\nequivalent_control = "no"\n', "true"),
        ('\n[design]\nchamber_2 = "ajar"\n', "closed"),
    ],
)
def test_requirements_that_cannot_be_read_say_how_to_mend_them(
    designed: Demo, tmp_path: Path, more: str, word: str
) -> None:
    with pytest.raises(InputError, match=word):
        design.run(context_of(designed, "refused", edited(tmp_path, more)))


def test_without_an_axis_there_is_nothing_to_design(designed: Demo, tmp_path: Path) -> None:
    text = edited(tmp_path, "").read_text(encoding="utf-8")
    head, *tables = text.split("[[recordings]]")
    kept = [t for t in tables if 'experiment = "valve"' in t]
    (tmp_path / "valve.toml").write_text("[[recordings]]".join([head, *kept]), encoding="utf-8")
    out = tmp_path / "out"
    (out / "ingest").mkdir(parents=True)
    from pneucli.stages import ingest

    config = load(tmp_path / "valve.toml")
    ingest.run(Context(tmp_path / "valve.toml", config, out / "ingest", out))
    with pytest.raises(NotApplicable):
        design.run(Context(tmp_path / "valve.toml", config, out / "design", out))


# --- the demo's plant from its recordings to the FMU, and the budgets of its valve


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
