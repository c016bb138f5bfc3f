"""A chamber's balances of mass and energy."""

import numpy as np

from pneucli.physics.gas import flow_constant
from pneucli.simulate.kernel.ports import (
    command,
    critical_ratio,
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


def pressure_rate(p, T, volume, growth, q_in, q_out, heat_flow, base):
    """dp/dt in Pa/s by the energy balance; at constant T and without heat the isentropic chamber (2.14, 2.22).

    The exponent is that of the gas, kappa, or less where heat that is not simulated flows: 1 is the isothermal chamber.
    """
    gamma = base[EXPONENT]
    enthalpy = base[GAS] * (base[TEMP] * q_in - T * q_out)
    return (gamma * (enthalpy - p * growth) + (gamma - 1.0) * heat_flow) / volume


def chamber_step(p, p_mid, mass, h, volume, growth, q_in, q_out, hot, base, th, on):
    """Advance one chamber by h; returns p, dp/dt, gas mass, gas temperature (constant in the base model).

    Heat to the wall is implicit in the pressure (at the midpoint), so that it may settle within a step.
    """
    T, warm, drag, flow = base[TEMP], 0.0, 0.0, q_in - q_out
    if hot:
        slope = volume / (base[GAS] * max(mass + 0.5 * h * flow, 1e-9))  # of the temperature over the pressure
        T = p_mid * slope
        fading = 0.5 * slope * (heat(T - 1.0, base[WALL], th, on) - heat(T + 1.0, base[WALL], th, on))
        warm = heat(T, base[WALL], th, on) + fading * (p_mid - p)
        drag = 0.5 * h * (base[GAMMA] - 1.0) * fading / volume
    rate = pressure_rate(p_mid, T, volume, growth, q_in, q_out, warm, base) / (1.0 + drag)
    return max(p + h * rate, 1.0), rate, max(mass + h * flow, 1e-9), T


def run_gradient(u, p, p_supply, base_values, th_values, on_values, u_max, areas, out):
    """Write the gradient of chamber 1 in Pa/s as its sensor reads it, shape (n,), at held commands and a fixed volume.

    u (n,) in V, readings p (n,) and p_supply (n,) in Pa, the gas at its usual temperature. Nothing that has a memory
    takes part: the spool has settled, a play is centred, no heat has been exchanged, what flows arrives at once.
    """
    base, th, on = scalars(base_values, th_values, on_values)
    p_amb, volume = base[AMBIENT], base[DEAD_1] + volume_1(th, on)
    k_gas = flow_constant(base[GAS], base[TEMP], base[GAMMA])
    b, leak = critical_ratio(base[CRITICAL], th, on), leak_area(th, on)
    spool = np.zeros(on_values.size)
    for i in range(u.size):
        spool[:] = u[i]
        true = unread_p1(p[i], p_amb, th, on)
        opening = command(u[i], 1.0, spool, th, on)
        q_in, q_out = valve_flow(opening, true, p_supply[i], p_amb, b, leak, k_gas, k_gas, u_max, areas)
        q_out += leak_1_ambient(true, p_amb, k_gas, th, on)
        sensed = 0.5 * (read_p1(true + 1.0, p_amb, th, on) - read_p1(true - 1.0, p_amb, th, on))
        out[i] = sensed * pressure_rate(true, base[TEMP], volume, 0.0, q_in, q_out, 0.0, base)
