"""Draw the rig of a case, its sensors, and what its pipeline file states of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pneucli.exam.conditions import Conditions
from pneucli.exam.hidden_effects import BY_NAME
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.sensors import Sensors
from pneucli.exam.rig_scaling import RigScaling
from pneucli.exam.rig_variants import draw_variant

COMMAND_CYCLES = (5, 10, 20)  # ms, of programmable controllers
ENCODER_STEPS = (2e-6, 5e-6, 10e-6, 20e-6)  # m, of linear encoders


def draw_stated_rig(
    kind: str,
    hidden: Sequence[str],
    conditions: Conditions,
    rng: np.random.Generator,
    conditions_rng: np.random.Generator,
) -> tuple[Parameters, Parameters, tuple[str, ...]]:
    """Return the usual rig, the rig that the pipeline file describes, and the effects that this file names."""
    linear = kind == "axis" and ("valve-deadband" in hidden or (rng.random() < 0.15 and conditions.allows_linear))
    friction = ("stribeck",) if kind == "axis" and "stribeck" not in hidden and rng.random() < 0.25 else ()
    base = draw_rig(kind, linear, rng)
    stated_rig, loads = draw_variant(base, kind, conditions, conditions_rng)
    for name in friction:
        stated_rig = BY_NAME[name].apply(stated_rig, 1.0, rng)
    return base, stated_rig, (*friction, *loads)


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
    return par.ambient + par.pump_stall * rng.uniform(0.9, 1.1)


def draw_sensors(
    conditions: Conditions, similar: RigScaling, rng: np.random.Generator, conditions_rng: np.random.Generator
) -> Sensors:
    """Draw the sensors of a rig of this size."""
    usual = Sensors(float(rng.choice([250.0, 400.0, 800.0])), float(rng.choice([0.0, 0.5, 0.8])), _mains_hum(rng))
    if conditions.imposed:
        usual = replace(usual, force=float(rng.uniform(0.1, 0.4)))
    if conditions.encoder:
        usual = replace(usual, position_step=float(conditions_rng.choice(ENCODER_STEPS)))
    sensors = replace(usual, bits=conditions.bits, drift=conditions.drift, outliers=conditions.outliers)
    return replace(similar.scale_sensors(sensors), rate=conditions.rate)


def _mains_hum(rng: np.random.Generator) -> float:
    return float(rng.choice([0.0, rng.uniform(140.0, 200.0)]))


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
