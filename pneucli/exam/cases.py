"""Write an exam: folders as a laboratory would hand them over and, sealed, what is hidden in each."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.errors import InputError, require_known
from pneucli.exam.conditions import USUAL, WIDE, Conditions, draw_conditions, parse
from pneucli.exam.hidden_effects import (
    ALL_BY_NAME,
    BY_NAME,
    CATALOGUE,
    UNCATALOGUED,
    HiddenEffect,
    draw_loop,
    draw_sides,
)
from pneucli.exam.laboratory import Laboratory, RecordingPlan
from pneucli.exam.recording_programme import RecordingProgramme
from pneucli.exam.rig.gas import GAS_CONSTANT, PSI_MAX, hose_volume, wall_conductance
from pneucli.exam.rig.parameters import FIVE_THREE, ONE_CHAMBER, TWO_VALVES, Parameters
from pneucli.exam.rig.sensors import Sensors
from pneucli.exam.rig_scaling import RigScaling

ARRANGEMENT_CODES = {"5/3": FIVE_THREE, "two": TWO_VALVES}
COMMAND_CYCLES = (5, 10, 20)  # ms, of programmable controllers
ENCODER_STEPS = (2e-6, 5e-6, 10e-6, 20e-6)  # m, of linear encoders
# what a user knows to be there; a pressure loop follows from the kind of the valve
STATED_BY_SOURCE: dict[str, tuple[str, ...]] = {"pump": ("pump-flow",), "regulated": ("valve-lag",)}
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
        source=conditions.source if conditions.source_stated else None,
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
    require_known([name], ALL_BY_NAME, "exam", 'no effect "{}"', "an effect that the rig can hide", code="E031")
    if kind not in ALL_BY_NAME[name].kinds:
        raise InputError(
            "exam", f'"{name}" does not show on the rig "{kind}"', " or ".join(ALL_BY_NAME[name].kinds), code="E031"
        )
    return ALL_BY_NAME[name]


def draw_variant(
    par: Parameters, kind: str, conditions: Conditions, rng: np.random.Generator
) -> tuple[Parameters, tuple[str, ...]]:
    """Return the rig with these valves, loads, walls and ends, and the effects that its pipeline file then names."""
    par = _with_end_stops(_with_valves(par, conditions, rng), rng)
    if conditions.differential:
        par = par._replace(piston_area_2=par.piston_area_1 * rng.uniform(0.4, 0.7))
    par, loads = _with_load(par, kind, conditions, rng)
    return _with_gas(par, conditions, rng, loads)


def _with_load(
    par: Parameters, kind: str, conditions: Conditions, rng: np.random.Generator
) -> tuple[Parameters, tuple[str, ...]]:
    force = (par.supply - par.ambient) * par.piston_area_1
    if conditions.load == "spring":
        preload, stiffness = force * rng.uniform(0.12, 0.25), force / par.stroke * rng.uniform(0.1, 0.3)
        return par._replace(spring_stiffness=stiffness, spring_rest=-preload / stiffness), ("spring-force",)
    if conditions.load == "weight":
        weight = force * rng.uniform(0.08, 0.16)
        # with chamber 2 open, chamber 1 cannot balance a force that pulls outward
        side = 1.0 if kind == "friction" else float(rng.choice([-1.0, 1.0]))
        return par._replace(constant_force=side * weight, mass=par.mass + weight / 9.81), ("constant-force",)
    if conditions.tank:
        # litres for a vessel of about 0.2 l, and a hose of some metres
        par = par._replace(supply_volume=rng.uniform(0.8e-3, 2e-3), regulator_conductance=0.0)
        hose = {"line_delay": rng.uniform(0.006, 0.015), "critical_ratio": rng.uniform(0.15, 0.3)}
        return par._replace(**hose), ("line-delay", "critical-ratio")
    return par, ()


def _with_gas(
    par: Parameters, conditions: Conditions, rng: np.random.Generator, loads: tuple[str, ...]
) -> tuple[Parameters, tuple[str, ...]]:
    """Draw what a user knows to be there, and not how large: convection at the walls, the critical ratio of a valve."""
    if conditions.wall_heat:
        # forced convection in cylinders: 20 to 100 W/(m^2 K), Carneiro and de Almeida (2006)
        par, loads = par._replace(wall_coefficient=rng.uniform(20.0, 60.0)), (*loads, "heat-transfer")
    if conditions.free_ratio:
        par, loads = par._replace(critical_ratio=rng.uniform(0.15, 0.5)), (*loads, "critical-ratio")
    if conditions.hose:
        # 0.5 to 3 m, at least as wide as the valve; the stated dead volumes contain it
        bore = 2.0 * np.sqrt(par.effective_area / np.pi) * rng.uniform(1.5, 3.5)
        par, loads = par._replace(line_delay=rng.uniform(0.0015, 0.009), hose_bore=bore), (*loads, "line-delay")
        wider = {name: getattr(par, name) + hose_volume(par, 0) for name in ("dead_volume_1", "dead_volume_2")}
        par = par._replace(**wider)
    return par, loads


def _with_source(par: Parameters, source: str, rng: np.random.Generator) -> Parameters:
    """Return the rig with a valve that regulates the pressure, with a pump, or with an ejector behind the valve."""
    gauge = par.supply - par.ambient
    if source == "ejector":
        return par._replace(supply=par.ambient * rng.uniform(0.15, 0.35))
    if source == "pump":
        choked = PSI_MAX * par.effective_area * par.supply * np.sqrt(2.0 / (GAS_CONSTANT * par.temperature))
        return par._replace(
            pump_flow=choked * rng.uniform(0.6, 1.0), pump_clearance=1.0 / (gauge * rng.uniform(0.85, 1.0))
        )
    loop = draw_loop(par, rng)
    return par._replace(valve_lag=rng.uniform(3e-3, 6e-3), **loop)


def _with_valves(par: Parameters, conditions: Conditions, rng: np.random.Generator) -> Parameters:
    par = par._replace(switching=float(conditions.switching), command_null=conditions.null)
    if conditions.null_stated == "identify":
        par = par._replace(command_null=conditions.null + rng.uniform(-0.15, 0.15))
    if conditions.source is not None:
        # the file of a stated source names no overlap
        par = par._replace(overlap=0.0) if conditions.source_stated else par
        return _with_source(par, conditions.source, rng)
    if conditions.valve is None:
        return par
    # the edges of one spool differ slightly, two valves like two of a series
    spread = 0.12 if conditions.valve == "5/3" else 0.25
    return par._replace(
        arrangement=ARRANGEMENT_CODES[conditions.valve],
        effective_area_2=par.effective_area * rng.uniform(1 - spread, 1 + spread),
        overlap_2=par.overlap * rng.uniform(1 - spread, 1 + spread),
        exponent_2=max(1.0, par.exponent + spread * rng.uniform(-0.4, 0.4)),
    )


def _with_end_stops(par: Parameters, rng: np.random.Generator) -> Parameters:
    """Draw ends that the full supply compresses by 0.02 to 0.1 % of the stroke; on half of them the piston bounces."""
    pressed = par.stroke * rng.uniform(2e-4, 1e-3)
    stiffness = abs(par.supply - par.ambient) * par.piston_area_1 / pressed
    ratio = rng.uniform(0.05, 0.3) if rng.random() < 0.5 else rng.uniform(0.7, 1.0)
    return par._replace(stop_stiffness=stiffness, stop_damping=2 * ratio * np.sqrt(stiffness * par.mass))


def draw_stated_rig(
    kind: str,
    hidden: Sequence[str],
    conditions: Conditions,
    rng: np.random.Generator,
    conditions_rng: np.random.Generator,
) -> tuple[Parameters, Parameters, tuple[str, ...]]:
    """Return the usual rig, the rig that the pipeline file describes, and the effects that this file names."""
    may_be_linear = conditions.allows("valve-deadband")
    linear = kind == "axis" and ("valve-deadband" in hidden or (rng.random() < 0.15 and may_be_linear))
    friction = ("stribeck",) if kind == "axis" and "stribeck" not in hidden and rng.random() < 0.25 else ()
    base = draw_rig(kind, linear, rng)
    stated_rig, loads = draw_variant(base, kind, conditions, conditions_rng)
    for name in friction:
        stated_rig = BY_NAME[name].apply(stated_rig, 1.0, rng)
    known = STATED_BY_SOURCE.get(conditions.source or "", ()) if conditions.source_stated else ()
    source = tuple(name for name in known if name not in hidden)
    return base, stated_rig, (*friction, *loads, *source)


def is_linear(base: Parameters, kind: str) -> bool:
    """Return whether the pipeline file describes the valve by one gain: an axis without a valve test."""
    return kind == "axis" and base.overlap == 0.0


def has_bench(base: Parameters, kind: str, conditions: Conditions) -> bool:
    """Return whether a bench tests the valve on a vessel."""
    return kind != "friction" and not is_linear(base, kind) and conditions.bench_test


def is_supply_recorded(hidden: Sequence[str], conditions: Conditions, rng: np.random.Generator) -> bool:
    """Draw whether the supply pressure is recorded."""
    drawn = "supply-droop" not in hidden and rng.random() > 0.15
    return (drawn or conditions.tank) and conditions.source != "pump"


def draw_stated_stall(par: Parameters, rng: np.random.Generator) -> float:
    """Draw the stall pressure (Pa, absolute) that the data sheet of a pump states."""
    return par.ambient + rng.uniform(0.9, 1.1) / par.pump_clearance


def draw_sensors(
    conditions: Conditions, similar: RigScaling, rng: np.random.Generator, conditions_rng: np.random.Generator
) -> Sensors:
    """Draw the sensors of a rig of this size."""
    noise, pole = float(rng.choice([250.0, 400.0, 800.0])), float(rng.choice([0.0, 0.5, 0.8]))
    usual = Sensors(noise, pole, hum=float(rng.choice([0.0, rng.uniform(140.0, 200.0)])))
    if conditions.imposed:
        usual = replace(usual, force=float(rng.uniform(0.1, 0.4)))
    if conditions.encoder:
        usual = replace(usual, position_step=float(conditions_rng.choice(ENCODER_STEPS)))
    sensors = replace(usual, bits=conditions.bits, drift=conditions.drift, outliers=conditions.outliers)
    return replace(similar.scale_sensors(sensors), rate=conditions.rate)


def draw_vessel(similar: RigScaling, rng: np.random.Generator) -> float:
    """Draw the volume in m^3 of the vessel of the valve test."""
    return rng.uniform(120e-6, 250e-6) * similar.length * similar.area


def draw_stated_stroke(stroke: float, rng: np.random.Generator) -> float | None:
    """Draw the stroke (m) that the pipeline file states: in half of the cases it is off by up to 0.5 %."""
    return stroke * (1.0 + rng.uniform(-5e-3, 5e-3)) if rng.random() < 0.5 else None


def draw_rig(kind: str, linear: bool, rng: np.random.Generator) -> Parameters:
    """Draw the usual rig of a kind; ``linear``: its valve has one gain and no overlap."""
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
