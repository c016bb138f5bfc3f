"""``exam --like PIPELINE``: an exam like one's own bench, whose rig, recordings and noise the exam's rig imitates.

Sizes of effects fit the rig, manoeuvres follow the recordings.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from pneucli.arrays import Array
from pneucli.errors import InputError
from pneucli.exam.cases import EXAM_FILE, SEALED_FOLDER, require_empty, seal
from pneucli.exam.conditions import Kind
from pneucli.exam.graded_case import GradedCase
from pneucli.exam.grades import EffectSizes, Like, OfSize, WrittenLike, graded_cases, proportion
from pneucli.exam.hidden_effects import CATALOGUE, HiddenEffect
from pneucli.exam.laboratory import Laboratory, RecordingPlan
from pneucli.exam.rig.excitations import closed_loop
from pneucli.exam.rig.parameters import FIVE_THREE, ONE_CHAMBER, TWO_VALVES, Parameters
from pneucli.exam.rig.sensors import Sensors
from pneucli.exam.rig.simulation import LOOP_PERIOD, Excitation
from pneucli.exam.rig_scaling import DIMENSIONS, RigScaling
from pneucli.figure import to_json
from pneucli.io.artifacts import write_text
from pneucli.pipeline.graph import NO_PROGRESS, Context, Progress
from pneucli.pipeline.manifest import program_digest
from pneucli.pipeline.runner import open_pipeline
from pneucli.recording import Recording, Rig
from pneucli.simulate.model import Model
from pneucli.simulate.valve_forms import ValveArea
from pneucli.stages.pipeline_data import PipelineData
from pneucli.stages.pipeline_file import load_pipeline_file

SIZES = (0.03, 0.1, 0.3, 1.0)
POSITION_LOOP_GAIN = 150.0  # V/m, of the position loop of the usual rig
RELATIVE_FIELDS = {"static": "coulomb", "extra_mass": "mass"}  # fields that are drawn as a multiple of another
USUAL_RIG = Parameters()
MIN_NAMED_SHARE = 0.9  # share of the cases in which an effect of a size must be named
SCHEMA = "pneucli/exam-like/1"


@dataclass(frozen=True)
class UserRecording:
    """One recording of the user: its experiment, its time (s) and its opening (V, + fills) or position (m)."""

    name: str
    experiment: Literal["valve", "friction", "axis"]
    use: Literal["train", "test"]
    time: Array
    signal: Array
    pressures: tuple[float, float]  # Pa, absolute, at its start
    chamber_2_open: bool = False
    chamber: Literal[1, 2] = 1  # in a valve test: the chamber whose valve or port is tested


@dataclass(frozen=True)
class UserRig(Laboratory):
    """The exam's imitation of the user's rig: a laboratory that repeats the user's recordings."""

    recordings: tuple[UserRecording, ...] = ()

    @property
    def kinds(self) -> list[Kind]:
        """The kinds of rig whose effects may be visible."""
        return list(dict.fromkeys(r.experiment for r in self.recordings))

    @property
    def scaling(self) -> RigScaling:
        """The ratios of this rig to the usual one, by which hidden effects are scaled."""
        par = self.parameters
        pressure = (par.supply - par.ambient) / (USUAL_RIG.supply - USUAL_RIG.ambient)
        area = par.piston_area_1 / USUAL_RIG.piston_area_1
        command = par.command_range / USUAL_RIG.command_range
        return RigScaling(par.stroke / USUAL_RIG.stroke, area, pressure, par.supply / USUAL_RIG.supply, command)


def write_like(
    directory: Path,
    rig: UserRig,
    sizes: Sequence[float] = SIZES,
    repeats: int = 3,
    nulls: int = 20,
    seed: int = 1,
    about: Mapping[str, Any] | None = None,
) -> list[str]:
    """Write ``repeats`` cases of each effect at each of the ``sizes``, and ``nulls`` healthy rigs; return their names.

    Raises InputError where the folder is not empty.
    """
    require_empty(directory)
    shown = [e for e in CATALOGUE if set(e.kinds) & set(rig.kinds) and e.name not in rig.effects and not e.under]
    plan: list[tuple[HiddenEffect | None, float]] = [(e, size) for e in shown for size in sizes for _ in range(repeats)]
    plan += [(None, 0.0)] * nulls
    asked = {"sizes": list(sizes), "repeats": repeats, "nulls": nulls, "seed": seed}
    seal(directory, EXAM_FILE, asked | dict(about or {}))
    names = [f"case-{k:04d}" for k in range(1, len(plan) + 1)]
    for name, which in zip(names, np.random.default_rng(seed).permutation(len(plan)), strict=True):
        effect, size = plan[which]
        seal(directory, f"{name}.json", _case(directory / name, rig, effect, size, [seed, int(which)]))
    return names


def _case(folder: Path, bench: UserRig, effect: HiddenEffect | None, size: float, seed: list[int]) -> dict[str, Any]:
    rng = np.random.default_rng(seed)
    par = bench.parameters if effect is None else with_hidden_effect(bench, effect, size, rng)
    supplied = bench.supply_recorded and (effect is None or effect.name != "supply-droop")
    laboratory = replace(bench, name=folder.name, parameters=par, supply_recorded=supplied)
    takes = [RecordingPlan(r.name, r.experiment, r.use, excitation_for(bench, r), r.chamber) for r in bench.recordings]
    laboratory.record(folder / "raw", takes, rng)
    (folder / "pipeline.toml").write_text(laboratory.pipeline(takes, "raw"), encoding="utf-8")
    return {
        "hidden": {} if effect is None else {effect.name: effect.true_parameters(par)},
        "outside_the_catalogue": None,
        "baseline": list(bench.effects),
        "part": None,
        "over": None,
        "conditions": [f"size-{size:g}" if effect else "nothing"],
        "size": size,
        "verdict": "missing-effect" if effect else "adequate",
        "unexplained_is_right": False,
    }


def with_hidden_effect(rig: UserRig, effect: HiddenEffect, size: float, rng: np.random.Generator) -> Parameters:
    """Return the user's rig with an effect of ``size`` times the usual, scaled to this rig."""
    drawn, mine = effect.apply(USUAL_RIG, size, rng), rig.scaling.scale_rig(USUAL_RIG)
    similar = rig.scaling.scale_rig(drawn)
    values = {}
    for field in Parameters._fields:
        if getattr(drawn, field) == getattr(USUAL_RIG, field):
            continue
        base = RELATIVE_FIELDS.get(field)
        if base:
            values[field] = getattr(drawn, field) / getattr(USUAL_RIG, base) * getattr(rig.parameters, base)
        elif field in DIMENSIONS and getattr(mine, field):
            values[field] = getattr(rig.parameters, field) + getattr(similar, field) - getattr(mine, field)
        else:
            values[field] = getattr(similar, field)
    return rig.parameters._replace(**values)


def excitation_for(rig: UserRig, recording: UserRecording) -> Excitation:
    """Return the excitation that makes the rig repeat a recording approximately."""
    time = np.arange(recording.time[0], recording.time[-1], LOOP_PERIOD)
    signal = np.interp(time, recording.time, recording.signal)
    if recording.experiment == "valve":
        return Excitation(signal, pressure_1=recording.pressures[0], pressure_2=recording.pressures[1])
    par, similar = rig.parameters, rig.scaling
    loop = closed_loop(
        par, signal, POSITION_LOOP_GAIN * similar.command / similar.length, recording.pressures[0] - par.ambient
    )
    pressure_2 = par.ambient if recording.chamber_2_open else recording.pressures[1]
    return replace(loop, chamber_2_open=recording.chamber_2_open, pressure_2=pressure_2)


def summarize(graded: Sequence[GradedCase], like: str = "") -> Like:
    """Return by effect and size how often it was named (or in the answer's set), the smallest such size, and alarms."""
    effects = {name: list(_by_size(graded, name)) for name in sorted({name for g in graded for name in g.hidden})}
    nulls = [g for g in graded if g.is_null]
    alarms = proportion(sum(bool(g.missing) for g in nulls), len(nulls))
    rows = [EffectSizes(name, sizes, _smallest_named_size(sizes)) for name, sizes in effects.items()]
    return Like(SCHEMA, rows, len(nulls), alarms.right, alarms.ci95, like)


def _by_size(graded: Sequence[GradedCase], name: str) -> Iterator[OfSize]:
    mine = [g for g in graded if g.hidden == {name}]
    for size in sorted({float(g.truth["size"]) for g in mine}):
        cases = [g for g in mine if float(g.truth["size"]) == size]
        others = sorted({other for g in cases for other in g.missing - {name}})
        found = proportion(sum(name in g.answer_set for g in cases), len(cases))
        assert found.share is not None
        assert found.ci95 is not None
        yield OfSize(size, len(cases), found.right, found.share, found.ci95, others)


def _smallest_named_size(sizes: Sequence[OfSize]) -> float | None:
    """Return the smallest size from which an effect is named in 90 % of the cases; None where there is none."""
    found = None
    for one in reversed(sizes):
        if one.share < MIN_NAMED_SHARE:
            break
        found = one.size
    return found


VALVE_ARRANGEMENTS = {"one-chamber": ONE_CHAMBER, "5/3": FIVE_THREE, "two": TWO_VALVES}
RESULT_PAGE, RESULT_FILE = "like.md", "like.json"


def write(
    directory: Path,
    pipeline: Path,
    sizes: Sequence[float] = SIZES,
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
    bench = exam_rig(study)
    about = {
        "like": opened.name,
        "seed_from": "given",
        "program": program_digest(),
        "effects_known": list(bench.effects),
    }
    names = write_like(directory, bench, sizes, repeats, nulls, seed, about)
    return WrittenLike("pneucli/exam-written/1", str(directory), opened.name, seed, list(sizes), names)


def exam_rig(study: PipelineData) -> UserRig:
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
    return UserRig(
        "",  # each case has a name of its own
        _parameters(study.rig, study.identified_model),
        _sensors(recordings),
        vessel_volume=study.rig.vessel_volume if any(r.kind.vessel for r in recordings) else None,
        has_cylinder=any(r.kind.cylinder for r in recordings),
        supply_recorded=any("p_supply" in r for r in recordings),
        linear_valve=study.valve == "linear",
        stated_null=f"{study.rig.valve_null:g} V" if study.rig.valve_null else None,
        absent_signals=frozenset({"a"} if not any("a" in r for r in recordings) else ()),
        recordings=tuple(_exam_recording(r, study.rig) for r in recordings),
    )


def _parameters(rig: Rig, model: Model) -> Parameters:
    base, usual = model.base_values(), Parameters()
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


def _exam_recording(r: Recording, rig: Rig) -> UserRecording:
    signal = rig.command_sign(r.chamber) * (r["u"] - rig.valve_null) if r.kind.vessel else r["x"]
    pressures = [float(r[name][0]) if name in r else rig.ambient_pressure for name in ("p1", "p2")]
    return UserRecording(
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
    found = summarize(graded_cases(directory, answers), asked["like"])
    write_text(answers / RESULT_PAGE, found.page(asked["sizes"]))
    write_text(answers / RESULT_FILE, json.dumps(to_json(found), indent=1) + "\n")
    return found
