"""Nominal parameters of the axis by the names of the layout: rig, valve, friction, sensors and leaks of a model."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pneucli.controller.layout import COMPONENT_SWITCHES, OPEN_CHAMBER_VOLUME, STROKE_NODES, TABLE_NODES
from pneucli.design import effect_compensation
from pneucli.design.requirements import Requirements
from pneucli.physics.gas import flow_scale
from pneucli.simulate.model import Model, ValveForm
from pneucli.simulate.valve_forms.area import MIN_AREA

PRESSURE_MARGIN = (
    0.01  # of ambient and supply pressure, by which references keep off: what a pressure sensor may be wrong
)


def inverse_table(model: Model, valve: ValveForm, direction: float) -> tuple[tuple[float, ...], float]:
    """Return the inverse of a valve's areas in one direction.

    Args:
        model: The identified model, whose effects may change the opening (overlap, play).
        valve: Areas over commands.
        direction: 1 for filling, -1 for venting.

    Returns:
        Commands in V, TABLE_NODES of them, at the areas (i / (n - 1))^2 of the largest one, and the largest area in
        m^2. The largest area is that of the largest tested command; larger openings are not known.

    References:
        Thesis 7.3, 7.4: the inverse of the identified valve in the pressure loop.
    """
    top, stem = (
        max(direction * c for c in valve.commands if direction * c > 0),
        effect_compensation.identify_spool(model),
    )
    u = np.linspace(0.0, top, 40 * TABLE_NODES)
    area = np.maximum.accumulate(valve(np.interp(direction * u, stem.commands, stem.openings)))
    open_ = int(np.argmax(area > MIN_AREA))
    wanted = area[-1] * np.linspace(0.0, 1.0, TABLE_NODES) ** 2
    null = model.base_values()["valve.null"]
    return tuple(null + direction * np.interp(wanted, area[open_:], u[open_:])), float(area[-1])


def axis_parameters(
    model: Model, requirements: Requirements, areas: Sequence[float], sealed_pressure: float | None
) -> dict[str, float]:
    """Return the nominal parameters of the axis by the names of the layout.

    Args:
        model: The identified model.
        requirements: ``period``, and what chamber 2 is (``chamber_2``).
        areas: Largest areas in m^2 of filling and venting chamber 1, then chamber 2.
        sealed_pressure: Pressure in Pa of a closed chamber 2 with the piston at mid-stroke; None: the geometric mean of
            ambient and supply pressure.

    Returns:
        Parameters in SI units; switches are 0 or 1.
    """
    driven, is_open = requirements.chamber_2 == "valve", requirements.chamber_2 == "open"
    mirrored = driven and model.rig.arrangement.chamber_2 == "mirrored"
    fill, vent, fill_2, vent_2 = areas
    base, (dead_1, dead_2) = model.base_values(), effect_compensation.dead_volumes(model)
    rt = base["rig.gas_constant"] * base["rig.gas_temperature"]
    ambient, supply = base["rig.ambient_pressure"], base["rig.supply_pressure"]
    exponent = base["rig.polytropic_exponent"]
    return {
        "C_PERIOD": requirements.period,
        "C_U_MAX": max(abs(c) for c in model.valve.commands),
        "C_TWO_VALVES": float(driven and not mirrored),
        "C_MIRRORED": float(mirrored),
        **dict.fromkeys(COMPONENT_SWITCHES, 1.0),
        "C_PRESSURE_MODE": 0.0,
        "C_MASS": effect_compensation.moving_mass(model),
        "C_AREA_1": base["rig.piston_area_1"],
        "C_AREA_2": base["rig.piston_area_2"],
        "C_STROKE": base["rig.stroke"],
        "C_DEAD_VOLUME_1": dead_1,
        "C_DEAD_VOLUME_2": OPEN_CHAMBER_VOLUME if is_open else dead_2,
        "C_AMBIENT": ambient,
        "C_SUPPLY": supply,
        "C_GAMMA": exponent,
        "C_GAMMA_R_T": exponent * rt,
        "C_K_GAS": flow_scale(base["rig.heat_capacity_ratio"]) * math.sqrt(2.0 / rt),
        "C_CRITICAL_RATIO": effect_compensation.critical_ratio(model),
        **friction_parameters(model),
        **sensor_parameters(model),
        **leak_parameters(model),
        "C_P_LOW": (1.0 + PRESSURE_MARGIN) * ambient,
        "C_P_HIGH": (1.0 - PRESSURE_MARGIN) * supply,
        "C_AIR_STIFFNESS": 0.0,
        "C_P_MEAN": ambient if is_open else sealed_pressure or math.sqrt(ambient * supply),
        "C_AREA_FILL": fill,
        "C_AREA_VENT": vent,
        "C_AREA_FILL_2": fill_2,
        "C_AREA_VENT_2": vent_2,
        "C_STROKE_NODES": float(STROKE_NODES),
        "C_TABLE_NODES": float(TABLE_NODES),
    }


def friction_parameters(model: Model) -> dict[str, float]:
    """Return the parameters of friction that are constant along the stroke.

    Args:
        model: The identified model.

    Returns:
        C_COULOMB and C_STATIC in N, C_STRIBECK in m/s, C_VISCOUS and C_VISCOUS_BACK in N s/m, C_DECELERATION_RATIO (1;
        -1 for one branch), C_DRY_P1 and C_DRY_P2 in 1/Pa.

    References:
        Thesis (3.6) and, with two branches, (6.21).
    """
    (static, fallen), coulomb = effect_compensation.breakaway_friction(model), model.base_values()["friction.coulomb"]
    first, second = effect_compensation.dry_friction_per_pressure(model)
    return {
        "C_COULOMB": coulomb,
        "C_STATIC": max(static, coulomb),
        "C_STRIBECK": fallen,
        "C_VISCOUS": effect_compensation.viscous_friction(model, 1.0),
        "C_VISCOUS_BACK": effect_compensation.viscous_friction(model, -1.0),
        "C_DECELERATION_RATIO": effect_compensation.deceleration_friction_ratio(model),
        "C_DRY_P1": first,
        "C_DRY_P2": second,
    }


def sensor_parameters(model: Model) -> dict[str, float]:
    """Return scale (1) and offset (Pa) of both pressure sensors by the names of the layout."""
    first, second = (effect_compensation.sensor_line(model, chamber) for chamber in (1, 2))
    return {
        "C_SCALE_1": first.scale,
        "C_OFFSET_1": first.offset,
        "C_SCALE_2": second.scale,
        "C_OFFSET_2": second.offset,
    }


def leak_parameters(model: Model) -> dict[str, float]:
    """Return the areas of the leaks in m^2 by the names of the layout."""
    found = effect_compensation.leak_areas(model)
    names = ("C_LEAK_1", "C_LEAK_2", "C_LEAK_12", "C_LEAK_VALVE")
    return dict(zip(names, (found.chamber_1, found.chamber_2, found.between, found.valve), strict=True))
