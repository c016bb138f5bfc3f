"""Flow through the valve."""

import math

from pneucli.physics.gas import PSI_MAX, orifice_flow
from pneucli.simulate.kernel.ports import filling


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
