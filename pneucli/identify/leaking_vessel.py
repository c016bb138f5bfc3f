"""Mass and temperature of the gas in a shut vessel that leaks, relative to a reference state at the wall's temperature.

Compiled functions have no annotations: numba knows their types. Source: balances of mass and energy of an open system;
natural convection after W. H. McAdams, Heat Transmission, McGraw-Hill 1954.
"""
# mypy: disable-error-code="no-untyped-def, no-untyped-call"

import math

import numpy as np

from pneucli.caches import compiled

SHORTEST = 0.25  # of the time constants, that one step is long at most
MAX_STEPS = 200  # in a sample


@compiled()
def leak_share(p, ambient, laminar):
    """Return the flow relative to that at p = 1, where ``p^2 - ambient^2 = a q + b q^2``; negative into the vessel.

    ``laminar`` is the part of ``a q`` in the drop at p = 1; pressures are relative to the reference pressure.
    """
    drop = (p * p - ambient * ambient) / (1.0 - ambient * ambient)
    size = abs(drop)
    if size < 1e-15:
        return 0.0
    return 2.0 * drop / (laminar + math.sqrt(laminar * laminar + 4.0 * (1.0 - laminar) * size))


@compiled()
def gas_rates(mass, heat, wall, ambient, laminar, loss, settling, by_density, by_difference, kappa):
    """Return the rates of relative mass and temperature of the gas in 1/s.

    ``mass``, ``heat`` (temperature) and ``wall`` (its temperature) are relative to the reference; ``ambient`` and
    ``laminar`` are those of :func:`leak_share`, ``kappa`` is the ratio of heat capacities.
    ``loss`` is the rate of mass in 1/s at p = 1, ``settling`` the time constant in s with which the gas comes to the
    wall's temperature there, at a difference of 5 K; ``by_density`` and ``by_difference`` are the powers with which the
    coefficient of heat transfer grows (0 and 0: a constant; 2/3 and 1/3: natural convection).
    """
    flow = loss * leak_share(mass * heat, ambient, laminar)
    apart = wall - heat
    warming = apart * (abs(apart) * 58.63 + 0.02) ** by_difference * mass ** (by_density - 1.0) / settling
    if ambient < 1.0:
        return -flow, warming - (kappa - 1.0) * flow / mass * heat
    return -flow, warming - flow / mass * (kappa - heat)


@compiled()
def vessel_pressure(time, start, warmed, drift, ambient, laminar, loss, settling, by_density, by_difference, kappa):
    """Return the pressure relative to the reference, shape of ``time``, with Runge-Kutta steps of third order.

    ``start`` is the first pressure, ``warmed`` the first temperature over the wall's, ``drift`` what the wall's becomes
    warmer until the last time; ``time`` is in s, shape (n,). ``ambient``, ``laminar``, ``loss``,
    ``settling``, ``by_density``, ``by_difference`` and ``kappa`` are those of :func:`gas_rates`.
    """
    n = time.size
    law = ambient, laminar, loss, settling, by_density, by_difference, kappa
    pressure = np.empty(n)
    heat = 1.0 + warmed
    mass = start / heat
    pressure[0] = start
    for k in range(1, n):
        span = time[k] - time[k - 1]
        wall = 1.0 + drift * (time[k] - time[0]) / (time[n - 1] - time[0])
        fastest = 2.0 / settling + 2.0 * abs(loss) / max(mass, 1e-3)
        steps = min(max(math.ceil(span * fastest / SHORTEST / 2.0), 1), MAX_STEPS)
        h = span / steps
        for _ in range(steps):
            m1, t1 = gas_rates(mass, heat, wall, *law)
            m2, t2 = gas_rates(max(mass + 0.5 * h * m1, 1e-6), heat + 0.5 * h * t1, wall, *law)
            m3, t3 = gas_rates(max(mass + 0.75 * h * m2, 1e-6), heat + 0.75 * h * t2, wall, *law)
            mass = max(mass + h * (2.0 * m1 + 3.0 * m2 + 4.0 * m3) / 9.0, 1e-6)
            heat = min(max(heat + h * (2.0 * t1 + 3.0 * t2 + 4.0 * t3) / 9.0, 0.3), 3.0)
        pressure[k] = mass * heat
    return pressure
