"""All parameters of the virtual rig; the defaults are a rig without any additional effect."""

from typing import NamedTuple

ONE_CHAMBER, FIVE_THREE, TWO_VALVES = 0.0, 1.0, 2.0


class Parameters(NamedTuple):
    """One rig, SI, pressures absolute.

    The base is a piston with Coulomb and viscous friction between two isentropic chambers of constant temperature
    (thesis 2.47-2.52, 3.4) and a valve of area ``effective_area ((|u| - overlap)/(10 V - overlap))**exponent``.
    A vessel is a chamber 1 with ``piston_area_1 = 0``. All fields are floats, so that numba compiles the rig once.
    """

    # stated of a rig
    temperature: float = 293.15
    ambient: float = 101_300.0
    supply: float = 701_300.0
    piston_area_1: float = 8e-4
    piston_area_2: float = 8e-4
    stroke: float = 0.2
    dead_volume_1: float = 30e-6
    dead_volume_2: float = 30e-6
    mass: float = 2.0
    # identified
    coulomb: float = 15.0
    viscous: float = 50.0
    effective_area: float = 2e-6  # at 10 V
    overlap: float = 0.0
    exponent: float = 1.1
    # the catalogue: gas and valve
    heat_conductance: float = -1.0  # W/K; below zero: constant temperature
    leak_area: float = 0.0
    laminar_conductance: float = 0.0  # kg/(s Pa)
    relief_growth: float = 0.0  # m^2/Pa, by which a leak opens where chamber 1 is above relief_pressure
    relief_pressure: float = 0.0  # Pa, gauge
    piston_leak_area: float = 0.0
    dead_volume_added: float = 0.0
    supply_volume: float = 0.0  # zero: a stiff supply
    regulator_conductance: float = 0.0
    line_delay: float = 0.0
    hose_bore: float = 0.0  # m, of each hose, whose length is that of line_delay; 0: it only delays the flow
    valve_lag: float = 0.0
    opening_time: float = 0.0  # s, of a switching valve: from its command until it opens
    closing_time: float = 0.0
    valve_half_width: float = 0.0
    valve_leak_area: float = 0.0
    critical_ratio: float = 0.528
    # the same on the side of chamber 2
    leak_area_2: float = 0.0
    laminar_conductance_2: float = 0.0
    relief_growth_2: float = 0.0
    relief_pressure_2: float = 0.0
    dead_volume_added_2: float = 0.0
    line_delay_1: float = 0.0  # of one hose alone, in addition to both
    line_delay_2: float = 0.0
    # the catalogue: friction and forces
    static: float = 0.0  # N; not above coulomb: no Stribeck rise
    stribeck_velocity: float = 0.01
    drop: float = -1.0  # of dry friction while slowing; below zero: both branches are one
    viscous_drop: float = 0.0  # of viscous friction while slowing, where there are two branches
    bristle_stiffness: float = 0.0  # zero: rigid contact
    bristle_damping: float = 0.0
    asymmetry: float = 0.0
    viscous_asymmetry: float = 0.0
    pressure_gain: float = 0.0  # 1/Pa
    position_from: float = 0.0
    position_to: float = 0.0
    position_gain: float = 0.0
    constant_force: float = 0.0  # positive toward x = 0
    spring_stiffness: float = 0.0
    spring_rest: float = 0.0
    extra_mass: float = 0.0
    cushion_length: float = 0.0
    cushion_damping: float = 0.0
    dwell_gain: float = 0.0
    dwell_time: float = 1.0
    # the catalogue: sensors
    pressure_offset: float = 0.0
    pressure_scale: float = 1.0
    pressure_lag: float = 0.0
    acceleration_bias: float = 0.0
    pressure_skew: float = 0.0
    force_skew: float = 0.0  # s by which the force is recorded later than all else
    pressure_offset_2: float = 0.0
    pressure_scale_1: float = 1.0  # of one sensor alone, in addition to both
    pressure_scale_2: float = 1.0
    # outside the catalogue
    running_in: float = 0.0  # share of the dry friction lost over the first seconds
    warming: float = 0.0  # share of the viscous friction lost while warming up
    pitch_force: float = 0.0  # N, periodic over position
    pitch: float = 0.02
    quadratic_drag: float = 0.0  # N s^2/m^2
    load_mass: float = 0.0  # kg, behind a spring, a damper and a gap
    load_stiffness: float = 0.0
    load_damping: float = 0.0
    load_gap: float = 0.0
    swinging_force: float = 0.0  # N, periodic in time
    swinging_frequency: float = 1.0
    ripple: float = 0.0  # Pa, of the supply at the valve; its sensor does not see it
    ripple_frequency: float = 7.0
    gain_drift: float = 0.0  # 1/s, of the valve's area
    spool_stiction: float = 0.0  # V by which the command must change before the spool follows, in a jump
    silencer: float = 0.0  # s/kg: a clogged silencer divides the exhaust flow by 1 + silencer times the flow
    pressure_curvature: float = 0.0  # 1/Pa, of the sensor of p1
    bent_guide: float = 0.0  # share by which dry friction grows over the stroke
    sluggish_opening: float = 0.0  # s, of a spool that opens slowly and shuts at once
    position_curvature: float = 0.0  # 1/m, of the sensor of x, which is exact at both ends
    # arrangement
    arrangement: float = ONE_CHAMBER
    command_null: float = 0.0  # V, at which the valve is in its middle
    command_range: float = 10.0  # V from the null, at which the valve is fully open
    command_sign: float = 1.0  # -1: a command below the null fills chamber 1
    switching: float = 0.0  # 1: an edge is shut, or beyond half the range fully open
    effective_area_2: float = 0.0  # of the edges to chamber 2
    overlap_2: float = 0.0
    exponent_2: float = 1.1
    # walls: their area follows the piston
    wall_coefficient: float = 0.0  # W/(m^2 K), of convection; 0: heat_conductance holds
    # instead of a valve whose command sets an area
    regulated_span: float = 0.0  # Pa, gauge at the full command of a valve with a pressure loop; 0: no loop
    regulated_band: float = 1e4  # Pa, the error of its loop at which it opens fully
    pump_flow: float = 0.0  # kg/s, of a pump at the full command against ambient pressure; 0: no pump
    pump_clearance: float = 1.0 / 6e5  # 1/Pa, share of its flow that a pump loses to the pressure
    pump_slip: float = 0.0  # kg/(s Pa), lost at any speed
    # the ends of the stroke: springs with dampers that push and never pull
    stop_stiffness: float = 5e6  # N/m
    stop_damping: float = 3e3  # N s/m; small: the piston bounces
