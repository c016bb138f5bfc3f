"""What an exam may hide: the effects of the catalogue and effects that no catalogue names, with their sizes.

A size of 1 is about what the shared example cases hide; a third of it is a third of the distance from null.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pneucli.exam.rig.parameters import Parameters

Kind = str
Draw = Callable[[Parameters, np.random.Generator], dict[str, float]]

VALVE, FRICTION, AXIS = ("valve",), ("friction",), ("axis",)
RIGS_WITH_VALVE, RIGS_WITH_PISTON, ALL_RIGS = VALVE + AXIS, FRICTION + AXIS, VALVE + FRICTION + AXIS


@dataclass(frozen=True)
class HiddenEffect:
    """One effect: its name, the kinds of rig on which it shows, and how large it is at full size.

    ``fields`` maps the catalogue's parameter names to the rig's, with the factor from the catalogue's unit to SI.
    ``null_values`` maps the rig's fields that carry the size to their null values; an ``inverse`` one is null at infinity.
    Of an effect outside the catalogue, ``part`` says where it acts (force, flow or sensor) and ``variable`` the signal of
    which it is a function.
    """

    name: str
    kinds: tuple[Kind, ...]
    fields: dict[str, tuple[str, float]]
    null_values: dict[str, float]
    draw: Draw
    inverse: bool = False
    part: str = ""
    variable: str = ""

    def apply(self, par: Parameters, size: float, rng: np.random.Generator) -> Parameters:
        """Return the rig with this effect of the given size."""
        values = self.draw(par, rng)
        for field, null in self.null_values.items():
            base = par.coulomb if field == "static" else null
            values[field] = values[field] / size if self.inverse else base + size * (values[field] - base)
        return par._replace(**values)

    def true_parameters(self, par: Parameters) -> dict[str, float]:
        """The parameters in the catalogue's names and units."""
        return {name: float(getattr(par, field)) / factor for name, (field, factor) in self.fields.items()}


def _near(**centres: float) -> Draw:
    """Draw every field within 25 % of its centre."""
    return lambda _, rng: {name: centre * rng.uniform(0.75, 1.25) for name, centre in centres.items()}


def _either_sign(**centres: float) -> Draw:
    def draw(_: Parameters, rng: np.random.Generator) -> dict[str, float]:
        return {k: c * rng.uniform(0.75, 1.25) * float(rng.choice([-1.0, 1.0])) for k, c in centres.items()}

    return draw


def _in_si(name: str, kinds: tuple[Kind, ...], draw: Draw, scaled: dict[str, float], **fields: str) -> HiddenEffect:
    return HiddenEffect(name, kinds, {key: (field, 1.0) for key, field in fields.items()}, scaled, draw)


def _stribeck(par: Parameters, rng: np.random.Generator) -> dict[str, float]:
    return {"static": par.coulomb * rng.uniform(1.6, 2.1), "stribeck_velocity": rng.uniform(0.01, 0.025)}


def _patch(_: Parameters, rng: np.random.Generator) -> dict[str, float]:
    start = rng.uniform(0.06, 0.12)
    end = start + rng.uniform(0.015, 0.03)
    return {"position_from": start, "position_to": end, "position_gain": rng.uniform(1.0, 1.8)}


def _spring(_: Parameters, rng: np.random.Generator) -> dict[str, float]:
    return {"spring_stiffness": rng.uniform(150, 300), "spring_rest": rng.uniform(0.03, 0.17)}


def _payload(par: Parameters, rng: np.random.Generator) -> dict[str, float]:
    return {"extra_mass": par.mass * rng.uniform(0.4, 0.8)}


def _scale(_: Parameters, rng: np.random.Generator) -> dict[str, float]:
    return {"pressure_scale": 1.0 + rng.uniform(0.04, 0.08) * float(rng.choice([-1.0, 1.0]))}


CATALOGUE = (
    # not nested: at small conductances the gas is adiabatic, so size says nothing about how visible it is
    _in_si("heat-transfer", RIGS_WITH_VALVE, _near(heat_conductance=0.6), {}, conductance="heat_conductance"),
    _in_si("chamber-leak", RIGS_WITH_VALVE, _near(leak_area=3e-8), {"leak_area": 0.0}, area="leak_area"),
    _in_si(
        "laminar-leak",
        RIGS_WITH_VALVE,
        _near(laminar_conductance=1.5e-11),
        {"laminar_conductance": 0.0},
        conductance="laminar_conductance",
    ),
    _in_si(
        "opening-leak",
        RIGS_WITH_VALVE,
        _near(relief_growth=7e-13, relief_pressure=2.2e5),
        {"relief_growth": 0.0},
        growth="relief_growth",
        opening="relief_pressure",
    ),
    _in_si("piston-leak", AXIS, _near(piston_leak_area=8e-8), {"piston_leak_area": 0.0}, area="piston_leak_area"),
    _in_si(
        "dead-volume",
        AXIS,
        _near(dead_volume_added=15e-6),
        {"dead_volume_added": 0.0},
        volume_added="dead_volume_added",
    ),
    HiddenEffect(
        "supply-droop",
        RIGS_WITH_VALVE,
        {"vessel_volume": ("supply_volume", 1.0), "regulator_conductance": ("regulator_conductance", 1.0)},
        {"regulator_conductance": 0.0},
        _near(supply_volume=1.5e-3, regulator_conductance=2e-8),
        inverse=True,
    ),
    _in_si("line-delay", RIGS_WITH_VALVE, _near(line_delay=0.011), {"line_delay": 0.0}, delay="line_delay"),
    # the catalogue's width is the whole dead zone, the rig's overlap half of it, on each side of the centre
    HiddenEffect("valve-deadband", AXIS, {"width": ("overlap", 0.5)}, {"overlap": 0.0}, _near(overlap=0.5)),
    _in_si("valve-lag", RIGS_WITH_VALVE, _near(valve_lag=0.018), {"valve_lag": 0.0}, time_constant="valve_lag"),
    _in_si(
        "valve-hysteresis",
        RIGS_WITH_VALVE,
        _near(valve_half_width=0.2),
        {"valve_half_width": 0.0},
        half_width="valve_half_width",
    ),
    _in_si(
        "valve-leak", RIGS_WITH_VALVE, _near(valve_leak_area=3e-8), {"valve_leak_area": 0.0}, area="valve_leak_area"
    ),
    _in_si(
        "critical-ratio",
        RIGS_WITH_VALVE,
        _near(critical_ratio=0.2),
        {"critical_ratio": 0.528},
        critical_ratio="critical_ratio",
    ),
    _in_si("stribeck", RIGS_WITH_PISTON, _stribeck, {"static": 0.0}, static="static", velocity="stribeck_velocity"),
    _in_si("friction-hysteresis", RIGS_WITH_PISTON, _near(drop=0.45), {"drop": 0.0}, drop="drop"),
    HiddenEffect(
        "presliding",
        RIGS_WITH_PISTON,
        {"stiffness": ("bristle_stiffness", 1.0), "damping": ("bristle_damping", 1.0)},
        {"bristle_stiffness": 0.0},
        _near(bristle_stiffness=5e4, bristle_damping=80.0),
        inverse=True,
    ),
    _in_si(
        "friction-asymmetry",
        RIGS_WITH_PISTON,
        _either_sign(asymmetry=0.25, viscous_asymmetry=0.25),
        {"asymmetry": 0.0, "viscous_asymmetry": 0.0},
        asymmetry="asymmetry",
        viscous_asymmetry="viscous_asymmetry",
    ),
    HiddenEffect(
        "pressure-friction",
        RIGS_WITH_PISTON,
        {"gain": ("pressure_gain", 1e-5)},
        {"pressure_gain": 0.0},
        _near(pressure_gain=0.2e-5),
    ),
    HiddenEffect(
        "position-friction",
        RIGS_WITH_PISTON,
        {"from": ("position_from", 1.0), "to": ("position_to", 1.0), "gain": ("position_gain", 1.0)},
        {"position_gain": 0.0},
        _patch,
    ),
    _in_si(
        "constant-force",
        RIGS_WITH_PISTON,
        _either_sign(constant_force=16.0),
        {"constant_force": 0.0},
        force="constant_force",
    ),
    _in_si(
        "spring-force",
        RIGS_WITH_PISTON,
        _spring,
        {"spring_stiffness": 0.0},
        stiffness="spring_stiffness",
        rest_position="spring_rest",
    ),
    _in_si("extra-mass", RIGS_WITH_PISTON, _payload, {"extra_mass": 0.0}, mass="extra_mass"),
    _in_si(
        "end-cushion",
        RIGS_WITH_PISTON,
        _near(cushion_length=0.065, cushion_damping=250.0),
        {"cushion_damping": 0.0},
        length="cushion_length",
        damping="cushion_damping",
    ),
    _in_si(
        "dwell-breakaway",
        RIGS_WITH_PISTON,
        _near(dwell_gain=0.6, dwell_time=0.4),
        {"dwell_gain": 0.0},
        gain="dwell_gain",
        time_constant="dwell_time",
    ),
    _in_si(
        "pressure-offset",
        ALL_RIGS,
        _either_sign(pressure_offset=12e3),
        {"pressure_offset": 0.0},
        offset="pressure_offset",
    ),
    _in_si("pressure-scale", ALL_RIGS, _scale, {"pressure_scale": 1.0}, scale="pressure_scale"),
    _in_si("pressure-lag", ALL_RIGS, _near(pressure_lag=0.012), {"pressure_lag": 0.0}, time_constant="pressure_lag"),
    _in_si(
        "acceleration-bias",
        RIGS_WITH_PISTON,
        _either_sign(acceleration_bias=0.4),
        {"acceleration_bias": 0.0},
        bias="acceleration_bias",
    ),
    _in_si("time-skew", ALL_RIGS, _near(pressure_skew=0.012), {"pressure_skew": 0.0}, delay="pressure_skew"),
)
"""The effects of the catalogue."""


def _uncatalogued(name: str, kinds: tuple[Kind, ...], part: str, over: str, scaled: str, draw: Draw) -> HiddenEffect:
    return HiddenEffect(name, kinds, {}, dict.fromkeys(scaled.split(), 0.0), draw, part=part, variable=over)


UNCATALOGUED = (
    _uncatalogued(
        "dry friction falls over the first seconds",
        RIGS_WITH_PISTON,
        "force",
        "time",
        "running_in",
        _near(running_in=0.4),
    ),
    _uncatalogued(
        "viscous friction falls while warming up", RIGS_WITH_PISTON, "force", "time", "warming", _near(warming=0.55)
    ),
    _uncatalogued(
        "force periodic over position",
        RIGS_WITH_PISTON,
        "force",
        "x",
        "pitch_force",
        _near(pitch_force=9.0, pitch=0.02),
    ),
    _uncatalogued("quadratic drag", RIGS_WITH_PISTON, "force", "v", "quadratic_drag", _near(quadratic_drag=250.0)),
    _uncatalogued(
        "resonance of a flexibly coupled load",
        RIGS_WITH_PISTON,
        "force",
        "time",
        "load_mass load_stiffness load_damping",
        _near(load_mass=1.0, load_stiffness=2500.0, load_damping=4.0),
    ),
    _uncatalogued(
        "backlash between piston and load",
        RIGS_WITH_PISTON,
        "force",
        "time",
        "load_mass load_stiffness load_damping",
        _near(load_mass=1.2, load_stiffness=2e4, load_damping=40.0, load_gap=3e-3),
    ),
    _uncatalogued(
        "load periodic in time",
        RIGS_WITH_PISTON,
        "force",
        "time",
        "swinging_force",
        _near(swinging_force=9.0, swinging_frequency=1.3),
    ),
    _uncatalogued("bent guide", RIGS_WITH_PISTON, "force", "x", "bent_guide", _near(bent_guide=1.2)),
    _uncatalogued(
        "supply ripple that its sensor misses",
        RIGS_WITH_VALVE,
        "flow",
        "time",
        "ripple",
        _near(ripple=4e4, ripple_frequency=7.0),
    ),
    _uncatalogued(
        "valve gain drifts over each recording",
        RIGS_WITH_VALVE,
        "flow",
        "time",
        "gain_drift",
        _either_sign(gain_drift=0.06),
    ),
    _uncatalogued("spool sticks and jumps", RIGS_WITH_VALVE, "flow", "u", "spool_stiction", _near(spool_stiction=1.8)),
    _uncatalogued(
        "spool opens slowly and shuts at once",
        RIGS_WITH_VALVE,
        "flow",
        "u",
        "sluggish_opening",
        _near(sluggish_opening=0.04),
    ),
    _uncatalogued("clogged silencer", RIGS_WITH_VALVE, "flow", "p1", "silencer", _near(silencer=300.0)),
    _uncatalogued(
        "curved characteristic of the sensor of p1",
        RIGS_WITH_VALVE,
        "sensor",
        "p1",
        "pressure_curvature",
        _either_sign(pressure_curvature=8e-8),
    ),
    _uncatalogued(
        "curved characteristic of the sensor of x",
        AXIS,
        "sensor",
        "x",
        "position_curvature",
        _either_sign(position_curvature=0.2),
    ),
)
"""Effects that no catalogue names."""

BY_NAME = {effect.name: effect for effect in CATALOGUE + UNCATALOGUED}
