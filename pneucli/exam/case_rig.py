"""Draw the rig of a case, its sensors, and what its pipeline file states of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pneucli.exam.conditions import Conditions
from pneucli.exam.hidden_effects import BY_NAME
from pneucli.exam.rig.gas import GAS_CONSTANT, PSI_MAX
from pneucli.exam.rig.hose import hose_volume
from pneucli.exam.rig.parameters import FIVE_THREE, TWO_VALVES, Parameters
from pneucli.exam.rig.sensors import Sensors
from pneucli.exam.rig_scaling import RigScaling

ARRANGEMENT_CODES = {"5/3": FIVE_THREE, "two": TWO_VALVES}
COMMAND_CYCLES = (5, 10, 20)  # ms, of programmable controllers
ENCODER_STEPS = (2e-6, 5e-6, 10e-6, 20e-6)  # m, of linear encoders


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
    """Return the rig with a valve that regulates the pressure, or with a pump, in place of the usual valve."""
    gauge = par.supply - par.ambient
    if source == "pump":
        choked = PSI_MAX * par.effective_area * par.supply * np.sqrt(2.0 / (GAS_CONSTANT * par.temperature))
        return par._replace(pump_flow=choked * rng.uniform(0.6, 1.0), pump_stall=gauge * rng.uniform(0.85, 1.0))
    loop = {"regulated_span": gauge * rng.uniform(0.8, 0.95), "regulated_band": gauge * rng.uniform(0.06, 0.12)}
    return par._replace(valve_lag=rng.uniform(3e-3, 6e-3), **loop)


def _with_valves(par: Parameters, conditions: Conditions, rng: np.random.Generator) -> Parameters:
    par = par._replace(switching=float(conditions.switching), command_null=conditions.null)
    if conditions.null_stated == "identify":
        par = par._replace(command_null=conditions.null + rng.uniform(-0.15, 0.15))
    if conditions.source is not None:
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
    stiffness = (par.supply - par.ambient) * par.piston_area_1 / pressed
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
