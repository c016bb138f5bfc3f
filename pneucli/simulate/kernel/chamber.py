"""Balances of mass and energy of a chamber."""

import numpy as np

from pneucli.physics.gas import flow_constant
from pneucli.simulate.kernel.ports import (
    command,
    critical_ratio,
    demand,
    heat,
    leak_1_ambient,
    leak_area,
    read_p1,
    scalars,
    unread_p1,
    volume_1,
)
from pneucli.simulate.kernel.valve import valve_flow
from pneucli.simulate.layout import AMBIENT, CRITICAL, DEAD_1, EXPONENT, GAMMA, GAS, TEMP, WALL

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
