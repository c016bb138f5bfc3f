"""Design of the cascade: position loop, pressure loop, inverse valve map (thesis 7.1-7.3), by rules.

The whole axis violates the matching condition (:mod:`pneucli.design.sliding`), so an inner, faster loop makes the
pressure that drives the piston. Rules: :mod:`pneucli.design.bandwidths`, :mod:`pneucli.design.reference_limits`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pneucli.controller.parameters import Controller
from pneucli.design import effect_compensation
from pneucli.design.air_spring import level_settings
from pneucli.design.axis_parameters import axis_parameters, inverse_table
from pneucli.design.bandwidths import choose_bandwidths, loop_timing, valve_compensation
from pneucli.design.gains import controller_gains
from pneucli.design.reference_limits import reference_limits
from pneucli.design.requirements import Requirements
from pneucli.design.standstill import stiction_parameters
from pneucli.errors import InputError
from pneucli.simulate.model import Model

Array = NDArray[np.float64]


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
