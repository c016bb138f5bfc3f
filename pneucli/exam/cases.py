"""Write an exam: folders as a laboratory would hand them over and, sealed, what is hidden in each."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.errors import InputError, did_you_mean
from pneucli.exam.case_plan import plan_cases
from pneucli.exam.conditions import USUAL, Conditions, parse
from pneucli.exam.hidden_effect import HiddenEffect
from pneucli.exam.hidden_effects import BY_NAME, UNCATALOGUED
from pneucli.exam.laboratory import Laboratory, RecordingPlan
from pneucli.exam.recording_programme import RecordingProgramme
from pneucli.exam.rig.parameters import ONE_CHAMBER, Parameters
from pneucli.exam.rig.sensors import Sensors
from pneucli.exam.rig_scaling import RigScaling
from pneucli.exam.rig_variants import draw_variant

SEALED_FOLDER = ".sealed"
EXAM_FILE = "exam.json"  # in the sealed folder: the options, and the origin of the seed


def write_exam(
    directory: Path,
    cases: int = 60,
    nulls: int = 20,
    size: float = 1.0,
    seed: int = 1,
    conditions: Sequence[str] = (USUAL,),
    about: Mapping[str, Any] | None = None,
) -> list[str]:
    """Write the cases of an exam and seal the truth.

    Every sixth case hides two effects of the catalogue, every fifth one a disturbance from outside it; the others
    take the effects of the catalogue in random order. All conditions get the same rigs with the same effects, as far
    as these are visible under them, so that results under two conditions can be compared.

    Args:
        directory: A new or empty folder.
        cases: The number of cases with something hidden, for each condition.
        nulls: The number of healthy rigs, for each condition.
        size: The size of the hidden effects, relative to the usual one.
        seed: The seed of all random draws.
        conditions: The conditions of the recordings, see :mod:`pneucli.exam.conditions`.
        about: Further entries of the sealed description of the exam.

    Returns:
        The names of the folders, which reveal nothing.

    Raises:
        InputError: The folder is not empty, or a condition is unknown.

    """
    each = [parse(text) for text in conditions]
    if directory.exists() and any(directory.iterdir()):
        raise InputError(
            str(directory), "the folder is not empty", "a new folder for the exam", "choose another name", code="E006"
        )
    asked = {"cases": cases, "nulls": nulls, "size": size, "seed": seed, "conditions": list(conditions)}
    seal(directory, EXAM_FILE, asked | dict(about or {"seed_from": "given"}))
    plan = [planned for one in each for planned in plan_cases(cases, nulls, one, seed)]
    names = [f"case-{k:03d}" for k in range(1, len(plan) + 1)]
    for name, which in zip(names, np.random.default_rng(seed).permutation(len(plan)), strict=True):
        planned = plan[which]
        truth = generate_case(
            directory / name, planned.kind, planned.hidden, planned.outside, size, planned.seed, planned.conditions
        )
        seal(directory, f"{name}.json", truth)
    return names


def seal(directory: Path, name: str, content: Mapping[str, Any]) -> None:
    """Write a file that nobody may read before the grading."""
    sealed = directory / SEALED_FOLDER / name
    sealed.parent.mkdir(parents=True, exist_ok=True)
    sealed.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def generate_case(
    folder: Path,
    kind: str,
    hidden: Sequence[str],
    outside: str,
    size: float,
    seed: int,
    conditions: Conditions = Conditions(),  # noqa: B008  (frozen)
) -> dict[str, object]:
    """Write ``folder/pipeline.toml`` and ``folder/raw/*.csv``.

    Args:
        folder: The folder of the case.
        kind: The kind of rig: "valve", "friction" or "axis".
        hidden: The hidden effects of the catalogue.
        outside: The hidden disturbance outside the catalogue; "" for none.
        size: The size of all of these, relative to the usual one.
        seed: The seed of all random draws.
        conditions: The conditions of the recordings.

    Returns:
        The truth, which is written nowhere.

    Raises:
        InputError: A name is unknown, or the effect is not visible on this kind of rig.

    """
    case = prepare_case(folder.name, kind, hidden, outside, size, seed, conditions)
    laboratory = case.laboratory
    at_ends = laboratory.record(folder / "raw", case.plans, case.rng)
    (folder / "pipeline.toml").write_text(laboratory.pipeline(case.plans, "raw"), encoding="utf-8")
    truth = _truth(laboratory, [BY_NAME[name] for name in hidden], outside, conditions)
    return truth | {"mess": case.small_effects, "share_at_ends": at_ends}


@dataclass(frozen=True)
class Case:
    """A rig in its laboratory, the recordings to be made, and the small disturbances that act as well."""

    laboratory: Laboratory
    plans: list[RecordingPlan]
    small_effects: dict[str, float]
    rng: np.random.Generator


def prepare_case(
    name: str, kind: str, hidden: Sequence[str], outside: str, size: float, seed: int, conditions: Conditions
) -> Case:
    """Return a case before it is recorded, see :func:`generate_case`."""
    effects = [_effect(name, kind) for name in [*hidden, *([outside] if outside else [])]]
    # the conditions have random draws of their own, so that the rest of a rig does not depend on them
    rng, conditions_rng = np.random.default_rng(seed), np.random.default_rng([seed, 1])
    base, stated_rig, baseline = _stated_rig(kind, hidden, conditions, rng, conditions_rng)
    par = stated_rig
    for effect in effects:
        par = effect.apply(par, size, rng)
    mess = _small_effects(kind, outside, conditions, conditions_rng) if conditions.messy else {}
    for small, share in mess.items():
        par = BY_NAME[small].apply(par, share, conditions_rng)
    similar = RigScaling.for_target(base, conditions.bore, conditions.supply, conditions.command)
    laboratory = Laboratory(
        name,
        similar.scale_rig(par),
        _sensors(conditions, similar, rng),
        vessel_volume=None if kind == "friction" or _is_linear(base, kind) else _vessel(similar, rng),
        has_cylinder=kind != "valve",
        supply_recorded=("supply-droop" not in hidden and rng.random() > 0.15) or conditions.tank,
        linear_valve=_is_linear(base, kind),
        effects=baseline,
        stated_null=conditions.null_stated,
        stated_stroke=_stated_stroke(similar.scale_rig(stated_rig).stroke, conditions_rng) if conditions.ends else None,
        absent_signals=conditions.absent,
    )
    return Case(
        laboratory,
        RecordingProgramme(laboratory, similar.scale_rig(stated_rig), similar, conditions, rng).plans(kind),
        mess,
        rng,
    )


def _stated_rig(
    kind: str,
    hidden: Sequence[str],
    conditions: Conditions,
    rng: np.random.Generator,
    conditions_rng: np.random.Generator,
) -> tuple[Parameters, Parameters, tuple[str, ...]]:
    """Return the usual rig, the rig that the pipeline file describes, and the effects that this file names."""
    linear = kind == "axis" and ("valve-deadband" in hidden or (rng.random() < 0.15 and conditions.allows_linear))
    friction = ("stribeck",) if kind == "axis" and "stribeck" not in hidden and rng.random() < 0.25 else ()
    base = _draw_rig(kind, linear, rng)
    stated_rig, loads = draw_variant(base, kind, conditions, conditions_rng)
    for name in friction:
        stated_rig = BY_NAME[name].apply(stated_rig, 1.0, rng)
    return base, stated_rig, (*friction, *loads)


def _is_linear(base: Parameters, kind: str) -> bool:
    """Return whether the pipeline file describes the valve by one gain: an axis without a valve test."""
    return kind == "axis" and base.overlap == 0.0


def _sensors(conditions: Conditions, similar: RigScaling, rng: np.random.Generator) -> Sensors:
    usual = Sensors(float(rng.choice([250.0, 400.0, 800.0])), float(rng.choice([0.0, 0.5, 0.8])), _mains_hum(rng))
    if conditions.imposed:
        usual = replace(usual, force=float(rng.uniform(0.1, 0.4)))
    sensors = replace(usual, bits=conditions.bits, drift=conditions.drift, outliers=conditions.outliers)
    return replace(similar.scale_sensors(sensors), rate=conditions.rate)


def _mains_hum(rng: np.random.Generator) -> float:
    return float(rng.choice([0.0, rng.uniform(140.0, 200.0)]))


def _vessel(similar: RigScaling, rng: np.random.Generator) -> float:
    """Draw the volume in m^3 of the vessel of the valve test."""
    return rng.uniform(120e-6, 250e-6) * similar.length * similar.area


def _small_effects(kind: str, outside: str, conditions: Conditions, rng: np.random.Generator) -> dict[str, float]:
    """Draw three or four disturbances, or as many as the conditions allow, with their sizes relative to the usual."""
    taken = set(BY_NAME[outside].null_values) if outside else set()
    mess: dict[str, float] = {}
    wanted = int(rng.integers(3, 5))
    for i in rng.permutation(len(UNCATALOGUED)):
        effect = UNCATALOGUED[i]
        fits = kind in effect.kinds and conditions.allows_small(effect.name) and not taken & set(effect.null_values)
        if fits and len(mess) < wanted:
            mess[effect.name] = float(rng.uniform(*conditions.mess))
            taken |= set(effect.null_values)
    return mess


def _stated_stroke(stroke: float, rng: np.random.Generator) -> float | None:
    """Draw the stroke (m) that the pipeline file states: in half of the cases it is off by up to 0.5 %."""
    return stroke * (1.0 + rng.uniform(-5e-3, 5e-3)) if rng.random() < 0.5 else None


def _effect(name: str, kind: str) -> HiddenEffect:
    if name not in BY_NAME:
        raise InputError(
            "exam", f'no effect "{name}"', "an effect that the rig can hide", did_you_mean(name, BY_NAME), code="E031"
        )
    if kind not in BY_NAME[name].kinds:
        raise InputError(
            "exam", f'"{name}" does not show on the rig "{kind}"', " or ".join(BY_NAME[name].kinds), code="E031"
        )
    return BY_NAME[name]


def _draw_rig(kind: str, linear: bool, rng: np.random.Generator) -> Parameters:
    area = rng.uniform(5.5e-4, 12e-4)
    return Parameters(
        supply=rng.uniform(6.1e5, 8.0e5),
        piston_area_1=area,
        piston_area_2=area * float(rng.choice([1.0, rng.uniform(0.85, 0.9)])) if kind != "valve" else area,
        dead_volume_1=rng.uniform(20e-6, 40e-6),
        dead_volume_2=rng.uniform(20e-6, 40e-6),
        mass=rng.uniform(1.3, 4.0),
        coulomb=rng.uniform(11.0, 24.0),
        viscous=rng.uniform(30.0, 90.0),
        effective_area=rng.uniform(1.25e-6, 2.2e-6),
        overlap=0.0 if kind == "friction" or linear else rng.uniform(0.08, 0.3),
        exponent=1.0 if linear else rng.uniform(1.0, 1.25),
    )


def _second_valve(par: Parameters) -> dict[str, float]:
    return {
        "effective_area_2_at_10V": par.effective_area_2,
        "overlap_2_V": par.overlap_2,
        "area_exponent_2": par.exponent_2,
    }


def _truth(
    laboratory: Laboratory, hidden: Sequence[HiddenEffect], outside: str, conditions: Conditions
) -> dict[str, object]:
    par = laboratory.parameters
    return {
        "hidden": {effect.name: effect.true_parameters(par) for effect in hidden},
        "outside_the_catalogue": outside or None,
        "baseline": list(laboratory.effects),
        "part": BY_NAME[outside].part if outside else None,
        "over": BY_NAME[outside].variable if outside else None,
        "conditions": list(conditions.names) or [USUAL],
        "verdict": "unexplained" if outside else "missing-effect" if hidden else "adequate",
        "unexplained_is_right": bool(outside) or conditions.allows_unexplained,
        "base": {
            "coulomb": par.coulomb,
            "viscous": par.viscous,
            "effective_area_at_10V": par.effective_area,
            "overlap_V": par.overlap,
            "area_exponent": par.exponent,
            "null_V": par.command_null,
            "fully_open_V": par.command_range,
            "critical_ratio": par.critical_ratio,
            **({} if par.arrangement == ONE_CHAMBER else _second_valve(par)),
        },
        "sensor_noise_pressure_Pa": laboratory.sensors.pressure,
    }
