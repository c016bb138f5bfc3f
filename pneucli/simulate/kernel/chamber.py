"""Balances of mass and energy of a chamber, and the flow through the valve."""

import math

import numpy as np

from pneucli.physics.gas import PSI_MAX, flow_constant, orifice_flow
from pneucli.simulate.kernel.ports import (
    command,
    critical_ratio,
    demand,
    filling,
    heat,
    leak_1_ambient,
    leak_area,
    read_p1,
    scalars,
    unread_p1,
    volume_1,
)
from pneucli.simulate.layout import *


def effective_area(u, u_max, areas):
    """Return the effective area at an opening, linear between the points of a table.

    Args:
        u: Opening in V.
        u_max: Largest opening in V.
        areas: Areas in m^2 over openings of -u_max..u_max, shape (k,).

    Returns:
        Area in m^2; beyond the table that of its end.

    >>> import numpy as np
    >>> float(effective_area(5.0, 10.0, np.array([2e-6, 0.0, 1e-6])))
    5e-07
    """
    last: int = areas.size - 1
    place = (u + u_max) * (last / (2.0 * u_max))
    if place <= 0.0:
        return areas[0]
    if place >= last:
        return areas[last]
    i: int = math.floor(place)
    return areas[i] + (place - i) * (areas[i + 1] - areas[i])


def table_place(u, u_max, size: int):
    """Return between which points of a table of areas an opening lies: the lower one, and the share of the way on.

    Args:
        u: Opening in V.
        u_max: Largest opening in V.
        size: Number of points over openings of -u_max..u_max.

    >>> table_place(5.0, 10.0, 3), table_place(12.0, 10.0, 3)
    ((1, 0.5), (1, 1.0))
    """
    last: int = size - 1
    place = min(max((u + u_max) * (last / (2.0 * u_max)), 0.0), float(last))
    i: int = min(math.floor(place), last - 1)
    return i, place - i


def valve_flow(opening, p, p_s, p_amb, b, leak, k, k_gas, u_max, areas, th, on, share=1.0):
    """Return the flows of a valve from supply to outlet and from outlet to exhaust.

    Args:
        opening: Opening in V, positive toward filling.
        p: Pressure at the outlet in Pa.
        p_s: Supply pressure in Pa.
        p_amb: Ambient pressure in Pa.
        b: Critical ratio.
        leak: Area in m^2 that is always open in both paths.
        k: Flow constant of the chamber's gas in s/m.
        k_gas: Flow constant of the supply's gas in s/m.
        u_max: Largest opening in V.
        areas: Areas in m^2 over openings of -u_max..u_max.
        th: Parameters of effects.
        on: Switches of effects.
        share: Share of that area: of a switching valve that is open for a part of the step.

    Returns:
        Both mass flows in kg/s.

    References:
        Thesis 2.46.
    """
    area = share * effective_area(opening, u_max, areas)
    fill = leak
    vent = leak
    if opening > 0.0:
        fill += area
    else:
        vent += area
    q_in = 0.0
    q_out = 0.0
    if fill > 0.0:
        q_in = filling(fill * orifice_flow(p_s, p, b, k_gas, k), fill * p_s * k_gas * PSI_MAX, p, p_amb, th, on)
    if vent > 0.0:
        q_out = vent * orifice_flow(p, p_amb, b, k, k_gas)
    return q_in, q_out


COLDEST = 0.2  # of the surroundings' temperature: isentropic expansion from 280 bar; a wrong model empties a chamber
HOTTEST = 5.0  # of the same, the inverse


def pressure_rate(p, T, volume, growth, q_in, q_out, heat_flow, base):
    """Return the pressure gradient of a chamber from the energy balance.

    At constant temperature and without heat it is the isentropic chamber. The exponent is that of the gas, or less
    where heat flows that is not simulated; 1 is the isothermal chamber.

    Args:
        p: Pressure in Pa.
        T: Gas temperature in K.
        volume: Volume in m^3.
        growth: Growth of the volume in m^3/s.
        q_in: Mass flow in, in kg/s.
        q_out: Mass flow out, in kg/s.
        heat_flow: Heat flow into the gas in W.
        base: Base parameters.

    Returns:
        dp/dt in Pa/s.

    References:
        Thesis 2.14, 2.22.
    """
    gamma = base[EXPONENT]
    enthalpy = base[GAS] * (base[TEMP] * q_in - T * q_out)
    return (gamma * (enthalpy - p * growth) + (gamma - 1.0) * heat_flow) / volume


def chamber_step(p, p_mid, mass, h, volume, growth, q_in, q_out, hot, base, th, on):
    """Advance one chamber by a step.

    Heat to the wall is implicit in the pressure at the midpoint, so that it may settle within a step.

    Args:
        p: Pressure in Pa.
        p_mid: Pressure at the midpoint in Pa.
        mass: Mass of the gas in kg.
        h: Step in s.
        volume: Volume at the midpoint in m^3.
        growth: Growth of the volume in m^3/s.
        q_in: Mass flow in, in kg/s.
        q_out: Mass flow out, in kg/s.
        hot: Whether heat is simulated.
        base: Base parameters.
        th: Parameters of effects.
        on: Switches of effects.

    Returns:
        Pressure in Pa, its gradient in Pa/s, mass in kg, temperature in K (constant in the base model).
    """
    T, warm, inertia, flow = base[TEMP], 0.0, volume, q_in - q_out
    if hot:
        slope = volume / (base[GAS] * max(mass + 0.5 * h * flow, 1e-9))  # of the temperature over the pressure
        T = min(max(p_mid * slope, COLDEST * base[TEMP]), HOTTEST * base[TEMP])
        fading = 0.5 * slope * (heat(T - 1.0, base[WALL], th, on) - heat(T + 1.0, base[WALL], th, on))
        warm = heat(T, base[WALL], th, on) + fading * (p_mid - p)
        inertia += 0.5 * h * (base[GAMMA] - 1.0) * fading
    rate = pressure_rate(p_mid, T, inertia, growth, q_in, q_out, warm, base)
    return max(p + h * rate, 1.0), rate, max(mass + h * flow, 1e-9), T


def run_gradient(u, p, p_supply, base_values, th_values, on_values, u_max, areas, out):
    """Write the pressure gradient of chamber 1 at held commands and a fixed volume, as its sensor reads it.

    Nothing with a memory takes part: the spool has settled, a play is centred, no heat flows, flow arrives at once.

    Args:
        u: Command in V, shape (n,).
        p: Reading of the pressure in Pa, shape (n,).
        p_supply: Reading of the supply pressure in Pa, shape (n,).
        base_values: Base parameters, shape (19,).
        th_values: Parameters of effects.
        on_values: Switches of effects.
        u_max: Largest opening in V.
        areas: Areas in m^2 over openings of -u_max..u_max.
        out: Filled with the gradient in Pa/s, shape (n,).
    """
    base, th, on = scalars(base_values, th_values, on_values)
    p_amb, volume = base[AMBIENT], base[DEAD_1] + volume_1(th, on)
    k_gas = flow_constant(base[GAS], base[TEMP], base[GAMMA])
    b, leak = critical_ratio(base[CRITICAL], th, on), leak_area(th, on)
    spool = np.zeros(2 * on_values.size)
    for i in range(u.size):
        true = unread_p1(p[i], p_amb, th, on)
        asked = demand(u[i], true, p_amb, th, on)
        spool[:] = asked
        opening = command(asked, 1.0, spool, th, on)
        q_in, q_out = valve_flow(opening, true, p_supply[i], p_amb, b, leak, k_gas, k_gas, u_max, areas, th, on)
        q_out += leak_1_ambient(true, p_amb, k_gas, th, on)
        sensed = 0.5 * (read_p1(true + 1.0, p_amb, th, on) - read_p1(true - 1.0, p_amb, th, on))
        out[i] = sensed * pressure_rate(true, base[TEMP], volume, 0.0, q_in, q_out, 0.0, base)
