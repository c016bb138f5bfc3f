"""Recordings to identify friction from: fixtures, shared cases, and runs of the exam's rig (not our simulator)."""

import json
import os
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pneucli.arrays import Array
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.sensors import Sensors, measure
from pneucli.exam.rig.simulation import Excitation, simulate_rig
from pneucli.identify.friction.identification import FrictionIdentification, identify_friction
from pneucli.noise import NoiseModel
from pneucli.recording import Recording, Rig
from pneucli.simulate.model import Model
from pneucli.units import factor_and_offset, parse_quantity

FIXTURES = Path(__file__).parents[2] / "fixtures"
SHARED = Path(__file__).parents[3] / "shared"
CYLINDER = {"piston_area_1": "m^2", "piston_area_2": "m^2", "stroke": "m", "moving_mass": "kg"}

BENCH = Parameters(piston_area_1=8e-4, piston_area_2=8e-4, mass=2.0, coulomb=12.0, viscous=40.0)
RIG = Rig(ambient_pressure=101_300.0, piston_area_1=8e-4, piston_area_2=8e-4, stroke=0.2, moving_mass=2.0)
SENSORS = Sensors(pressure=200.0, acceleration=0.05, position_step=1e-6)
NOISE = {
    "p1": NoiseModel(white=200.0),
    "p2": NoiseModel(white=200.0),
    "x": NoiseModel(white=0.0, step=1e-6),
    "a": NoiseModel(white=0.05),
}


def load(folder: Path) -> tuple[list[Recording], Rig]:
    """The friction recordings of a folder that holds a pipeline file, and its rig."""
    document = tomllib.loads((folder / "pipeline.toml").read_text(encoding="utf-8"))
    about = document["rig"]
    ambient = parse_quantity(about["ambient_pressure"], "Pa")
    cylinder = {key: parse_quantity(about["cylinder"][key], unit) for key, unit in CYLINDER.items()}
    tables = [table for table in document["recordings"] if table["experiment"] == "friction"]
    return [_read(folder, table, document["signals"], ambient) for table in tables], Rig(
        ambient_pressure=ambient, **cylinder
    )


def _read(folder: Path, table: dict[str, Any], signals: dict[str, Any], ambient: float) -> Recording:
    lines = [t for t in (folder / table["file"]).read_text(encoding="utf-8").splitlines() if not t.startswith("#")]
    columns, rows = lines[0].split(","), np.loadtxt(lines[1:], delimiter=",")
    values = {}
    for name, signal in signals.items():
        if signal["column"] in columns:
            factor, zero = factor_and_offset(signal["unit"])
            gauge = ambient if signal.get("reference") == "gauge" else 0.0
            values[name] = factor * rows[:, columns.index(signal["column"])] + zero + gauge
    time = values.pop("time")
    return Recording(table["name"], "friction", table["use"], time, values, chamber_2=table.get("chamber_2"))


@cache
def identified(folder: Path) -> FrictionIdentification:
    recordings, rig = load(folder)
    return identify_friction(recordings, Model(rig))


def fixture_truth(name: str) -> dict[str, float]:
    truth = json.loads((FIXTURES / "truth.json").read_text(encoding="utf-8"))
    parameters: dict[str, float] = truth[name]["parameters"]
    return parameters


def case(number: str) -> Path:
    """A shared case; skips where the folder is absent."""
    folder = Path(os.environ.get("PNEUCLI_CASES", SHARED / "cases")) / f"case-{number}"
    if not folder.is_dir():
        pytest.skip("the shared cases are not here")
    return folder


def real(name: str) -> Path:
    """A folder of real recordings; skips where it is absent."""
    folder = Path(os.environ.get("PNEUCLI_DATA", SHARED / "real")) / name
    if not folder.is_dir():
        pytest.skip("the real recordings are not here")
    return folder


def pressed(par: Parameters, force: Array) -> dict[str, Array]:
    """True signals of the exam's rig whose pressures are imposed, so that they push with ``force`` (N) over 1 ms."""
    p2 = np.full(force.size, 3e5)
    p1 = p2 + force / par.piston_area_1
    manoeuvre = Excitation(
        np.zeros(force.size), position=0.1, pressure_1=float(p1[0]), pressure_2=3e5, imposed=np.column_stack([p1, p2])
    )
    return simulate_rig(par, manoeuvre)


def recorded(
    par: Parameters, truth: dict[str, Array], seed: int, signals: tuple[str, ...] = ("p1", "p2", "x", "a")
) -> Recording:
    """A recording of true signals with the sensors' noise."""
    seen = measure(par, SENSORS, truth, np.random.default_rng(seed))
    values = {name: seen[name] + (par.ambient if name in ("p1", "p2") else 0.0) for name in signals}
    time = 1e-3 * np.arange(truth["x"].size)
    noise = {name: NOISE[name] for name in signals}
    return Recording(f"run_{seed}", "friction", "train", time, values, noise, chamber_2="closed")


def pulses(count: int, peak: float, samples: int = 400) -> Array:
    """A force (N) that rises from 0 to ``peak`` and falls back, ``count`` times to either side, with rests between."""
    one = peak * np.sin(np.pi * np.clip(np.arange(samples) / (0.7 * samples), 0, 1)) ** 2
    return np.concatenate([np.zeros(100), *[side * one for _ in range(count) for side in (1.0, -1.0)], np.zeros(100)])
