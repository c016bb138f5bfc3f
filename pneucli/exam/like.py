"""Write an exam that imitates a user's rig, recordings and noise, and hides each effect at several sizes.

The rig is the exam's own, set to the identified values. Its test programme follows the recordings: the recorded
commands of a valve test, the recorded motion as reference of a position loop. The exam measures which effects these
sensors and experiments can identify. It contains nothing else of the real rig.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from pneucli.arrays import Array
from pneucli.exam.cases import EXAM_FILE, require_empty, seal
from pneucli.exam.conditions import Kind
from pneucli.exam.graded_case import GradedCase
from pneucli.exam.grades import EffectSizes, Like, OfSize
from pneucli.exam.grading import proportion
from pneucli.exam.hidden_effects import CATALOGUE, HiddenEffect
from pneucli.exam.laboratory import Laboratory, RecordingPlan
from pneucli.exam.rig.excitations import closed_loop
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.simulation import LOOP_PERIOD, Excitation
from pneucli.exam.rig_scaling import DIMENSIONS, RigScaling

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
