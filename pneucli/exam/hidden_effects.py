"""The effects that an exam may hide: those of the catalogue, and disturbances that no catalogue names.

A size of 1 is about that of the shared example cases; a third of it is a third of the distance from null.
"""

from __future__ import annotations

from pneucli.exam.hidden_effect import (
    ALL_RIGS,
    AXIS,
    RIGS_WITH_PISTON,
    RIGS_WITH_VALVE,
    HiddenEffect,
    around,
    disturbance,
    draw_hysteresis,
    draw_patch,
    draw_payload,
    draw_scale,
    draw_spring,
    draw_stribeck,
    either_sign,
    si_effect,
)

CATALOGUE = (
    # not nested: at small conductances the gas is adiabatic, so size says nothing about how visible it is
    si_effect("heat-transfer", RIGS_WITH_VALVE, around(heat_conductance=0.6), {}, conductance="heat_conductance"),
    si_effect("chamber-leak", RIGS_WITH_VALVE, around(leak_area=3e-8), {"leak_area": 0.0}, area="leak_area"),
    si_effect(
        "laminar-leak",
        RIGS_WITH_VALVE,
        around(laminar_conductance=1.5e-11),
        {"laminar_conductance": 0.0},
        conductance="laminar_conductance",
    ),
    si_effect(
        "opening-leak",
        RIGS_WITH_VALVE,
        around(relief_growth=7e-13, relief_pressure=2.2e5),
        {"relief_growth": 0.0},
        growth="relief_growth",
        opening="relief_pressure",
    ),
    si_effect("piston-leak", AXIS, around(piston_leak_area=8e-8), {"piston_leak_area": 0.0}, area="piston_leak_area"),
    si_effect(
        "dead-volume",
        AXIS,
        around(dead_volume_added=15e-6),
        {"dead_volume_added": 0.0},
        volume_added="dead_volume_added",
    ),
    HiddenEffect(
        "supply-droop",
        RIGS_WITH_VALVE,
        {"vessel_volume": ("supply_volume", 1.0), "regulator_conductance": ("regulator_conductance", 1.0)},
        {"regulator_conductance": 0.0},
        around(supply_volume=1.5e-3, regulator_conductance=2e-8),
        inverse=True,
    ),
    si_effect("line-delay", RIGS_WITH_VALVE, around(line_delay=0.011), {"line_delay": 0.0}, delay="line_delay"),
    # the catalogue's width is the whole dead zone, the rig's overlap half of it, on each side of the centre
    HiddenEffect("valve-deadband", AXIS, {"width": ("overlap", 0.5)}, {"overlap": 0.0}, around(overlap=0.5)),
    si_effect("valve-lag", RIGS_WITH_VALVE, around(valve_lag=0.018), {"valve_lag": 0.0}, time_constant="valve_lag"),
    si_effect(
        "valve-hysteresis",
        RIGS_WITH_VALVE,
        around(valve_half_width=0.2),
        {"valve_half_width": 0.0},
        half_width="valve_half_width",
    ),
    si_effect(
        "valve-leak", RIGS_WITH_VALVE, around(valve_leak_area=3e-8), {"valve_leak_area": 0.0}, area="valve_leak_area"
    ),
    si_effect(
        "critical-ratio",
        RIGS_WITH_VALVE,
        around(critical_ratio=0.2),
        {"critical_ratio": 0.528},
        critical_ratio="critical_ratio",
    ),
    si_effect(
        "stribeck", RIGS_WITH_PISTON, draw_stribeck, {"static": 0.0}, static="static", velocity="stribeck_velocity"
    ),
    si_effect(
        "friction-hysteresis",
        RIGS_WITH_PISTON,
        draw_hysteresis,
        {"drop": 0.0, "viscous_drop": 0.0},
        drop="drop",
        viscous_drop="viscous_drop",
    ),
    HiddenEffect(
        "presliding",
        RIGS_WITH_PISTON,
        {"stiffness": ("bristle_stiffness", 1.0), "damping": ("bristle_damping", 1.0)},
        {"bristle_stiffness": 0.0},
        around(bristle_stiffness=5e4, bristle_damping=80.0),
        inverse=True,
    ),
    si_effect(
        "friction-asymmetry",
        RIGS_WITH_PISTON,
        either_sign(asymmetry=0.25, viscous_asymmetry=0.25),
        {"asymmetry": 0.0, "viscous_asymmetry": 0.0},
        asymmetry="asymmetry",
        viscous_asymmetry="viscous_asymmetry",
    ),
    HiddenEffect(
        "pressure-friction",
        RIGS_WITH_PISTON,
        {"gain": ("pressure_gain", 1e-5)},
        {"pressure_gain": 0.0},
        around(pressure_gain=0.2e-5),
    ),
    HiddenEffect(
        "position-friction",
        RIGS_WITH_PISTON,
        {"from": ("position_from", 1.0), "to": ("position_to", 1.0), "gain": ("position_gain", 1.0)},
        {"position_gain": 0.0},
        draw_patch,
    ),
    si_effect(
        "constant-force",
        RIGS_WITH_PISTON,
        either_sign(constant_force=16.0),
        {"constant_force": 0.0},
        force="constant_force",
    ),
    si_effect(
        "spring-force",
        RIGS_WITH_PISTON,
        draw_spring,
        {"spring_stiffness": 0.0},
        stiffness="spring_stiffness",
        rest_position="spring_rest",
    ),
    si_effect("extra-mass", RIGS_WITH_PISTON, draw_payload, {"extra_mass": 0.0}, mass="extra_mass"),
    si_effect(
        "end-cushion",
        RIGS_WITH_PISTON,
        around(cushion_length=0.065, cushion_damping=250.0),
        {"cushion_damping": 0.0},
        length="cushion_length",
        damping="cushion_damping",
    ),
    si_effect(
        "dwell-breakaway",
        RIGS_WITH_PISTON,
        around(dwell_gain=0.6, dwell_time=0.4),
        {"dwell_gain": 0.0},
        gain="dwell_gain",
        time_constant="dwell_time",
    ),
    si_effect(
        "pressure-offset",
        ALL_RIGS,
        either_sign(pressure_offset=12e3),
        {"pressure_offset": 0.0},
        offset="pressure_offset",
    ),
    si_effect("pressure-scale", ALL_RIGS, draw_scale, {"pressure_scale": 1.0}, scale="pressure_scale"),
    si_effect(
        "pressure-lag", ALL_RIGS, around(pressure_lag=0.012), {"pressure_lag": 0.0}, time_constant="pressure_lag"
    ),
    si_effect(
        "acceleration-bias",
        RIGS_WITH_PISTON,
        either_sign(acceleration_bias=0.4),
        {"acceleration_bias": 0.0},
        bias="acceleration_bias",
    ),
    si_effect("time-skew", ALL_RIGS, around(pressure_skew=0.012), {"pressure_skew": 0.0}, delay="pressure_skew"),
)


# effects outside the catalogue: name, rigs, where they act, the signal of which they are a function, scaled fields
UNCATALOGUED = (
    disturbance(
        "dry friction falls over the first seconds",
        RIGS_WITH_PISTON,
        "force",
        "time",
        "running_in",
        around(running_in=0.4),
    ),
    disturbance(
        "viscous friction falls while warming up", RIGS_WITH_PISTON, "force", "time", "warming", around(warming=0.55)
    ),
    disturbance(
        "force periodic over position",
        RIGS_WITH_PISTON,
        "force",
        "x",
        "pitch_force",
        around(pitch_force=9.0, pitch=0.02),
    ),
    disturbance("quadratic drag", RIGS_WITH_PISTON, "force", "v", "quadratic_drag", around(quadratic_drag=250.0)),
    disturbance(
        "resonance of a flexibly coupled load",
        RIGS_WITH_PISTON,
        "force",
        "time",
        "load_mass load_stiffness load_damping",
        around(load_mass=1.0, load_stiffness=2500.0, load_damping=4.0),
    ),
    disturbance(
        "backlash between piston and load",
        RIGS_WITH_PISTON,
        "force",
        "time",
        "load_mass load_stiffness load_damping",
        around(load_mass=1.2, load_stiffness=2e4, load_damping=40.0, load_gap=3e-3),
    ),
    disturbance(
        "load periodic in time",
        RIGS_WITH_PISTON,
        "force",
        "time",
        "swinging_force",
        around(swinging_force=9.0, swinging_frequency=1.3),
    ),
    disturbance("bent guide", RIGS_WITH_PISTON, "force", "x", "bent_guide", around(bent_guide=1.2)),
    disturbance(
        "supply ripple that its sensor misses",
        RIGS_WITH_VALVE,
        "flow",
        "time",
        "ripple",
        around(ripple=4e4, ripple_frequency=7.0),
    ),
    disturbance(
        "valve gain drifts over each recording",
        RIGS_WITH_VALVE,
        "flow",
        "time",
        "gain_drift",
        either_sign(gain_drift=0.06),
    ),
    disturbance("spool sticks and jumps", RIGS_WITH_VALVE, "flow", "u", "spool_stiction", around(spool_stiction=1.8)),
    disturbance(
        "spool opens slowly and shuts at once",
        RIGS_WITH_VALVE,
        "flow",
        "u",
        "sluggish_opening",
        around(sluggish_opening=0.04),
    ),
    disturbance("clogged silencer", RIGS_WITH_VALVE, "flow", "p1", "silencer", around(silencer=300.0)),
    disturbance(
        "curved characteristic of the sensor of p1",
        RIGS_WITH_VALVE,
        "sensor",
        "p1",
        "pressure_curvature",
        either_sign(pressure_curvature=8e-8),
    ),
    disturbance(
        "curved characteristic of the sensor of x",
        AXIS,
        "sensor",
        "x",
        "position_curvature",
        either_sign(position_curvature=0.2),
    ),
)

BY_NAME = {effect.name: effect for effect in CATALOGUE + UNCATALOGUED}
