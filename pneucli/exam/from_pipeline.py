"""``exam --like PIPELINE``: describe the user's rig, recordings and noise to the exam's rig."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.arrays import Array
from pneucli.errors import InputError
from pneucli.exam import like
from pneucli.exam.cases import EXAM_FILE, SEALED_FOLDER
from pneucli.exam.grades import Like, WrittenLike
from pneucli.exam.grading import graded_cases
from pneucli.exam.rig.parameters import FIVE_THREE, ONE_CHAMBER, TWO_VALVES, Parameters
from pneucli.exam.rig.sensors import Sensors
from pneucli.figure import to_json
from pneucli.io.artifacts import write_text
from pneucli.pipeline.context import NO_PROGRESS, Context, Progress
from pneucli.pipeline.manifest import program_digest
from pneucli.pipeline.runner import open_pipeline
from pneucli.recording import Recording, Rig
from pneucli.simulate.model import Model
from pneucli.simulate.valve_forms.area import ValveArea
from pneucli.stages.model_file import load_model
from pneucli.stages.pipeline_data import PipelineData
from pneucli.stages.pipeline_file import load_pipeline_file

VALVE_ARRANGEMENTS = {"one-chamber": ONE_CHAMBER, "5/3": FIVE_THREE, "two": TWO_VALVES}
RESULT_PAGE, RESULT_FILE = "like.md", "like.json"


def write(
    directory: Path,
    pipeline: Path,
    sizes: Sequence[float] = like.SIZES,
    repeats: int = 3,
    nulls: int = 20,
    seed: int = 1,
    progress: Progress = NO_PROGRESS,
) -> WrittenLike:
    """Identify ``pipeline``, write an exam of a rig like it, and return the answer.

    Raises InputError where the pipeline is at fault, or the exam cannot imitate its kind of rig.
    """
    opened = open_pipeline(pipeline, load_pipeline_file)
    done = opened.update(["identify"], None, progress)
    answers = {name: dict(one.answer) for name, one in done.items()}
    config = load_pipeline_file(pipeline)
    study = PipelineData(Context(pipeline, config, opened.artifacts, opened.artifacts, answers=answers))
    bench = exam_rig(study, load_model(opened.artifacts / "identify", study.rig, study.effects))
    about = {
        "like": opened.name,
        "seed_from": "given",
        "program": program_digest(),
        "effects_known": list(bench.effects),
    }
    names = like.write_like(directory, bench, sizes, repeats, nulls, seed, about)
    return WrittenLike("pneucli/exam-written/1", str(directory), opened.name, seed, list(sizes), names)


def exam_rig(study: PipelineData, model: Model) -> like.UserRig:
    """Return the exam's description of the user's rig; raises InputError for valves and recordings that it lacks."""
    where = str(study.context.path)
    if study.rig.valve_kind != "proportional":
        raise InputError(
            f"{where}, [rig.valve]", f"a {study.rig.valve_kind} valve", "a proportional one, for --like", code="E060"
        )
    if unfit := [r.name for r in study.recordings if r.imposed or (r.kind.cylinder and "x" not in r)]:
        raise InputError(
            f"{where}, recording {unfit[0]}", "no motion that a position loop can follow", "x, not imposed", code="E060"
        )
    recordings = study.recordings
    return like.UserRig(
        "",  # each case has a name of its own
        _parameters(study, model),
        _sensors(recordings),
        vessel_volume=study.rig.vessel_volume if any(r.kind.vessel for r in recordings) else None,
        has_cylinder=any(r.kind.cylinder for r in recordings),
        supply_recorded=any("p_supply" in r for r in recordings),
        linear_valve=study.valve == "linear",
        stated_null=f"{study.rig.valve_null:g} V" if study.rig.valve_null else None,
        absent_signals=frozenset({"a"} if not any("a" in r for r in recordings) else ()),
        recordings=tuple(_exam_recording(r, study.rig) for r in recordings),
    )


def _parameters(study: PipelineData, model: Model) -> Parameters:
    rig, base = study.rig, model.base_values()
    usual = Parameters()
    first, second = rig.piston_areas
    values = {
        "temperature": rig.gas_temperature,
        "ambient": rig.ambient_pressure,
        "supply": rig.supply_pressure,
        "piston_area_1": first or None,
        "piston_area_2": second or None,
        "stroke": rig.stroke,
        "dead_volume_1": base.get("rig.dead_volume_1"),
        "dead_volume_2": base.get("rig.dead_volume_2"),
        "mass": model.values.get("rig.moving_mass", rig.moving_mass),
        "coulomb": model.values.get("friction.coulomb"),
        "viscous": model.values.get("friction.viscous"),
    }
    stated = {name: float(value) for name, value in values.items() if value}
    second_valve = {
        f"{name}_2": v
        for name, v in _area_power_function(model.valve_2 or model.valve).items()
        if name != "command_range"
    }
    arranged = {"arrangement": VALVE_ARRANGEMENTS[rig.valve_arrangement], "command_null": rig.valve_null}
    return usual._replace(**stated, **_area_power_function(model.valve), **second_valve, **arranged)


def _area_power_function(valve: Any) -> dict[str, float]:
    """Fit effective area, overlap and exponent of the exam's valve to the identified areas."""
    commands = np.abs(np.array(valve.commands, dtype=np.float64))
    if not commands.size:
        return {}
    largest = float(commands.max())
    if not isinstance(valve, ValveArea):
        return {"effective_area": float(valve(np.array([largest]))[0]), "command_range": largest, "exponent": 1.0}
    overlap = min(valve.overlap_fill, 0.9 * float(commands.min()))
    opened = np.log((commands - overlap) / (largest - overlap))
    areas = np.log(np.array(valve.areas))
    exponent, intercept = np.polyfit(opened, areas, 1) if np.ptp(opened) > 0.0 else (1.0, float(areas.mean()))
    return {
        "effective_area": float(np.exp(intercept)),
        "overlap": float(overlap),
        "exponent": float(np.clip(exponent, 0.3, 3.0)),
        "command_range": largest,
    }


def _sensors(recordings: Sequence[Recording]) -> Sensors:
    def median(signal: str, key: str) -> float:
        found = [getattr(r.noise[signal], key) for r in recordings if signal in r.noise]
        return float(np.median(found)) if found else 0.0

    usual = Sensors()
    step = median("x", "step") or median("x", "rms")
    return Sensors(
        pressure=median("p1", "rms") or usual.pressure,
        pole=median("p1", "pole"),
        position_step=step or usual.position_step,
        acceleration=median("a", "rms") or usual.acceleration,
        rate=1.0 / float(np.median([r.period for r in recordings])),
    )


def _exam_recording(r: Recording, rig: Rig) -> like.UserRecording:
    signal = rig.command_sign(r.chamber) * (r["u"] - rig.valve_null) if r.kind.vessel else r["x"]
    pressures = [float(r[name][0]) if name in r else rig.ambient_pressure for name in ("p1", "p2")]
    return like.UserRecording(
        r.name.replace("/", "_"),
        "valve" if r.kind.vessel else "axis" if r.kind.axis else "friction",
        r.use,
        r.time,
        np.asarray(_interpolate_gaps(signal)),
        (pressures[0], pressures[1]),
        r.chamber_2 == "open",
        r.chamber,
    )


def _interpolate_gaps(signal: Array) -> Array:
    seen = np.isfinite(signal)
    return np.interp(np.arange(signal.size), np.flatnonzero(seen), signal[seen])


def read_result_page(answers: Path) -> str:
    """Return the page that :func:`write_result` wrote."""
    return (answers / RESULT_PAGE).read_text(encoding="utf-8").rstrip()


def write_result(directory: Path, answers: Path) -> Like | None:
    """Write ``like.md`` and ``like.json`` next to the grades; return None where the exam imitates no user's rig."""
    sealed = directory / SEALED_FOLDER / EXAM_FILE
    asked: Mapping[str, Any] = json.loads(sealed.read_text(encoding="utf-8")) if sealed.exists() else {}
    if "like" not in asked:
        return None
    found = like.summarize(graded_cases(directory, answers), asked["like"])
    write_text(answers / RESULT_PAGE, found.page(asked["sizes"]))
    write_text(answers / RESULT_FILE, json.dumps(to_json(found), indent=1) + "\n")
    return found
