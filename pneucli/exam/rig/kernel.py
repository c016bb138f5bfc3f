"""The rig's own equations and integrator, compiled; it shares no code with the simulator that it examines.

A step of at most ``MAX_STEP`` holds the valve's area, applies the midpoint rule to gas and motion with fixed sign of
the friction, and ends early where the piston comes to rest. Sticking is exact, until the net force exceeds the
break-away level.
"""

import math

import numpy as np

from pneucli.arrays import Array
from pneucli.caches import compiled, part
from pneucli.exam.rig.gas import (
    GAS_CONSTANT,
    KAPPA,
    LEAK_RATIO,
    chamber_rates,
    hose_volume,
    leaks_1,
    leaks_2,
    orifice_flow,
    wall_conductance,
)
from pneucli.exam.rig.parameters import Parameters

Flows = tuple[float, float, float, float]  # kg/s: into and out of chamber 1, into and out of chamber 2

MAX_STEP = 25e-6  # s, the longest
# state: position, velocity, pressure and temperature of both chambers, supply, bristle, load's position and velocity
X, V, P1, T1, P2, T2, PS, Z, XL, VL = range(10)
DRIFT_TIME_CONSTANT = 1.5  # s, of drifting disturbances


@part()
def _edge_area(par: Parameters, opening: float, full: float, overlap: float, exponent: float, t: float) -> float:
    if par.switching > 0.0:
        return math.copysign(full, opening) if abs(opening) > 0.5 * par.command_range else 0.0
    beyond = abs(opening) - overlap
    if beyond <= 0.0:
        return 0.0
    area = full * (beyond / (par.command_range - overlap)) ** exponent * (1.0 + par.gain_drift * t)
    return math.copysign(area, opening)


@compiled()
def valve_area(par: Parameters, opening: float, t: float) -> float:
    """Effective area in m^2 of the edges to chamber 1, positive toward the supply, negative toward the exhaust."""
    return _edge_area(par, opening, par.effective_area, par.overlap, par.exponent, t)


@part()
def valve_area_2(par: Parameters, opening: float, t: float) -> float:
    """Effective area in m^2 of the edges to chamber 2, signed alike."""
    return _edge_area(par, opening, par.effective_area_2, par.overlap_2, par.exponent_2, t)


@compiled()
def valve_flow(par: Parameters, area: float, t: float, s: Array, chamber: int = 0) -> tuple[float, float]:
    """Mass flows in kg/s (supply to chamber, chamber to exhaust); neither reverses. ``chamber``: 0 or 1."""
    open_in, open_out = max(area, 0.0) + par.valve_leak_area, max(-area, 0.0) + par.valve_leak_area
    supply = s[PS] + par.ripple * math.sin(2.0 * math.pi * par.ripple_frequency * t)
    p, temperature = s[P1 + 2 * chamber], s[T1 + 2 * chamber]
    if par.supply < par.ambient:  # an ejector draws, and ambient air fills
        q_out = orifice_flow(open_in, p, temperature, supply, par.critical_ratio)
        return orifice_flow(open_out, par.ambient, par.temperature, p, par.critical_ratio), q_out
    q_in = orifice_flow(open_in, supply, par.temperature, p, par.critical_ratio)
    q_out = orifice_flow(open_out, p, temperature, par.ambient, par.critical_ratio)
    return q_in, q_out / (1.0 + par.silencer * q_out)


@part()
def gas_rates(par: Parameters, s: Array, q: Flows, held: int, ds: Array) -> None:
    """Rates of the gas and the supply; ``held``: 1 keeps chamber 2 at its pressure, 2 keeps both."""
    if held == 2:
        return
    wall = par.temperature
    drawn, lost = leaks_1(par, s[P1], s[T1])
    over = orifice_flow(par.piston_leak_area, s[P1], s[T1], s[P2], LEAK_RATIO)
    back = orifice_flow(par.piston_leak_area, s[P2], s[T2], s[P1], LEAK_RATIO)
    gained, given = q[0] + drawn, q[1] + lost
    dead_1, dead_2 = par.dead_volume_1 - hose_volume(par, 0), par.dead_volume_2 - hose_volume(par, 1)
    volume_1 = dead_1 + par.dead_volume_added + par.piston_area_1 * s[X]
    heat_1 = gained * wall + back * s[T2] - (given + over) * s[T1]
    mass_1, walls_1 = gained - given + back - over, wall_conductance(par, par.piston_area_1, volume_1)
    ds[P1], ds[T1] = chamber_rates(par, s[P1], s[T1], volume_1, par.piston_area_1 * s[V], mass_1, heat_1, walls_1)
    if held == 0:
        drawn, lost = leaks_2(par, s[P2], s[T2])
        gained, given = q[2] + drawn, q[3] + lost
        volume_2 = dead_2 + par.dead_volume_added_2 + par.piston_area_2 * (par.stroke - s[X])
        heat_2 = gained * wall + over * s[T1] - (given + back) * s[T2]
        mass_2, walls_2 = gained - given + over - back, wall_conductance(par, par.piston_area_2, volume_2)
        ds[P2], ds[T2] = chamber_rates(par, s[P2], s[T2], volume_2, -par.piston_area_2 * s[V], mass_2, heat_2, walls_2)
    if par.supply_volume > 0.0:
        feed = par.regulator_conductance * (par.supply - s[PS])
        drawn = -q[1] if par.supply < par.ambient else q[0] + q[2]
        feed = feed if par.supply < par.ambient else max(feed, 0.0)
        ds[PS] = KAPPA * GAS_CONSTANT * wall * (feed - drawn) / par.supply_volume


@part()
def viscous_coefficient(par: Parameters, t: float, v: float) -> float:
    """Viscous friction in N s/m while speeding up."""
    slope = par.viscous * (1.0 + par.viscous_asymmetry * np.sign(v))
    return float(slope * (1.0 - par.warming * (1.0 - math.exp(-t / DRIFT_TIME_CONSTANT))))


@part()
def dry_friction(par: Parameters, t: float, s: Array, direction: float) -> tuple[float, float]:
    """Dry friction in N while speeding up, and while slowing, less what viscous friction then loses."""
    factor = 1.0 + par.pressure_gain * (s[P1] + s[P2] - 2.0 * par.ambient)
    if par.position_from <= s[X] <= par.position_to:
        factor *= 1.0 + par.position_gain
    factor *= 1.0 + par.bent_guide * s[X] / par.stroke
    factor *= (1.0 + par.asymmetry * direction) * (1.0 - par.running_in * (1.0 - math.exp(-t / DRIFT_TIME_CONSTANT)))
    rise = max(par.static - par.coulomb, 0.0) / (1.0 + (s[V] / par.stribeck_velocity) ** 2)
    rising = factor * (par.coulomb + rise)
    if par.drop < 0.0:
        return rising, rising
    lost = par.viscous_drop * viscous_coefficient(par, t, s[V]) * abs(s[V])
    return rising, min(factor * par.coulomb * (1.0 - par.drop) - lost, rising)


@part()
def coupling_force(par: Parameters, s: Array) -> float:
    """Force in N of a flexibly coupled load on the piston."""
    stretch = s[XL] - s[X]
    taken = math.copysign(max(abs(stretch) - 0.5 * par.load_gap, 0.0), stretch)
    return par.load_stiffness * taken + (par.load_damping * (s[VL] - s[V]) if taken != 0.0 else 0.0)


@compiled()
def end_stop_force(par: Parameters, x: float, v: float) -> float:
    """Force in N of the ends on the piston; an end pushes the piston away and never pulls."""
    if x < 0.0:
        return max(-par.stop_stiffness * x - par.stop_damping * v, 0.0)
    if x > par.stroke:
        return min(-par.stop_stiffness * (x - par.stroke) - par.stop_damping * v, 0.0)
    return 0.0


@part()
def net_force(par: Parameters, t: float, s: Array) -> float:
    """All forces in N toward +x except the dry friction."""
    v = s[V]
    force = par.piston_area_1 * (s[P1] - par.ambient) - par.piston_area_2 * (s[P2] - par.ambient)
    force -= par.constant_force + par.spring_stiffness * (s[X] - par.spring_rest)
    force -= par.pitch_force * math.sin(2.0 * math.pi * s[X] / par.pitch)
    force -= par.swinging_force * math.sin(2.0 * math.pi * par.swinging_frequency * t)
    force += end_stop_force(par, s[X], v)
    if par.load_mass > 0.0:
        force += coupling_force(par, s)
    slope = viscous_coefficient(par, t, v)
    room = max(s[X] if v < 0.0 else par.stroke - s[X], 0.0)
    if room < par.cushion_length:
        slope += par.cushion_damping * (1.0 - room / par.cushion_length)
    return float(force - slope * v - par.quadratic_drag * v * abs(v))


@part()
def acceleration(par: Parameters, t: float, s: Array, mode: float, ds: Array) -> float:
    """Acceleration in m/s^2; ``mode`` is the sign of motion, 0 while stuck. Sets the bristle's rate."""
    force, mass = net_force(par, t, s), par.mass + par.extra_mass
    if par.bristle_stiffness > 0.0:
        level = dry_friction(par, t, s, np.sign(s[V]))[0]
        ds[Z] = s[V] - par.bristle_stiffness * abs(s[V]) * s[Z] / level
        return float(force - par.bristle_stiffness * s[Z] - par.bristle_damping * ds[Z]) / mass
    if mode == 0.0:
        return 0.0
    rising, slowing = dry_friction(par, t, s, mode)
    along = force * mode
    return mode * (max(along - rising, 0.0) + min(along - slowing, 0.0)) / mass


@part()
def state_rates(par: Parameters, t: float, s: Array, mode: float, q: Flows, held: int, ds: Array) -> None:
    """Time derivative of the whole state."""
    gas_rates(par, s, q, held, ds)
    if par.piston_area_1 > 0.0:
        ds[X], ds[V] = s[V], acceleration(par, t, s, mode, ds)
    if par.load_mass > 0.0:
        ds[XL], ds[VL] = s[VL], -coupling_force(par, s) / par.load_mass


@part()
def motion_sign(par: Parameters, t: float, s: Array, rest: float) -> float:
    """Sign of the motion that begins or continues; 0 while the piston sticks."""
    if s[V] != 0.0:
        return float(np.sign(s[V]))
    force = net_force(par, t, s)
    direction = float(np.sign(force))
    grown = 1.0 + par.dwell_gain * (1.0 - math.exp(-rest / par.dwell_time))
    return direction if abs(force) > dry_friction(par, t, s, direction)[0] * grown else 0.0
