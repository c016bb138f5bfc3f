"""Design of the cascade: position loop, pressure loop, inverse valve map (thesis 7.1-7.3), by rules.

The whole axis violates the matching condition (:mod:`pneucli.design.sliding`), so an inner, faster loop makes the
pressure that drives the piston. :mod:`pneucli.design.bandwidths` has the rules for the gains. The rule for the
reference: its largest speed is 0.7 of the speed that the slower direction of the valve reaches, anywhere in the middle
60 % of the stroke with pressures well within their range; its largest acceleration is that whose force this direction
builds within half the time constant of the position loop.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pneucli.controller.layout import COMPONENT_SWITCHES, OPEN_CHAMBER_VOLUME, STROKE_NODES, TABLE_NODES
from pneucli.controller.parameters import Controller
from pneucli.design import effect_compensation
from pneucli.design.air_spring import level_settings
from pneucli.design.bandwidths import (
    Bandwidths,
    choose_bandwidths,
    controller_gains,
    loop_timing,
    stiction_parameters,
    valve_compensation,
)
from pneucli.design.requirements import Requirements
from pneucli.errors import InputError
from pneucli.physics.gas import flow_scale
from pneucli.physics.vectorised import flow_functions
from pneucli.simulate.model import Model, ValveForm
from pneucli.simulate.valve_forms.area import MIN_AREA

Array = NDArray[np.float64]
RestoringForce = Callable[[Array], Array]

WORKING_PRESSURES = (1.3, 0.85)  # of ambient and supply pressure: between them the valve has flow to spare both ways
STOPPING_TIME_CONSTANTS = (
    6.0  # time constants of the pressure loop that the shaped reference takes at least from full speed to rest
)
PRESSURE_MARGIN = (
    0.01  # of ambient and supply pressure, by which references keep off: what a pressure sensor may be wrong
)


def design_cascade(model: Model, requirements: Requirements, sealed_pressure: float | None = None) -> Controller:
    """Design the controller ``best`` for an identified model.

    Args:
        model: The identified model.
        requirements: The table ``[design]``.
        sealed_pressure: Pressure in Pa of a closed chamber 2 with the piston at mid-stroke; None: the geometric mean of
            ambient and supply pressure.

    Raises:
        InputError: The model has no cylinder, mass, supply pressure, or no valve in both directions.

    References:
        Thesis 7.1 to 7.3.

    """
    _require(model)
    tables = [inverse_table(model, valve, way) for valve in (model.valve, model.chamber_2_valve) for way in (1.0, -1.0)]
    axis = axis_parameters(model, requirements, [area for _, area in tables], sealed_pressure)
    corners, timing = choose_bandwidths(model, requirements, axis), loop_timing(model, requirements)
    axis |= level_settings(requirements, axis)
    limits = reference_limits(corners, axis, requirements, partial(effect_compensation.restoring_force, model))
    values = (
        axis
        | controller_gains(corners, axis, requirements, timing)
        | valve_compensation(model, requirements, timing)
        | limits
    )
    values |= stiction_parameters(
        corners,
        values,
        requirements,
        effect_compensation.bristle_stiffness(model),
        effect_compensation.dwell_strengthening(model),
    )
    fill, vent, fill_2, vent_2 = (commands for commands, _ in tables)
    if axis["C_MIRRORED"] > 0.5:
        null = model.base_values()["valve.null"]
        fill_2, vent_2 = (mirrored_commands(commands, null) for commands in (fill_2, vent_2))
    return Controller(values, fill, vent, fill_2, vent_2, along=stroke_tables(model, limits["C_V_MAX"]))


def mirrored_commands(commands: Sequence[float], null: float) -> tuple[float, ...]:
    """Return the commands of the one spool of a 5/3 valve at the openings of chamber 2, which opens the other way.

    Args:
        commands: Commands (n,) in V in the sense of the map of chamber 2: above ``null`` it fills.
        null: Command in V at which nothing flows.

    >>> mirrored_commands((5.5, 6.0), 5.0)
    (4.5, 4.0)

    """
    return tuple(2.0 * null - u for u in commands)


def stroke_tables(model: Model, speed: float) -> tuple[tuple[float, ...], ...]:
    """Return the tables over the stroke by the order of ``layout.STROKE_TABLES``.

    Args:
        model: The identified model.
        speed: Speed in m/s at which added damping is evaluated, both ways.

    Returns:
        Factors on dry friction toward +x and -x (1), added damping both ways (N s/m), and the static force of the
        effects on the resting piston (N toward +x), each at STROKE_NODES positions.
    """
    x = effect_compensation.stroke_grid(model)
    both = (1.0, -1.0)
    tables = [effect_compensation.dry_friction_factors(model, x, way) for way in both]
    tables += [effect_compensation.added_damping(model, x, way * speed) for way in both]
    return tuple(tuple(map(float, table)) for table in [*tables, -effect_compensation.restoring_force(model, x)])


REQUIRED_RIG_VALUES = {
    "cylinder.piston_area_1": '"8.04 cm^2"',
    "cylinder.stroke": '"200 mm"',
    "cylinder.dead_volume_1": '"30 cm^3"',
    "cylinder.dead_volume_2": '"30 cm^3"',
    "cylinder.moving_mass": '"2.2 kg"',
    "supply_pressure": '"7 bar"',
}  # of [rig], and how it may be written


def _require(model: Model) -> None:
    for key, example in REQUIRED_RIG_VALUES.items():
        table, _, name = f"rig.{key}".rpartition(".")
        if getattr(model.rig, name) is None and f"rig.{name}" not in model.values:
            mend = f"add {name} = {example} below [{table}], with your rig's own number"
            raise InputError(f"[rig] {key}", "a controller needs it, and it is not known", "its value", mend)
    if any(min(v.commands, default=0.0) >= 0.0 or max(v.commands, default=0.0) <= 0.0 for v in model.valves):
        raise InputError(
            "the valve", "not identified in both directions", "recordings that fill and that vent chamber 1"
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


def reference_limits(
    bandwidths: Bandwidths,
    axis: Mapping[str, float],
    requirements: Requirements,
    restoring_force: RestoringForce = np.zeros_like,
) -> dict[str, float]:
    """Return the limits of the shaped reference and its time constant, and the rates that follow from the valve.

    Args:
        bandwidths: Corner frequencies in rad/s.
        axis: Parameters of the axis by name (SI).
        requirements: ``max_speed`` in m/s and ``max_acceleration`` in m/s^2 have precedence over the rules.
        restoring_force: Force of the effects in N toward x = 0, at x in m.

    Returns:
        C_V_MAX (m/s), C_A_MAX (m/s^2), C_SHAPING_TIME and C_FRICTION_LEAD (s), C_LEVEL_RATE and C_FLOW_STEP_MAX (Pa/s).
    """
    speed, rate = reachable_speed_and_gradient(axis, restoring_force)
    force_rate = axis["C_AREA_1"] * rate
    highest = requirements.max_speed or 0.7 * speed
    rule = min(
        force_rate / (2.0 * bandwidths.position * axis["C_MASS"]),
        highest * bandwidths.pressure / STOPPING_TIME_CONSTANTS,
    )
    return {
        "C_V_MAX": highest,
        "C_A_MAX": requirements.max_acceleration or rule,
        "C_SHAPING_TIME": max(4.0 * requirements.period, 1.0 / bandwidths.pressure),
        "C_FRICTION_LEAD": 1.0 / bandwidths.pressure,
        "C_LEVEL_RATE": 0.2 * rate,
        "C_FLOW_STEP_MAX": 0.05 * rate,
    }


def reachable_speed_and_gradient(
    axis: Mapping[str, float], restoring_force: RestoringForce = np.zeros_like
) -> tuple[float, float]:
    """Return the speed and the pressure gradient that both directions of the valve reach.

    The minimum over the middle 60 % of the stroke, where the pressures in equilibrium with the air spring and the
    restoring force are well within their range.

    Args:
        axis: Parameters of the axis by name (SI).
        restoring_force: Force of the effects in N toward x = 0, at x in m.

    Returns:
        Speed in m/s and pressure gradient in Pa/s.

    References:
        Thesis (2.46) to (2.52): the flow that keeps the pressures while the piston moves.
    """
    area_1, area_2, stroke, gamma = axis["C_AREA_1"], axis["C_AREA_2"], axis["C_STROKE"], axis["C_GAMMA"]
    x = np.linspace(0.2, 0.8, 25) * stroke
    volume_1, volume_2 = axis["C_DEAD_VOLUME_1"] + area_1 * x, axis["C_DEAD_VOLUME_2"] + area_2 * (stroke - x)
    p2 = chamber_2_pressure(axis, x)
    balance = (area_2 * p2 + (area_1 - area_2) * axis["C_AMBIENT"] + restoring_force(x)) / area_1
    p1 = np.clip(balance, WORKING_PRESSURES[0] * axis["C_AMBIENT"], WORKING_PRESSURES[1] * axis["C_SUPPLY"])
    low, high = axis["C_AMBIENT"] / p1, p1 / axis["C_SUPPLY"]
    scale = axis["C_GAMMA_R_T"] * axis["C_K_GAS"] / volume_1
    fill = axis["C_AREA_FILL"] * scale * axis["C_SUPPLY"] * flow_functions(high, axis["C_CRITICAL_RATIO"])
    vent = axis["C_AREA_VENT"] * scale * p1 * flow_functions(low, axis["C_CRITICAL_RATIO"])
    if axis["C_MIRRORED"] > 0.5:  # the other chamber gives way at the same time
        share = axis["C_AREA_2"] / area_1 * axis["C_GAMMA_R_T"] * axis["C_K_GAS"] / volume_2
        ratio_2 = p2 / axis["C_SUPPLY"], axis["C_AMBIENT"] / p2
        fill = fill + share * axis["C_AREA_VENT_2"] * p2 * flow_functions(ratio_2[1], axis["C_CRITICAL_RATIO"])
        vent = vent + share * axis["C_AREA_FILL_2"] * axis["C_SUPPLY"] * flow_functions(
            ratio_2[0], axis["C_CRITICAL_RATIO"]
        )
    rate = np.minimum(fill, vent)
    per_speed = gamma * (p1 * area_1 / volume_1 + p2 * area_2**2 / (area_1 * volume_2))
    within = p1 == balance if np.any(p1 == balance) else np.ones(x.size, dtype=bool)
    return float(np.min((rate / per_speed)[within])), float(np.min(rate[within]))


def chamber_2_pressure(axis: Mapping[str, float], x: Array) -> Array:
    """Return the pressure in Pa of chamber 2: sealed at mid-stroke (isentropic), or held by its valve.

    Args:
        axis: Parameters of the axis by name (SI); C_P_MEAN is the pressure at mid-stroke.
        x: Position in m.

    >>> axis = {"C_TWO_VALVES": 0.0, "C_MIRRORED": 0.0, "C_P_MEAN": 3e5, "C_GAMMA": 1.4, "C_STROKE": 0.2}
    >>> axis |= {"C_DEAD_VOLUME_2": 0.0, "C_AREA_2": 8e-4}
    >>> chamber_2_pressure(axis, np.array([0.1, 0.15])).round()  # half the volume: times 2^1.4
    array([300000., 791705.])
    """
    if axis["C_TWO_VALVES"] > 0.5 or axis["C_MIRRORED"] > 0.5:
        return np.full_like(x, axis["C_P_MEAN"])
    half = axis["C_DEAD_VOLUME_2"] + 0.5 * axis["C_AREA_2"] * axis["C_STROKE"]
    volume = axis["C_DEAD_VOLUME_2"] + axis["C_AREA_2"] * (axis["C_STROKE"] - x)
    return np.asarray(axis["C_P_MEAN"] * (half / volume) ** axis["C_GAMMA"])
