"""Writing an exam: folders as a lab would hand them over, and apart from them, sealed, what was hidden in each."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from pneucli.errors import InputError, did_you_mean
from pneucli.exam.conditions import USUAL, Conditions, parse
from pneucli.exam.hidden import BY_NAME, CATALOGUE, OUTSIDE, Hidden
from pneucli.exam.laboratory import Laboratory, Take
from pneucli.exam.rig.manoeuvres import closed_loop, stick_slip, valve_stairs, valve_step, wandering
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.run import Manoeuvre
from pneucli.exam.rig.sensors import Sensors
from pneucli.exam.similar import Similar

Kind = Literal["valve", "friction", "axis"]
KINDS: tuple[Kind, ...] = ("valve", "friction", "axis")
SEALED = ".sealed"
STEPS = ((0.6, 1.2, 2.5, 4.0, 6.0, 8.0, 10.0), (0.5, 1.0, 2.0, 3.5, 5.0, 7.5, 10.0))
STAIRS = ((0.5, 1.6), (0.7, 1.2))


def write_exam(
    directory: Path,
    cases: int = 60,
    nulls: int = 20,
    size: float = 1.0,
    seed: int = 1,
    conditions: Sequence[str] = (USUAL,),
) -> list[str]:
    """Write ``cases`` cases with something hidden and ``nulls`` without, for each of the ``conditions``.

    Every sixth case hides two effects of the catalogue, every fifth one from outside; the others go through the
    catalogue in random order. Conditions get the same rigs with the same effects as far as these show under them, so
    that what a condition costs is seen. The names of the folders, which are returned, do not tell which is which.
    Raises InputError where the directory holds something already, or for an unknown condition.
    """
    each = [parse(text) for text in conditions]
    if directory.exists() and any(directory.iterdir()):
        raise InputError(str(directory), "the folder is not empty", "a new folder for the exam", "choose another name")
    plan = [planned for one in each for planned in _plan(cases, nulls, one, seed)]
    names = [f"case-{k:03d}" for k in range(1, len(plan) + 1)]
    for name, which in zip(names, np.random.default_rng(seed).permutation(len(plan)), strict=True):
        planned = plan[which]
        truth = generate_case(
            directory / name, planned.kind, planned.hidden, planned.outside, size, planned.seed, planned.conditions
        )
        sealed = directory / SEALED / f"{name}.json"
        sealed.parent.mkdir(exist_ok=True)
        sealed.write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")
    return names


def generate_case(
    folder: Path,
    kind: str,
    hidden: Sequence[str],
    outside: str,
    size: float,
    seed: int,
    conditions: Conditions = Conditions(),  # noqa: B008  (frozen)
) -> dict[str, object]:
    """Write ``folder/pipeline.toml`` and ``folder/raw/*.csv``; returns the truth, which is written nowhere.

    ``hidden`` names effects of the catalogue and ``outside`` one that is in none ("" for none); both are scaled by
    ``size``. Raises InputError where a name is unknown or does not show on this kind of rig.
    """
    effects = [_effect(name, kind) for name in [*hidden, *([outside] if outside else [])]]
    rng = np.random.default_rng(seed)
    linear = kind == "axis" and ("valve-deadband" in hidden or rng.random() < 0.15)
    baseline = ("stribeck",) if kind == "axis" and "stribeck" not in hidden and rng.random() < 0.25 else ()
    par = _rig(kind, linear, rng)
    similar = Similar.of(par, conditions.bore, conditions.supply)
    for effect in [*(BY_NAME[name] for name in baseline), *effects]:
        par = effect.set(par, size if effect in effects else 1.0, rng)
    sensors = Sensors(float(rng.choice([250.0, 400.0, 800.0])), float(rng.choice([0.0, 0.5, 0.8])), _hum(rng))
    laboratory = Laboratory(
        folder.name,
        similar.rig(par),
        replace(similar.sensors(sensors), rate=conditions.rate),
        vessel=None if kind == "friction" or linear else rng.uniform(120e-6, 250e-6) * similar.length * similar.area,
        has_cylinder=kind != "valve",
        supply_recorded="supply-droop" not in hidden and rng.random() > 0.15,
        linear_valve=linear,
        effects=baseline,
    )
    takes = _takes(kind, laboratory, similar, rng)
    laboratory.record(folder / "raw", takes, rng)
    (folder / "pipeline.toml").write_text(laboratory.pipeline(takes, "raw"), encoding="utf-8")
    return _truth(laboratory, [BY_NAME[name] for name in hidden], outside, conditions)


@dataclass(frozen=True)
class Planned:
    """One case to be written."""

    kind: str
    hidden: tuple[str, ...]
    outside: str
    seed: int
    conditions: Conditions


def _plan(cases: int, nulls: int, conditions: Conditions, seed: int) -> Iterator[Planned]:
    rng = np.random.default_rng(seed)
    singles, strangers = _endless(CATALOGUE, rng), _endless(OUTSIDE, rng)
    for k in range(cases + nulls):
        hidden: tuple[str, ...] = ()
        outside = ""
        if k < cases and k % 6 == 5:
            hidden = _pair(rng)
        elif k < cases and k % 5 == 4:
            outside = next(strangers)
        elif k < cases:
            hidden = (next(singles),)
        kind = str(rng.choice(_kinds([*hidden, *([outside] if outside else [])])))
        yield Planned(kind, hidden, outside, int(rng.integers(2**31)), conditions)


def _endless(effects: Sequence[Hidden], rng: np.random.Generator) -> Iterator[str]:
    while True:
        yield from (effects[i].name for i in rng.permutation(len(effects)))


def _pair(rng: np.random.Generator) -> tuple[str, ...]:
    kind = str(rng.choice(KINDS))
    names = [effect.name for effect in CATALOGUE if kind in effect.kinds]
    return tuple(str(name) for name in rng.choice(names, 2, replace=False))


def _kinds(names: Sequence[str]) -> list[str]:
    return [kind for kind in KINDS if all(kind in BY_NAME[name].kinds for name in names)]


def _effect(name: str, kind: str) -> Hidden:
    if name not in BY_NAME:
        raise InputError("exam", f'no effect "{name}"', "an effect that the rig can hide", did_you_mean(name, BY_NAME))
    if kind not in BY_NAME[name].kinds:
        raise InputError("exam", f'"{name}" does not show on the rig "{kind}"', " or ".join(BY_NAME[name].kinds))
    return BY_NAME[name]


def _rig(kind: str, linear: bool, rng: np.random.Generator) -> Parameters:
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


def _hum(rng: np.random.Generator) -> float:
    return float(rng.choice([0.0, rng.uniform(140.0, 200.0)]))


def _takes(kind: str, laboratory: Laboratory, similar: Similar, rng: np.random.Generator) -> list[Take]:
    par, bench = laboratory.parameters, laboratory.bench
    takes: list[Take] = []
    if laboratory.vessel is not None:
        steps = STEPS[int(rng.integers(len(STEPS)))]
        tested = steps[3] if kind == "valve" else None
        takes += [Take(f"step_+{v}V", "valve", "test" if v == tested else "train", valve_step(bench, v)) for v in steps]
        takes += [
            Take(f"stairs_{i}", "valve", "test" if i == 2 else "train", valve_stairs(bench, *levels))
            for i, levels in enumerate(STAIRS, 1)
        ]
    if kind == "friction":
        rates = (rng.uniform(5e3, 8e3), rng.uniform(9e3, 14e3))
        moves = [stick_slip(par, rate * similar.pressure, 0.15 * par.stroke) for rate in rates]
        takes += [
            Take(f"stickslip_{i}", "friction", "test" if i == 2 else "train", move) for i, move in enumerate(moves, 1)
        ]
        moves = [_driven(par, 6000, similar, rng) for _ in range(3)]
        takes += [
            Take(f"driven_{i}", "friction", "test" if i == 3 else "train", move) for i, move in enumerate(moves, 1)
        ]
    if kind == "axis":
        moves = [_driven(par, 8000, similar, rng) for _ in range(4)]
        takes += [Take(f"axis_{i}", "axis", "test" if i == 4 else "train", move) for i, move in enumerate(moves, 1)]
    return takes


def _driven(par: Parameters, samples: int, similar: Similar, rng: np.random.Generator) -> Manoeuvre:
    reference = wandering(rng, samples, par.stroke)
    gain, gauge = rng.uniform(100.0, 200.0), rng.uniform(1.3e5, 2.2e5)
    return closed_loop(par, reference, gain / similar.length, gauge * similar.pressure)


def _truth(laboratory: Laboratory, hidden: Sequence[Hidden], outside: str, conditions: Conditions) -> dict[str, object]:
    par = laboratory.parameters
    return {
        "hidden": {effect.name: effect.truth(par) for effect in hidden},
        "outside_the_catalogue": outside or None,
        "baseline": list(laboratory.effects),
        "conditions": list(conditions.names) or [USUAL],
        "verdict": "unexplained" if outside else "missing-effect" if hidden else "adequate",
        "base": {
            "coulomb": par.coulomb,
            "viscous": par.viscous,
            "effective_area_at_10V": par.effective_area,
            "overlap_V": par.overlap,
            "area_exponent": par.exponent,
        },
        "sensor_noise_pressure_Pa": laboratory.sensors.pressure,
    }
