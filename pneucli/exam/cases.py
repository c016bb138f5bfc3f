"""Write an exam: folders as a laboratory would hand them over and, sealed, what is hidden in each."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.errors import InputError, did_you_mean
from pneucli.exam.case_rig import (
    COMMAND_CYCLES,
    draw_sensors,
    draw_stated_rig,
    draw_stated_stall,
    draw_stated_stroke,
    draw_vessel,
    has_bench,
    is_linear,
    is_supply_recorded,
)
from pneucli.exam.conditions import USUAL, WIDE, Conditions, draw_conditions, parse
from pneucli.exam.hidden_effects import ALL_BY_NAME, BY_NAME, CATALOGUE, UNCATALOGUED, HiddenEffect, draw_sides
from pneucli.exam.laboratory import Laboratory, RecordingPlan
from pneucli.exam.recording_programme import RecordingProgramme
from pneucli.exam.rig.gas import wall_conductance
from pneucli.exam.rig.parameters import ONE_CHAMBER, Parameters
from pneucli.exam.rig_scaling import RigScaling

SEALED_FOLDER = ".sealed"
EXAM_FILE = "exam.json"  # in the sealed folder: the options, and the origin of the seed


@dataclass(frozen=True)
class PlannedCase:
    """What one case hides, on which kind of rig."""

    kind: str
    hidden: tuple[str, ...]
    outside: str
    seed: int
    conditions: Conditions


def plan_cases(cases: int, nulls: int, conditions: Conditions, seed: int) -> Iterator[PlannedCase]:
    """Yield which effects each case hides, on which kind of rig, and under which conditions."""
    rng, conditions_rng = np.random.default_rng(seed), np.random.default_rng([seed, 1])
    singles, disturbances = (_effect_names(effects, conditions, rng) for effects in (CATALOGUE, UNCATALOGUED))
    for k in range(cases + nulls):
        hidden: tuple[str, ...] = ()
        outside = ""
        if k < cases and k % 6 == 5:
            hidden = _pair(conditions, rng)
        elif k < cases and k % 5 == 4:
            outside = next(disturbances)
        elif k < cases:
            hidden = (next(singles),)
        names = [*hidden, *([outside] if outside else [])]
        of_case = conditions
        while WIDE in of_case.names and (of_case is conditions or not _kinds(names, of_case)):
            of_case = draw_conditions(conditions_rng, names)
        kind = str(rng.choice(_kinds(names, of_case)))
        sided = draw_sides(hidden, conditions_rng) if of_case.sides else hidden
        yield PlannedCase(kind, sided, outside, int(rng.integers(2**31)), of_case)


def _effect_names(effects: Sequence[HiddenEffect], conditions: Conditions, rng: np.random.Generator) -> Iterator[str]:
    usual, last = ([effect.name for effect in effects if bool(effect.under) == late] for late in (False, True))
    while True:
        # what shows under some conditions only comes last: the others are drawn alike under all conditions
        order = [usual[i] for i in rng.permutation(len(usual))] + last
        yield from (name for name in order if conditions.allows(name) and _kinds([name], conditions))


def _pair(conditions: Conditions, rng: np.random.Generator) -> tuple[str, ...]:
    kind = str(rng.choice(conditions.kinds))
    names = [effect.name for effect in CATALOGUE if kind in effect.kinds and conditions.allows(effect.name)]
    return tuple(str(name) for name in rng.choice(names, 2, replace=False))


def _kinds(names: Sequence[str], conditions: Conditions) -> list[str]:
    return [kind for kind in conditions.kinds if all(kind in BY_NAME[name].kinds for name in names)]


def _baseline_parameters(laboratory: Laboratory) -> dict[str, dict[str, float]]:
    """Return the true parameters of the effects in the pipeline file, as far as there is one true value.

    The walls of a cylinder's chamber grow with the stroke: only a vessel has one conductance.
    """
    par, found = laboratory.parameters, {}
    for name in laboratory.effects:
        if name != "heat-transfer" or par.wall_coefficient <= 0.0:
            found[name] = ALL_BY_NAME[name].true_parameters(par)
        elif not laboratory.has_cylinder and laboratory.vessel_volume is not None:
            found[name] = {"conductance": float(wall_conductance(par, 0.0, laboratory.vessel_volume))}
    return found


def _second_valve(par: Parameters) -> dict[str, float]:
    return {
        "effective_area_2_at_10V": par.effective_area_2,
        "overlap_2_V": par.overlap_2,
        "area_exponent_2": par.exponent_2,
    }


def case_truth(
    laboratory: Laboratory, hidden: Sequence[HiddenEffect], outside: str, conditions: Conditions
) -> dict[str, object]:
    """Return the truth of a case with these hidden effects and this disturbance outside the catalogue."""
    par = laboratory.parameters
    return {
        "hidden": {effect.name: effect.true_parameters(par) for effect in hidden},
        "outside_the_catalogue": outside or None,
        "baseline": list(laboratory.effects),
        "baseline_parameters": _baseline_parameters(laboratory),
        "command_sets_area": conditions.source is None,
        "part": ALL_BY_NAME[outside].part if outside else None,
        "over": ALL_BY_NAME[outside].variable if outside else None,
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
    require_empty(directory)
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


def require_empty(directory: Path) -> None:
    """Raise InputError where the folder of a new exam holds something."""
    if directory.exists() and any(directory.iterdir()):
        mend = "choose another name"
        raise InputError(str(directory), "the folder is not empty", "a new folder for the exam", mend, code="E006")


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
    truth = case_truth(laboratory, [ALL_BY_NAME[name] for name in hidden], outside, conditions)
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
    base, stated_rig, baseline = draw_stated_rig(kind, hidden, conditions, rng, conditions_rng)
    par = stated_rig
    for effect in effects:
        par = effect.apply(par, size, rng)
    mess = _small_effects(kind, outside, conditions, conditions_rng) if conditions.messy else {}
    for small, share in mess.items():
        par = ALL_BY_NAME[small].apply(par, share, conditions_rng)
    similar = RigScaling.for_target(base, conditions.bore, conditions.supply, conditions.command)
    target, stated = similar.scale_rig(par), similar.scale_rig(stated_rig)
    laboratory = Laboratory(
        name,
        target,
        draw_sensors(conditions, similar, rng, conditions_rng),
        vessel_volume=draw_vessel(similar, rng) if has_bench(base, kind, conditions) else None,
        has_cylinder=kind != "valve",
        supply_recorded=is_supply_recorded(hidden, conditions, rng),
        linear_valve=is_linear(base, kind),
        effects=baseline,
        stated_null=conditions.null_stated,
        stated_stroke=draw_stated_stroke(stated.stroke, conditions_rng) if conditions.ends else None,
        absent_signals=conditions.absent,
        command_cycle=int(conditions_rng.choice(COMMAND_CYCLES)) if conditions.held else 1,
        supply_start=draw_stated_stall(stated, conditions_rng) if conditions.source == "pump" else None,
    )
    return Case(
        laboratory,
        RecordingProgramme(laboratory, stated, similar, conditions, rng).plans(kind),
        mess,
        rng,
    )


def _small_effects(kind: str, outside: str, conditions: Conditions, rng: np.random.Generator) -> dict[str, float]:
    """Draw three or four disturbances, or as many as the conditions allow, with their sizes relative to the usual."""
    taken = set(ALL_BY_NAME[outside].null_values) if outside else set()
    mess: dict[str, float] = {}
    wanted = int(rng.integers(3, 5))
    for i in rng.permutation(len(UNCATALOGUED)):
        effect = UNCATALOGUED[i]
        fits = kind in effect.kinds and conditions.allows_small(effect.name) and not taken & set(effect.null_values)
        if fits and len(mess) < wanted:
            mess[effect.name] = float(rng.uniform(*conditions.mess))
            taken |= set(effect.null_values)
    return mess


def _effect(name: str, kind: str) -> HiddenEffect:
    if name not in ALL_BY_NAME:
        raise InputError(
            "exam",
            f'no effect "{name}"',
            "an effect that the rig can hide",
            did_you_mean(name, ALL_BY_NAME),
            code="E031",
        )
    if kind not in ALL_BY_NAME[name].kinds:
        raise InputError(
            "exam", f'"{name}" does not show on the rig "{kind}"', " or ".join(ALL_BY_NAME[name].kinds), code="E031"
        )
    return ALL_BY_NAME[name]
