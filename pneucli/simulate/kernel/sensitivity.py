"""Sensitivity equations: derivatives of the simulated pressures by parameters of the valves' areas.

Such a parameter enters at the flow of a valve alone. What follows from the flow is linear to first order and the same
for all of them, so one simulation carries the derivatives by all of them along, where differences need a simulation
for each.
"""

from pneucli.simulate.kernel.hose import hose_step
from pneucli.simulate.kernel.ports import heat, leak_1_2, leak_1_ambient, leak_2_ambient
from pneucli.simulate.kernel.valve import table_place, unit_flow, valve_flow
from pneucli.simulate.layout import (
    AMBIENT,
    D_END,
    D_IN,
    D_MASS,
    D_OUT,
    D_P,
    D_RATE,
    D_T,
    D_THROUGH,
    EXPONENT,
    GAMMA,
    GAS,
    OPEN,
    TEMP,
    WALL,
)

PRESSURE_STEP = 10.0  # Pa, for differences: less would meet the vertical slope of the flow at equal pressures
FLOW_STEP = 1e-7  # kg/s, for differences of a hose: a hundred-thousandth of what a valve passes


def restart_sensitivities(d_1, d_2, start, k: int, p1, p2, m1, m2, T1, T2):
    """Set the derivatives of both chambers at a restart.

    Args:
        d_1: Derivatives of chamber 1 by state, shape (states, columns), changed in place.
        d_2: Those of chamber 2.
        start: Derivatives of the pressures at the restarts, shape (n, 2, columns); without samples they are 0.
        k: Sample of the restart.
        p1: Pressure of chamber 1 in Pa.
        p2: The same of chamber 2.
        m1: Mass of the gas of chamber 1 in kg.
        m2: The same of chamber 2.
        T1: Temperature of the gas of chamber 1 in K.
        T2: The same of chamber 2.
    """
    for chamber in range(2):
        d, p, mass, T = (d_1, p1, m1, T1) if chamber == 0 else (d_2, p2, m2, T2)
        for j in range(d.shape[1]):
            at_start = start[k, chamber, j] if start.shape[0] > 0 else 0.0
            d[D_END, j] += at_start - d[D_P, j]
            d[D_P, j] = at_start
            d[D_RATE, j] = 0.0
            d[D_MASS, j] = mass * (at_start / p - d[D_T, j] / T)


def pressure_sensitivities(d_1, d_2, k: int, derivatives):
    """Write the derivatives of both pressures at sample k to ``derivatives`` (n, 2, columns)."""
    for j in range(d_1.shape[1]):
        derivatives[k, 0, j], derivatives[k, 1, j] = d_1[D_P, j], d_2[D_P, j]


def clear_sensitivities(d_1, d_2):
    """Set the derivatives of the flows of both valves to 0: a shut one has none."""
    for j in range(d_1.shape[1]):
        d_1[D_IN, j] = d_1[D_OUT, j] = d_2[D_IN, j] = d_2[D_OUT, j] = 0.0


def valve_sensitivities(
    d, q_in, q_out, opening, outlet, at_hose, h, T, p_line, p_amb, b, leak, k, k_gas, u_max, areas, shapes
):  # fmt: skip
    """Write the derivatives of the flows of a valve.

    Args:
        d: Derivatives of the chamber by state, shape (states, columns), changed in place.
        q_in: Mass flow from supply to outlet in kg/s.
        q_out: Mass flow from outlet to exhaust in kg/s.
        opening: Opening in V.
        outlet: Pressure at the outlet in Pa.
        at_hose: Whether that is the end of a hose with a bore; else it is the chamber's at the midpoint.
        h: Step in s.
        T: Temperature of the gas in the last step in K, which gave ``k``.
        p_line: Supply pressure at the valve in Pa.
        p_amb: Ambient pressure in Pa.
        b: Critical ratio.
        leak: Area in m^2 that is always open in both paths.
        k: Flow constant of the chamber's gas in s/m.
        k_gas: Flow constant of the supply's gas in s/m.
        u_max: Largest opening in V.
        areas: Areas in m^2 over openings of -u_max..u_max.
        shapes: Their derivatives, shape (areas, columns).
    """
    above = outlet + PRESSURE_STEP
    more_in, more_out = valve_flow(opening, above, p_line, p_amb, b, leak, k, k_gas, u_max, areas)
    in_slope, out_slope = (more_in - q_in) / PRESSURE_STEP, (more_out - q_out) / PRESSURE_STEP
    fill, vent = unit_flow(opening, outlet, p_line, p_amb, b, k, k_gas)
    in_T, out_T = -0.5 * min(q_in, 0.0) / T, -0.5 * max(q_out, 0.0) / T  # the gas of the chamber leaves
    i, w = table_place(opening, u_max, areas.size)
    for j in range(d.shape[1]):
        area = shapes[i, j] + w * (shapes[i + 1, j] - shapes[i, j])
        p = d[D_END, j] if at_hose else d[D_P, j] + 0.5 * h * d[D_RATE, j]
        d[D_IN, j] = fill * area + in_slope * p + in_T * d[D_T, j]
        d[D_OUT, j] = vent * area + out_slope * p + out_T * d[D_T, j]


def delay_sensitivities(d_1, d_2, passed, ring, head: int, tail: int, tail_2: int, t, delay_1, delay_2):
    """Replace the derivatives of the flows of the valves by those of the delayed flows.

    Args:
        d_1: Derivatives of chamber 1 by state, shape (states, columns), changed in place.
        d_2: Those of chamber 2.
        passed: Derivatives of the four flows in the entries of the ring, shape (k, 4, columns), changed in place.
        ring: Ring buffer of (time, in, out, in 2, out 2), shape (k, 5).
        head: The entry that was written last.
        tail: Newest entry of chamber 1 not after the delayed time.
        tail_2: The same of chamber 2.
        t: Time in s.
        delay_1: Delay of the hose of chamber 1 in s.
        delay_2: Delay of the hose of chamber 2 in s.
    """
    for row in range(4):
        d, flow = d_1 if row < 2 else d_2, D_IN + row % 2
        for j in range(d.shape[1]):  # what flows back is cut off
            passed[head, row, j] = d[flow, j] if ring[head, 1 + row] > 0.0 else 0.0
    for row in range(4):
        d, flow = d_1 if row < 2 else d_2, D_IN + row % 2
        delay, before = (delay_1, tail) if row < 2 else (delay_2, tail_2)
        if delay <= 0.0:
            continue
        after: int = before + 1 if before + 1 < ring.shape[0] else 0
        started = 0.0 if ring[before, 0] < -1e29 else 1.0
        w = (t - delay - ring[before, 0]) / (ring[after, 0] - ring[before, 0])
        for j in range(d.shape[1]):
            change = w * (passed[after, row, j] - passed[before, row, j])
            d[flow, j] = started * (passed[before, row, j] + change)


def hose_sensitivities(d, p_valve, q, p, q_valve, h, delay, bore, base):
    """Advance the derivatives of a hose with a bore by a step; the arguments are those of its step before it."""
    end, flow, _, _ = hose_step(p_valve, q, p, q_valve, h, delay, bore, base)
    end_1, flow_1, _, _ = hose_step(p_valve + PRESSURE_STEP, q, p, q_valve, h, delay, bore, base)
    end_2, flow_2, _, _ = hose_step(p_valve, q + FLOW_STEP, p, q_valve, h, delay, bore, base)
    end_3, flow_3, _, _ = hose_step(p_valve, q, p + PRESSURE_STEP, q_valve, h, delay, bore, base)
    end_4, _, _, _ = hose_step(p_valve, q, p, q_valve + FLOW_STEP, h, delay, bore, base)
    end_by_end, flow_by_end = (end_1 - end) / PRESSURE_STEP, (flow_1 - flow) / PRESSURE_STEP
    end_by_flow, flow_by_flow = (end_2 - end) / FLOW_STEP, (flow_2 - flow) / FLOW_STEP
    end_by_chamber, flow_by_chamber = (end_3 - end) / PRESSURE_STEP, (flow_3 - flow) / PRESSURE_STEP
    end_by_valve = (end_4 - end) / FLOW_STEP
    inward = 1.0 if flow > 0.0 else 0.0
    for j in range(d.shape[1]):
        at_end, through = d[D_END, j], d[D_THROUGH, j]
        in_chamber = d[D_P, j] + 0.5 * h * d[D_RATE, j]
        from_valve = d[D_IN, j] - d[D_OUT, j]
        d[D_END, j] = (
            end_by_end * at_end + end_by_flow * through + end_by_chamber * in_chamber + end_by_valve * from_valve
        )
        arriving = flow_by_end * at_end + flow_by_flow * through + flow_by_chamber * in_chamber
        d[D_THROUGH, j] = arriving
        d[D_IN, j], d[D_OUT, j] = inward * arriving, (inward - 1.0) * arriving


def leak_slopes(chamber_2: int, p1, p2, k1, k2, base, th, on):
    """Return the derivatives of the leaks by pressure, in kg/(s Pa).

    Args:
        chamber_2: What closes chamber 2.
        p1: Pressure of chamber 1 at the midpoint in Pa.
        p2: The same of chamber 2.
        k1: Flow constant of the gas of chamber 1 in s/m.
        k2: The same of chamber 2.
        base: Base parameters.
        th: Parameters of effects.
        on: Switches of effects.

    Returns:
        Those out of chamber 1 and out of chamber 2 by their own pressure, and those across the piston by p1 and by p2.
    """
    p_amb, above_1, above_2 = base[AMBIENT], p1 + PRESSURE_STEP, p2 + PRESSURE_STEP
    out_1 = leak_1_ambient(above_1, p_amb, k1, th, on) - leak_1_ambient(p1, p_amb, k1, th, on)
    out_2 = leak_2_ambient(above_2, p_amb, k2, th, on) - leak_2_ambient(p2, p_amb, k2, th, on)
    across = leak_1_2(p1, p2, k1, th, on)
    by_1, by_2 = leak_1_2(above_1, p2, k1, th, on) - across, leak_1_2(p1, above_2, k1, th, on) - across
    if chamber_2 == OPEN:
        by_2 = 0.0
    return out_1 / PRESSURE_STEP, out_2 / PRESSURE_STEP, by_1 / PRESSURE_STEP, by_2 / PRESSURE_STEP


def add_leaks(d_1, d_2, chamber_2: int, p1, p2, h, k1, k2, base, th, on):
    """Add the derivatives of the leaks to those of the flows; the arguments are those of :func:`leak_slopes`."""
    out_1, out_2, by_1, by_2 = leak_slopes(chamber_2, p1, p2, k1, k2, base, th, on)
    if out_1 != 0.0 or out_2 != 0.0 or by_1 != 0.0 or by_2 != 0.0:
        leak_sensitivities(d_1, d_2, h, out_1, out_2, by_1, by_2)


def leak_sensitivities(d_1, d_2, h, out_1, out_2, by_1, by_2):
    """Add the derivatives of the leaks, from their slopes, to those of the flows in a step of h s.

    The leaks' dependence on the temperature of the gas is left out.
    """
    for j in range(d_1.shape[1]):
        mid_1, mid_2 = d_1[D_P, j] + 0.5 * h * d_1[D_RATE, j], d_2[D_P, j] + 0.5 * h * d_2[D_RATE, j]
        passing = by_1 * mid_1 + by_2 * mid_2
        d_1[D_OUT, j] += out_1 * mid_1 + passing
        d_2[D_IN, j] += passing
        d_2[D_OUT, j] += out_2 * mid_2


def conduction(p, mass, volume, base, th, on):
    """Return the heat that a chamber loses more for each K that its gas is warmer, in W/K.

    Args:
        p: Pressure in Pa.
        mass: Mass of the gas in kg.
        volume: Volume in m^3.
        base: Base parameters.
        th: Parameters of effects.
        on: Switches of effects.
    """
    T = p * volume / (base[GAS] * mass)
    return 0.5 * (heat(T - 1.0, base[WALL], th, on) - heat(T + 1.0, base[WALL], th, on))


def differentiate_chamber(
    d, p, p_mid, mass, new_mass, h, volume, growth, q_in, rate, hot, base, th, on
):  # fmt: skip
    """Advance the derivatives of one chamber by a step; the arguments are those of its step, and what came out of it.

    Args:
        d: Derivatives of the chamber by state, shape (states, columns), changed in place.
        p: Pressure before the step in Pa.
        p_mid: Pressure at the midpoint in Pa.
        mass: Mass of the gas before the step in kg.
        new_mass: The same after it.
        h: Step in s.
        volume: Volume at the midpoint in m^3.
        growth: Growth of the volume in m^3/s.
        q_in: Mass flow into the chamber in kg/s.
        rate: Pressure gradient in the step in Pa/s.
        hot: Whether heat is simulated.
        base: Base parameters.
        th: Parameters of effects.
        on: Switches of effects.
    """
    flow = (new_mass - mass) / h  # with the leaks
    mass_mid = max(mass + 0.5 * h * flow, 1e-9)
    conducted = conduction(p_mid, mass_mid, volume, base, th, on) if hot else 0.0
    chamber_sensitivities(
        d, p, p_mid, mass_mid, h, volume, growth, q_in - flow, rate, hot, conducted, base
    )  # fmt: skip


def chamber_sensitivities(
    d, p, p_mid, mass, h, volume, growth, q_out, rate, hot, conducted, base
):  # fmt: skip
    """Advance the derivatives of one chamber by a step, as :func:`pneucli.simulate.kernel.chamber.chamber_step` does.

    Args:
        d: Derivatives of the chamber by state, shape (states, columns), changed in place.
        p: Pressure before the step in Pa.
        p_mid: Pressure at the midpoint in Pa.
        mass: Mass of the gas at the midpoint in kg.
        h: Step in s.
        volume: Volume at the midpoint in m^3.
        growth: Growth of the volume in m^3/s.
        q_out: Mass flow out of it in kg/s, with leaks.
        rate: Pressure gradient in the step in Pa/s.
        hot: Whether heat is simulated.
        conducted: Conduction to the wall in W/K, of :func:`conduction`.
        base: Base parameters.
    """
    gamma, gas = base[EXPONENT], base[GAS]
    if not hot:
        by_flow, by_p = gamma * gas * base[TEMP] / volume, -gamma * growth / volume
        for j in range(d.shape[1]):
            mid = d[D_P, j] + 0.5 * h * d[D_RATE, j]
            change = by_flow * (d[D_IN, j] - d[D_OUT, j]) + by_p * mid
            d[D_P, j] += h * change
            d[D_RATE, j] = change
        return
    slope = volume / (gas * mass)
    T = p_mid * slope
    fading = slope * conducted
    implicit = 0.5 * h * (base[GAMMA] - 1.0)
    inertia = volume + implicit * fading
    for j in range(d.shape[1]):
        before, d_in, d_out = d[D_P, j], d[D_IN, j], d[D_OUT, j]
        mid = before + 0.5 * h * d[D_RATE, j]
        d_slope = -slope * (d[D_MASS, j] + 0.5 * h * (d_in - d_out)) / mass
        d_T = slope * mid + p_mid * d_slope
        d_fading = conducted * d_slope
        d_warm = -conducted * d_T + fading * (mid - before) + d_fading * (p_mid - p)
        enthalpy = gas * (base[TEMP] * d_in - T * d_out - q_out * d_T)
        change = gamma * (enthalpy - growth * mid) + (gamma - 1.0) * d_warm - rate * implicit * d_fading
        change /= inertia
        d[D_P, j] = before + h * change
        d[D_RATE, j] = change
        d[D_MASS, j] += h * (d_in - d_out)
        d[D_T, j] = d_T
