"""Flow through the valve, and the line that delays it."""

from pneucli.physics.gas import orifice_flow


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
    i: int = int(place)
    return areas[i] + (place - i) * (areas[i + 1] - areas[i])


def valve_flow(opening, p, p_s, p_amb, b, leak, k, k_gas, u_max, areas):
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

    Returns:
        Both mass flows in kg/s.

    References:
        Thesis 2.46.
    """
    area = effective_area(opening, u_max, areas)
    fill = leak
    vent = leak
    if opening > 0.0:
        fill += area
    else:
        vent += area
    q_in = 0.0
    q_out = 0.0
    if fill > 0.0:
        q_in = fill * orifice_flow(p_s, p, b, k_gas, k)
    if vent > 0.0:
        q_out = vent * orifice_flow(p, p_amb, b, k, k_gas)
    return q_in, q_out


def delayed_flows(ring, tail: int, t):
    """Return the flows into and out of both chambers at an earlier time.

    Args:
        ring: Ring buffer of (time, in, out, in 2, out 2), shape (k, 5).
        tail: Newest entry not after the time of the last call.
        t: Time in s; it must not decrease, nor reach the newest entry.

    Returns:
        Four mass flows in kg/s, 0 before the first entry, and the new tail.
    """
    size: int = ring.shape[0]
    nxt: int = tail + 1 if tail + 1 < size else 0
    while ring[nxt, 0] <= t:
        tail = nxt
        nxt = tail + 1 if tail + 1 < size else 0
    if ring[tail, 0] < -1e29:
        return 0.0, 0.0, 0.0, 0.0, tail
    w = (t - ring[tail, 0]) / (ring[nxt, 0] - ring[tail, 0])
    q_in, q_out = between_entries(ring, tail, nxt, 1, w), between_entries(ring, tail, nxt, 2, w)
    return q_in, q_out, between_entries(ring, tail, nxt, 3, w), between_entries(ring, tail, nxt, 4, w), tail


def between_entries(ring, tail: int, nxt: int, column: int, w):
    """Return a column of a ring at the share ``w`` of the way from one entry to the next."""
    return ring[tail, column] + w * (ring[nxt, column] - ring[tail, column])


def line_step(t, q_in, q_out, more_in, more_out, delay_1, delay_2, ring, head: int, tail: int, tail_2: int):
    """Pass the flows of the valves through the hoses.

    Args:
        t: Time in s.
        q_in: Mass flow into the hose of chamber 1 in kg/s.
        q_out: Mass flow out of it in kg/s.
        more_in: The same of chamber 2.
        more_out: The same of chamber 2.
        delay_1: Delay of the hose of chamber 1 in s.
        delay_2: Delay of the hose of chamber 2 in s.
        ring: Ring buffer of (time, in, out, in 2, out 2), shape (k, 5), changed in place.
        head: Entry to write.
        tail: Newest entry of chamber 1 not after the delayed time.
        tail_2: The same of chamber 2.

    Returns:
        The four flows that arrive in the chambers in kg/s, and the new head and tails.
    """
    # without back-flow: delayed, it would oscillate as no hose does
    ring[head, 0], ring[head, 1], ring[head, 2] = t, max(q_in, 0.0), max(q_out, 0.0)
    ring[head, 3], ring[head, 4] = max(more_in, 0.0), max(more_out, 0.0)
    if delay_1 > 0.0:
        q_in, q_out, _, _, tail = delayed_flows(ring, tail, t - delay_1)
    if delay_2 > 0.0:
        _, _, more_in, more_out, tail_2 = delayed_flows(ring, tail_2, t - delay_2)
    return q_in, q_out, more_in, more_out, head + 1 if head + 1 < ring.shape[0] else 0, tail, tail_2
