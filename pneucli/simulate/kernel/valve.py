"""Flow through the valve, and the line that delays it."""

from pneucli.physics.gas import orifice_flow


def effective_area(u, u_max, areas):
    """Effective area in m^2 at opening u, from a table over -u_max..u_max (linear in between)."""
    last = areas.size - 1
    place = (u + u_max) * (last / (2.0 * u_max))
    if place <= 0.0:
        return areas[0]
    if place >= last:
        return areas[last]
    i = int(place)
    return areas[i] + (place - i) * (areas[i + 1] - areas[i])


def valve_flow(opening, p, p_s, p_amb, b, leak, k, k_gas, u_max, areas):
    """Flow in kg/s from supply to outlet and from outlet to exhaust (thesis 2.46); k_gas is the supply gas's."""
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


def delayed_flows(ring, tail, t):
    """Flows into and out of either chamber at time t from a ring of (time, in, out, in 2, out 2), 0 before the first;
    returns the four and the new tail.

    The tail is the newest entry that is not after t; t must not go back, nor reach the newest of all.
    """
    size = ring.shape[0]
    nxt = tail + 1 if tail + 1 < size else 0
    while ring[nxt, 0] <= t:
        tail = nxt
        nxt = tail + 1 if tail + 1 < size else 0
    if ring[tail, 0] < -1e29:
        return 0.0, 0.0, 0.0, 0.0, tail
    old, new = ring[tail], ring[nxt]
    w = (t - old[0]) / (new[0] - old[0])
    q_in, q_out = old[1] + w * (new[1] - old[1]), old[2] + w * (new[2] - old[2])
    return q_in, q_out, old[3] + w * (new[3] - old[3]), old[4] + w * (new[4] - old[4]), tail
