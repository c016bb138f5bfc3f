"""Design of the cascade: position loop, pressure loop, inverse valve map (thesis 7.1-7.3), by rules.

The whole axis violates the matching condition (:mod:`pneucli.design.sliding`), so an inner, faster loop makes the
pressure that drives the piston. Rules: :mod:`pneucli.design.bandwidths`.
"""

import math
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from pneucli.controller.layout import COMPONENT_SWITCHES, OPEN_CHAMBER_VOLUME, STROKE_NODES, TABLE_NODES
from pneucli.controller.parameters import Controller
from pneucli.design import effect_compensation
from pneucli.design.air_spring import level_settings
from pneucli.design.bandwidths import (
    Bandwidths,
    choose_bandwidths,
    controller_gains,
    loop_timing,
    reference_limits,
    valve_compensation,
)
from pneucli.design.requirements import Requirements
from pneucli.errors import InputError
from pneucli.physics.gas import flow_scale
from pneucli.simulate.model import Model, ValveForm
from pneucli.simulate.valve_forms import MIN_AREA

SEAL_STIFFNESS = 12.0  # supply forces over the stroke: stiffness of a soft seal before the piston slides
CLOSING_RATE = 10.0  # 1/s: closing speed per error near a resting reference
DWELL_RATE_FACTOR = 5.0  # rate of the release force over the rate at which a rest raises break-away
FAST_RAMP_RATIO = 10.0  # time constants of the pressure loop in which the release force rises by a break-away force
SLOW_RAMP_RATIO = 400.0  # the same near break-away: the rise within the lag of the loop accelerates the freed piston
MAX_DEADBAND_GAIN = 10.0  # largest dead band over the holding band of the default tolerance
WITHIN_TOLERANCE = 2.0 / 1.8  # likewise of a wide tolerance: a held piston is let go at 1.8 dead bands
HELD_SHARE = 0.6  # of break-away, by which a relay test pushes the piston
BAND_SHARE = 0.5  # of that, the half band of the relay
BAND_NOISE = 8.0  # standard deviations of the pressure's noise in the half band of a relay test
LONGEST_DELAY = 25e-3  # s: delay at which a relay test pushes so much
PRESSURE_LIMIT_RATIO = 8.0  # limit of a relay test's pressure over that
TRAVEL_LIMIT = 0.02  # of the stroke, in a relay test
PRESSURE_MARGIN = (
    0.01  # of ambient and supply pressure, by which references keep off: what a pressure sensor may be wrong
)


def _soft_seal(values: Mapping[str, float]) -> float:
    """Return the stiffness in N/m of soft seals before the piston slides.

    >>> round(_soft_seal({"C_AREA_1": 8e-4, "C_SUPPLY": 7e5, "C_AMBIENT": 1e5, "C_STROKE": 0.2}), 6)
    28800.0
    """
    return SEAL_STIFFNESS * values["C_AREA_1"] * (values["C_SUPPLY"] - values["C_AMBIENT"]) / values["C_STROKE"]


def stiction_parameters(
    bandwidths: Bandwidths,
    values: Mapping[str, float],
    requirements: Requirements,
    stiffness: float,
    dwell: effect_compensation.DwellStrengthening,
) -> dict[str, float]:
    """Return the parameters of hold and release (:mod:`pneucli.controller.standstill`).

    Forces and their rates are multiples of the break-away force.

    Args:
        bandwidths: Corner frequencies in rad/s.
        values: Parameters of the axis and of the loops by name (SI).
        requirements: ``tolerance``, by default 10 um, two quanta or four sigma of the position sensor.
        stiffness: Presliding stiffness in N/m, 0 without a value: that of soft seals.
        dwell: Growth of break-away with the time at rest.

    """
    static = values["C_STATIC"]
    least = max(10e-6, 2.0 * requirements.quantum_x, 4.0 * requirements.noise_x)
    band = 0.5 * (requirements.tolerance or least)
    slope = min(0.2 / requirements.period, bandwidths.pressure / 5.0)
    seal = stiffness or _soft_seal(values)
    slow = bandwidths.pressure / SLOW_RAMP_RATIO * static  # N/s
    return {
        "C_HOLDING_BAND": band,
        "C_MOTION_STEP": 0.5 * least,
        "C_V_FLOOR": max(2.0 * requirements.quantum_x / requirements.period, 0.01 * values["C_V_MAX"]),
        "C_MOTION_WINDOW": 6.0 / bandwidths.pressure,
        "C_SECTOR_1": slope / requirements.sector_ratio,
        "C_SECTOR_2": slope,
        "C_RAMP_RATE_PER_ERROR": slow / (5.0 * band),
        "C_RAMP_RATE_MIN": max(slow, DWELL_RATE_FACTOR * dwell.initial_rate * static),
        "C_RAMP_RATE_MAX": bandwidths.pressure / FAST_RAMP_RATIO * static,
        "C_BREAKAWAY_MAX": static if dwell.initial_rate > 0.0 else 2.0 * static,
        "C_PRESSURE_BAND": 0.1 * static / values["C_AREA_1"],
        "C_LOAD_STEP_MAX": max(0.25 * static, 0.01 * values["C_AREA_1"] * values["C_SUPPLY"]),
        "C_PRESLIDING_DISTANCE": 1.5 * values["C_COULOMB"] / seal,  # the largest elastic excursion
        "C_RAMP_GROWTH_RATE": bandwidths.pressure / 6.0,
        "C_RELEASE_FORCE_MAX": 3.0 * static * dwell.max_factor
        + values["C_AREA_1"] * (values["C_SUPPLY"] - values["C_AMBIENT"]),
        "C_UNLOADING_RATE": bandwidths.pressure / 5.0,
        "C_CLOSING_RATE": CLOSING_RATE,
        "C_ELASTIC_RATE": max(values["C_MASS"] * values["C_KI"], CLOSING_RATE * seal),
        "C_BRAKE_DAMPING": values["C_MASS"] * values["C_KD"],
        "C_DEADBAND_GAIN_MAX": max(0.5 * MAX_DEADBAND_GAIN * least / band, WITHIN_TOLERANCE),
    }


def relay_parameters(values: Mapping[str, float], requirements: Requirements) -> dict[str, float]:
    """Return the parameters of the relay test of a commissioning (:mod:`pneucli.controller.commissioning`).

    Args:
        values: Parameters of the axis by name (SI).
        requirements: ``noise_p`` in Pa.

    Returns:
        C_RELAY_BAND, C_PRESSURE_LIMIT (Pa), C_RELAY_RATE (Pa/s), C_TRAVEL_LIMIT (m), and no family of gains. One spool
        lets both pressures drift together, which does not push the piston: half of what there is may be passed.

    >>> axis = {"C_STATIC": 20.0, "C_AREA_1": 8e-4, "C_STROKE": 0.2, "C_MIRRORED": 0.0}
    >>> found = relay_parameters(axis, Requirements(noise_p=400.0))
    >>> {name: round(value, 6) for name, value in found.items() if not name.startswith("C_FAMILY")}
    {'C_RELAY_BAND': 7500.0, 'C_RELAY_RATE': 300000.0, 'C_PRESSURE_LIMIT': 120000.0, 'C_TRAVEL_LIMIT': 0.004}
    """
    amplitude = max(
        HELD_SHARE * values["C_STATIC"] / values["C_AREA_1"], BAND_NOISE / BAND_SHARE * requirements.noise_p
    )
    band = BAND_SHARE * amplitude
    return {
        "C_RELAY_BAND": band,
        "C_RELAY_RATE": (amplitude - band) / LONGEST_DELAY,
        "C_PRESSURE_LIMIT": 0.5 * (values["C_SUPPLY"] - values["C_AMBIENT"])
        if values["C_MIRRORED"] > 0.5
        else PRESSURE_LIMIT_RATIO * amplitude,
        "C_TRAVEL_LIMIT": TRAVEL_LIMIT * values["C_STROKE"],
        "C_FAMILY": 0.0,
        "C_FAMILY_MEMBERS": 0.0,
        "C_FAMILY_WIDTH": 0.0,
    }


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
        **_sensor_parameters(model),
        **_leak_parameters(model),
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


def _sensor_parameters(model: Model) -> dict[str, float]:
    """Return scale (1) and offset (Pa) of both pressure sensors by the names of the layout."""
    first, second = (effect_compensation.sensor_line(model, chamber) for chamber in (1, 2))
    return {
        "C_SCALE_1": first.scale,
        "C_OFFSET_1": first.offset,
        "C_SCALE_2": second.scale,
        "C_OFFSET_2": second.offset,
    }


def _leak_parameters(model: Model) -> dict[str, float]:
    """Return the areas of the leaks in m^2 by the names of the layout."""
    found = effect_compensation.leak_areas(model)
    names = ("C_LEAK_1", "C_LEAK_2", "C_LEAK_12", "C_LEAK_VALVE")
    return dict(zip(names, (found.chamber_1, found.chamber_2, found.between, found.valve), strict=True))


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
    values |= relay_parameters(values, requirements)
    fill, vent, fill_2, vent_2 = (commands for commands, _ in tables)
    if axis["C_MIRRORED"] > 0.5:
        null = model.base_values()["valve.null"]
        fill_2, vent_2 = (_mirrored_commands(commands, null) for commands in (fill_2, vent_2))
    return Controller(values, fill, vent, fill_2, vent_2, along=_stroke_tables(model, limits["C_V_MAX"]))


def _mirrored_commands(commands: Sequence[float], null: float) -> tuple[float, ...]:
    """Return the commands of the one spool of a 5/3 valve at the openings of chamber 2, which opens the other way.

    >>> _mirrored_commands((5.5, 6.0), 5.0)
    (4.5, 4.0)
    """
    return tuple(2.0 * null - u for u in commands)


def _stroke_tables(model: Model, speed: float) -> tuple[tuple[float, ...], ...]:
    """Return the tables over the stroke by the order of ``layout.STROKE_TABLES``."""
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
            raise InputError(
                f"[rig] {key}", "a controller needs it, and it is not known", "its value", mend, code="E063"
            )
    if any(min(v.commands, default=0.0) >= 0.0 or max(v.commands, default=0.0) <= 0.0 for v in model.valves):
        raise InputError(
            "the valve",
            "not identified in both directions",
            "recordings that fill and that vent chamber 1",
            code="E070",
        )
