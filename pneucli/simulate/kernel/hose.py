"""The hoses between valves and chambers: a delay of the flow, or a section of a transmission line."""

import math

from pneucli.physics.gas import VISCOSITY
from pneucli.simulate.kernel.ports import flow_delay, flow_delay_1, flow_delay_2, hose_bore, hose_bore_1, hose_bore_2
from pneucli.simulate.layout import *

HOSE_STEPS = 4.0  # of the integration in the delay of a hose with a bore: 18 in a period of its oscillation
SHORTEST_DELAY = 6e-4  # s of a hose with a bore, 0.2 m: a shorter one is integrated as one of this length
HOSE_LOSS = 1.5  # of the dynamic pressure, at the sharp ends of a hose: 0.5 into it, 1 out of it


def hose_geometry(delay, bore, base):
    """Return the length in m, the cross-section in m^2 and the square of the speed of sound of a hose."""
    c2 = base[GAMMA] * base[GAS] * base[TEMP]
    return math.sqrt(c2) * max(delay, SHORTEST_DELAY), 0.25 * math.pi * bore * bore, c2


def volume_beyond_hose(dead, delay, bore, base):
    """Return a dead volume without the half of the hose that lies at the valve.

    Args:
        dead: Dead volume in m^3, with the hose.
        delay: Delay of the hose in s.
        bore: Its inner diameter in m; 0: it only delays.
        base: Base parameters.

    Returns:
        Volume in m^3, at least a tenth of the dead volume.
    """
    length, area, _ = hose_geometry(delay, bore, base)
    return dead - min(0.5 * area * length, 0.9 * dead)


def hose_friction(q, length, area, bore, density):
    """Return the pressure drop along a hose over its inertia and flow, in 1/s.

    Args:
        q: Mass flow in kg/s.
        length: Length in m.
        area: Cross-section in m^2.
        bore: Inner diameter in m.
        density: Density of the gas in kg/m^3.

    Returns:
        The rate at which friction alone would slow the flow, in 1/s.

    References:
        Hagen-Poiseuille; Blasius, 0.316 Re^(-1/4) for turbulent flow.
    """
    speed = abs(q) / (density * area)
    laminar = 32.0 * VISCOSITY / (density * bore * bore)
    turbulent = 0.158 * math.sqrt(math.sqrt(VISCOSITY * speed * speed * speed / (density * bore))) / bore
    return max(laminar, turbulent) + 0.5 * HOSE_LOSS * speed / length


def hose_step(p_valve, q, p, q_valve, h, delay, bore, base):
    """Advance a hose with a bore by a step: half its volume at the valve, then its inertia and friction.

    The other half belongs to the chamber.

    Args:
        p_valve: Pressure at the valve in Pa.
        q: Mass flow from there to the chamber in kg/s.
        p: Pressure of the chamber in Pa.
        q_valve: Mass flow from the valve in kg/s.
        h: Step in s.
        delay: Delay in s.
        bore: Inner diameter in m.
        base: Base parameters.

    Returns:
        Pressure at the valve in Pa, mass flow into the chamber in kg/s, and this flow as one in and one out of it.

    References:
        E. Richer and Y. Hurmuzlu, ASME J. Dynamic Systems, Measurement, and Control 122 (2000) 416-425 (a tube between
        valve and cylinder).
    """
    length, area, c2 = hose_geometry(delay, bore, base)
    density = base[GAMMA] * 0.5 * (p_valve + p) / c2  # the mean one: of isothermal flow p^2 falls evenly
    q = (q + h * area / length * (p_valve - p)) / (1.0 + h * hose_friction(q, length, area, bore, density))
    p_valve = max(p_valve + h * c2 * (q_valve - q) / (0.5 * area * length), 1.0)
    return p_valve, q, max(q, 0.0), max(-q, 0.0)


def hose_delays(th, on):
    """Return the delays of the hoses of both chambers in s."""
    both = flow_delay(th, on)
    return both + flow_delay_1(th, on), both + flow_delay_2(th, on)


def hose_bores(chamber_2: int, th, on):
    """Return the inner diameters of the hoses of both chambers in m; 0: it only delays, or has no valve."""
    both = hose_bore(th, on)
    return both + hose_bore_1(th, on), both + hose_bore_2(th, on) if chamber_2 not in (OPEN, CLOSED) else 0.0


def longest_step(h_max, delay_1, delay_2, bore_1, bore_2):
    """Return the longest step in s that follows the oscillation of hoses with a bore."""
    if bore_1 > 0.0:
        h_max = min(h_max, max(delay_1, SHORTEST_DELAY) / HOSE_STEPS)
    if bore_2 > 0.0:
        h_max = min(h_max, max(delay_2, SHORTEST_DELAY) / HOSE_STEPS)
    return h_max


def delayed_flows(ring, tail: int, t):
    """Return the flows into and out of both chambers at an earlier time.

    Args:
        ring: Ring buffer of (time, in, out, in 2, out 2), shape (k, 5).
        tail: Newest entry not after the time of the last call.
        t: Time in s; it must not decrease, nor reach the newest entry.

    Returns:
        Four mass flows in kg/s, before the first entry those at the tail, and the new tail.
    """
    size: int = ring.shape[0]
    nxt: int = tail + 1 if tail + 1 < size else 0
    while ring[nxt, 0] <= t:
        tail = nxt
        nxt = tail + 1 if tail + 1 < size else 0
    if ring[tail, 0] < -1e29:
        return ring[tail, 1], ring[tail, 2], ring[tail, 3], ring[tail, 4], tail
    w = (t - ring[tail, 0]) / (ring[nxt, 0] - ring[tail, 0])
    q_in, q_out = between_entries(ring, tail, nxt, 1, w), between_entries(ring, tail, nxt, 2, w)
    return q_in, q_out, between_entries(ring, tail, nxt, 3, w), between_entries(ring, tail, nxt, 4, w), tail


def between_entries(ring, tail: int, nxt: int, column: int, w):
    """Return a column of a ring at the share ``w`` of the way from one entry to the next."""
    return ring[tail, column] + w * (ring[nxt, column] - ring[tail, column])


def write_flows(q_in, q_out, more_in, more_out, ring, place: int):
    """Write the flows of an entry of a ring without back-flow: delayed, it would oscillate as no hose does."""
    ring[place, 1], ring[place, 2] = max(q_in, 0.0), max(q_out, 0.0)
    ring[place, 3], ring[place, 4] = max(more_in, 0.0), max(more_out, 0.0)


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
    ring[head, 0] = t
    write_flows(q_in, q_out, more_in, more_out, ring, head)
    if delay_1 > 0.0:
        q_in, q_out, _, _, tail = delayed_flows(ring, tail, t - delay_1)
    if delay_2 > 0.0:
        _, _, more_in, more_out, tail_2 = delayed_flows(ring, tail_2, t - delay_2)
    return q_in, q_out, more_in, more_out, head + 1 if head + 1 < ring.shape[0] else 0, tail, tail_2
