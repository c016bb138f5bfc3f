"""A virtual servo-pneumatic axis on its bench: the physics of ``benchmarks.world``.

It shares nothing with the program. Mass and energy balances of chambers and hoses with heat from their walls; hoses of
three segments with inertia; four unequal metering edges (ISO 6358) with leakage over the overlap; a spool of second
order with a speed limit and a small play; a regulator with a buffer; generalised Maxwell slip with a Stribeck curve.
Steps are explicit and of fixed length, positions after velocities.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.random import Generator
from numpy.typing import NDArray

Array = NDArray[np.float64]
Record = Any  # an array of one record: numpy has no better type for it

R, KAPPA, GRAVITY = 287.0, 1.4, 9.81
CV, CP = R / (KAPPA - 1.0), KAPPA * R / (KAPPA - 1.0)
NORMAL_DENSITY = 1.185  # kg/m^3 at 20 degC, 1 bar, 65 % humidity (ISO 8778)
NORMAL_TEMPERATURE = 293.15
AREA = 0.6847 / (NORMAL_DENSITY * np.sqrt(R * NORMAL_TEMPERATURE))  # sonic conductance of an ideal nozzle of 1 m^2
VISCOSITY, CONDUCTIVITY, SOUND = 1.82e-5, 0.026, float(np.sqrt(KAPPA * R * NORMAL_TEMPERATURE))  # of air, SI units
SEGMENTS = 3  # of a hose
LAMINAR = 0.99  # pressure ratio above which a restriction is laminar (ISO 6358-1, annex)
STEP, COARSE_STEP = 25e-6, 50e-6  # s: of recordings, of the replays that measure an effect
SLIP = np.array([0.1, 0.3, 0.6, 1.0])  # presliding at which each of the four elements slips
SHARE = np.array([0.1, 0.2, 0.3, 0.4])  # of the friction that each carries
HORIZON = 0.5  # s
FAMILIES = ("gantry", "press", "clamp", "fast")


def fields(names: str, *shape: int) -> list[tuple[Any, ...]]:
    """Return fields of one shape for a record."""
    return [(name, "f8", shape) if shape else (name, "f8") for name in names.split()]


# all in SI units; a field of two belongs to chambers or sensors 1 and 2
MECHANICS = """stroke bore mass force spring spring_x cush_len cush k_stop m_load k_load c_load Fc Fs vs visc presl asym
    vasym pgain x_from x_to x_gain dwell dwell_tau drop wave wave_len"""
GAS = "Ta pamb pset Vb Greg pulse C_sil Ve b_s b_e C_leak lap curve omega zeta rate tau_v play D Vport h0 pleak"
SENSORS = "tau_p scale skew x_scale cross drift"
PAIRS = "A V0 L C_s C_e ov_s ov_e null leak off"
RIG = np.dtype((np.record, [*fields(f"{MECHANICS} {GAS} {SENSORS}"), *fields(PAIRS, 2)]))
LINES = fields("hm hU hp hT hq", 2, SEGMENTS)  # of each segment; hq: the flow out of it
STATE = np.dtype(
    (np.record, [*fields("x v a xl vl ps pe rest t"), *fields("m U lag play s w read", 2), *fields("slip", 4), *LINES])
)


@njit(cache=True, fastmath=True)
def flow(C, b, p, q):
    """Return the mass flow in kg/s from p to q through a restriction of ISO 6358 (negative: from q to p)."""
    up, down, sign = (p, q, 1.0) if p >= q else (q, p, -1.0)
    ratio = down / up
    if ratio <= b:
        return sign * C * NORMAL_DENSITY * up
    steep = min(ratio, LAMINAR)
    phi = np.sqrt(1.0 - ((steep - b) / (1.0 - b)) ** 2)
    if ratio > LAMINAR:
        phi *= (1.0 - ratio) / (1.0 - LAMINAR)
    return sign * C * NORMAL_DENSITY * up * phi


@njit(cache=True, fastmath=True)
def opening(r, s, overlap):
    """Return how far an edge is open; what leaks over the overlap falls with the length of the gap."""
    free = min(max((s - overlap) / (1.0 - overlap), 0.0), 1.0)
    return free * (r.curve + (1.0 - r.curve) * free)


@njit(cache=True, fastmath=True)
def move_spool(r, y, i, command, h):
    """Move a spool by one step and return its position: lag, play, then a second order with a speed limit."""
    y.lag[i] += min(h / r.tau_v, 1.0) * (command - y.lag[i]) if r.tau_v > 0.0 else command - y.lag[i]
    y.play[i] = min(max(y.play[i], y.lag[i] - r.play), y.lag[i] + r.play)
    y.w[i] += h * (r.omega**2 * (y.play[i] + r.null[i] - y.s[i]) - 2.0 * r.zeta * r.omega * y.w[i])
    y.w[i] = min(max(y.w[i], -r.rate), r.rate)
    y.s[i] = min(max(y.s[i] + h * y.w[i], -1.05), 1.05)
    return y.s[i]


@njit(cache=True, fastmath=True)
def through_hose(r, y, i, come, gone, p_chamber, T_chamber, h):
    """Advance the hose of a chamber by one step; return the flows of mass and of enthalpy into the chamber.

    Gas is exchanged with supply (``come``) and exhaust (``gone``); the film at the wall is laminar (Nu = 4) or follows
    Dittus and Boelter about Re = 10 000.
    """
    area, length = 0.25 * np.pi * r.D**2, r.L[i] / SEGMENTS
    viscous, turbulent = 32.0 * VISCOSITY / r.D**2, (0.015 / r.D + 0.25 / length) / area  # pipe; pipe and fittings
    push, per_flow = h * area / length, 0.003 * 4.0 / (np.pi * r.D * VISCOSITY)
    for j in range(SEGMENTS):
        after = y.hp[i, j + 1] if j + 1 < SEGMENTS else p_chamber
        loss = 2.0 * R * y.hT[i, j] / (y.hp[i, j] + after) * (viscous + turbulent * abs(y.hq[i, j]))
        y.hq[i, j] = (y.hq[i, j] + push * (y.hp[i, j] - after)) / (1.0 + h * loss)
    q, T = come - gone, y.hT[i, 0]
    enthalpy = CP * (come * (r.Ta if come > 0.0 else T) - gone * (T if gone > 0.0 else r.Ta))
    for j in range(SEGMENTS):
        on, T = y.hq[i, j], y.hT[i, j]
        T_after = y.hT[i, j + 1] if j + 1 < SEGMENTS else T_chamber
        enthalpy_on = CP * on * (T if on > 0.0 else T_after)
        film = CONDUCTIVITY * np.pi * length * (4.0 + per_flow * abs(on))
        y.hm[i, j] += h * (q - on)
        y.hU[i, j] += h * (enthalpy - enthalpy_on + film * (r.Ta - T))
        y.hp[i, j] = (KAPPA - 1.0) * y.hU[i, j] / (area * length + (r.Vport if j == 0 else 0.0))
        y.hT[i, j] = y.hU[i, j] / (CV * y.hm[i, j])
        q, enthalpy = on, enthalpy_on
    return q, enthalpy


@njit(cache=True, fastmath=True)
def friction(r, y, p_sum, h):
    """Advance the four slip elements by one step and return the force of friction against the motion."""
    v = y.v
    y.rest = y.rest + h if abs(v) < 2e-3 else 0.0
    still = r.Fs * (1.0 + r.dwell * (1.0 - np.exp(-y.rest / r.dwell_tau))) if r.dwell > 0.0 else r.Fs
    dry = r.Fc + (still - r.Fc) * np.exp(-abs(v) / r.vs)
    if r.drop > 0.0 and v * y.a < 0.0:
        dry = r.Fc * (1.0 - r.drop)
    dry *= 1.0 + r.asym * np.sign(v)
    dry *= 1.0 + r.pgain * 1e-5 * p_sum
    if r.x_from < y.x < r.x_to:
        dry *= 1.0 + r.x_gain
    if r.wave > 0.0:
        dry *= 1.0 + r.wave * np.sin(2.0 * np.pi * y.x / r.wave_len)
    force = r.visc * (1.0 + r.vasym * np.sign(v)) * v
    for j in range(4):
        limit = SHARE[j] * dry
        stiffness = SHARE[j] * r.Fs / (SLIP[j] * r.presl)
        y.slip[j] = min(max(y.slip[j] + stiffness * v * h, -limit), limit)
        force += y.slip[j]
    return force + 0.5 * np.sqrt(r.mass * r.Fs / r.presl) * v / (1.0 + (v / 2e-3) ** 2)  # damps the bristles


@njit(cache=True, fastmath=True)
def other_forces(r, y):
    """Return springs, weight, cushions and stops; positive toward +x."""
    force = -r.force - r.spring * (y.x - r.spring_x)
    left, right = r.cush_len - y.x, y.x - (r.stroke - r.cush_len)
    if r.cush > 0.0 and ((left > 0.0 and y.v < 0.0) or (right > 0.0 and y.v > 0.0)):
        force -= r.cush * min(max(left, right) / r.cush_len, 1.0) * y.v
    beyond = min(y.x, 0.0) + max(y.x - r.stroke, 0.0)
    if beyond != 0.0:
        stop = -r.k_stop * beyond - 0.8 * np.sqrt(r.k_stop * r.mass) * y.v
        force += max(stop, 0.0) if beyond < 0.0 else min(stop, 0.0)  # a stop cannot pull
    return force


@njit(cache=True, fastmath=True)
def pressure(r, y, i):
    """Return the pressure of a chamber in Pa."""
    return (KAPPA - 1.0) * y.U[i] / (r.V0[i] + r.A[i] * (y.x if i == 0 else r.stroke - y.x))


@njit(cache=True, fastmath=True)
def advance(r, y, first, second, h):
    """Advance everything by one step; the commands are relative, 1 opens a valve fully to fill its chamber."""
    p = (pressure(r, y, 0), pressure(r, y, 1))
    T = (y.U[0] / (y.m[0] * CV), y.U[1] / (y.m[1] * CV))
    supplied, exhausted = 0.0, 0.0
    between = flow(r.pleak, 0.4, p[0], p[1])
    v_new = move_piston(r, y, p, h)
    for i in range(2):
        s = move_spool(r, y, i, first if i == 0 else second, h)
        gap_s, gap_e = max(r.ov_s[i] - s, 0.0), max(r.ov_e[i] + s, 0.0)
        C_s = r.C_s[i] * opening(r, s, r.ov_s[i]) + r.C_leak / (1.0 + gap_s / r.lap)
        C_e = r.C_e[i] * opening(r, -s, r.ov_e[i]) + r.C_leak / (1.0 + gap_e / r.lap)
        come, gone = flow(C_s, r.b_s, y.ps, y.hp[i, 0]), flow(C_e, r.b_e, y.hp[i, 0], y.pe)
        supplied, exhausted = supplied + come, exhausted + gone
        q, enthalpy = through_hose(r, y, i, come, gone, p[i], T[i], h)
        lost = flow(r.leak[i], 0.4, p[i], r.pamb)
        across = -between if i == 0 else between
        hot = T[0] if between > 0.0 else T[1]
        wall = 2.0 * r.A[i] + np.pi * r.bore * (y.x if i == 0 else r.stroke - y.x)
        heat = r.h0 * wall * np.sqrt(p[i] / 4e5) * (r.Ta - T[i])
        enthalpy += CP * (across * hot - lost * (T[i] if lost > 0.0 else r.Ta))
        swept = h * r.A[i] * v_new * (1.0 if i == 0 else -1.0)
        work = p[i] * swept * (1.0 - 0.5 * KAPPA * swept / ((KAPPA - 1.0) * y.U[i] / p[i]))  # at the middle of the step
        y.m[i] += h * (q - lost + across)
        y.U[i] += h * (enthalpy + heat) - work
        y.read[i] += h / (r.tau_p + h) * (p[i] - y.read[i])
    setpoint = r.pset + r.pulse * np.sin(2.0 * np.pi * 1.7 * y.t)
    y.ps += h * R * r.Ta / r.Vb * (r.Greg * (setpoint - y.ps) - supplied)
    y.pe += h * R * r.Ta / r.Ve * (exhausted - flow(r.C_sil, 0.3, y.pe, r.pamb))
    y.a += h / 3e-3 * ((v_new - y.v) / h - y.a)
    y.v, y.x, y.t = v_new, y.x + h * v_new, y.t + h


@njit(cache=True, fastmath=True)
def move_piston(r, y, p, h):
    """Return the velocity of the piston after one step; advance a load that hangs on an elastic mount."""
    net = r.A[0] * p[0] - r.A[1] * p[1] - (r.A[0] - r.A[1]) * r.pamb
    net += other_forces(r, y) - friction(r, y, p[0] + p[1] - 2.0 * r.pamb, h)
    if r.m_load > 0.0:
        mount = r.k_load * (y.x - y.xl) + r.c_load * (y.v - y.vl)
        net -= mount
        y.vl += h * mount / r.m_load
        y.xl += h * y.vl
    return y.v + h * net / (r.mass - r.m_load)


@njit(cache=True, fastmath=True)
def command_of(r, y, gains, reference, rate):
    """Return the relative command of the bench's position controller."""
    kp, ka, speed, compensation, tolerance = gains
    error = reference - y.x
    if abs(error) < tolerance and abs(y.v) < 5e-3 and abs(rate) < 1e-6:
        return 0.0
    s = (rate + kp * error) / speed - ka * y.a
    s += compensation * min(max(s / 0.01, -1.0), 1.0)
    return min(max(s, -1.0), 1.0)


@njit(cache=True, fastmath=True)
def record(rig, state, first, second, closed, gains, ends, period, steps):
    """Run the bench in place. Return samples (n, 6) of x, both pressures, supply and commands, and states for replays.

    ``first`` is the reference of position (closed loop) or the command; at one of the ``ends`` a command is turned
    round. ``second`` is the command of chamber 2 over the reverse of the first.
    """
    r, y, n, h = rig[0], state[0], first.size, period / steps
    every, turned = round(HORIZON / period), 1.0
    out, anchors = np.empty((n, 6)), np.empty(n // every + 1, STATE)
    for k in range(n):
        if k % every == 0:
            anchors[k // every] = state[0]
        if closed:
            s = command_of(r, y, gains, first[k], (first[min(k + 1, n - 1)] - first[k]) / period)
        else:
            s = turned * first[k]
            if (s > 0.0 and y.x > ends[1]) or (s < 0.0 and y.x < ends[0]):
                turned, s = -turned, -s
        s = np.round(2048.0 * s) / 2048.0  # the output has 12 bits
        t = np.round(2048.0 * min(max(second[k] - s, -1.0), 1.0)) / 2048.0
        out[k] = (y.x, y.read[0], y.read[1], y.ps, s, t)
        for _ in range(steps):
            advance(r, y, s, t, h)
    return out, anchors


@njit(cache=True, fastmath=True)
def replay(rig, state, out, anchors, period, every_other):
    """Return x and both pressures (m, 3) under recorded commands, each horizon from the rig's own state before it."""
    r, y, steps = rig[0], state[0], round(period / COARSE_STEP)
    every = round(HORIZON / period)
    parts = (out.shape[0] // every + every_other - 1) // every_other
    found = np.empty((parts * every, 3))
    for part in range(parts):
        state[0] = anchors[part * every_other]
        for k in range(every):
            found[part * every + k] = (y.x, y.read[0], y.read[1])
            row = part * every_other * every + k
            for _ in range(steps):
                advance(r, y, out[row, 4], out[row, 5], period / steps)
    return found


def at_rest(r: Record, x: float) -> Record:
    """Return the state of a rig that stands at x."""
    states = np.zeros(1, STATE)
    y, p = states[0], 0.55 * r.pset
    y.x, y.xl, y.ps, y.pe, y.hp[:], y.read[:], y.hT[:] = x, x, r.pset, r.pamb, p, p, r.Ta
    y.m[:] = p * (r.V0 + r.A * np.array([x, r.stroke - x])) / (R * r.Ta)
    y.hm[:] = (0.25 * np.pi * r.D**2 * r.L[:, None] / SEGMENTS + r.Vport * np.eye(1, SEGMENTS)) * p / (R * r.Ta)
    y.U[:], y.hU[:] = y.m * CV * r.Ta, y.hm * CV * r.Ta
    return states


@dataclass(frozen=True)
class Machine:
    """What a rig builder chooses from: bores and rods in mm, valves in l/min (at 6 to 5 bar), the rest as ranges."""

    bores: Sequence[tuple[float, float]]
    stroke: tuple[float, float]  # m
    mass: tuple[float, float]  # kg
    valves: Sequence[tuple[float, float, float]]  # l/min, Hz, inner diameter of the hose in m
    hose: tuple[float, float]  # m
    dry: tuple[float, float]  # friction over the force of 6 bar on the piston
    viscous: tuple[float, float]  # N s/m for each N of dry friction
    presliding: tuple[float, float]  # m
    speed: tuple[float, float]  # m/s
    rates: Sequence[float]  # Hz
    encoders: Sequence[float]  # m
    seconds: tuple[float, float]  # of a recording


MACHINES = {
    "gantry": Machine(((25, 0), (32, 0), (40, 0)), (0.5, 1.2), (3, 15), ((350, 100, 4e-3), (700, 100, 5.7e-3)),
                      (0.4, 1.0), (0.03, 0.06), (1.5, 3.5), (3e-5, 6e-5), (0.4, 1.0), (1000,), (1e-6, 5e-6, 1e-5),
                      (6, 12)),
    "press": Machine(((50, 20), (63, 20), (80, 25)), (0.10, 0.25), (8, 40), ((700, 90, 5.7e-3), (1400, 90, 8e-3),
                     (2000, 60, 8e-3)), (0.3, 0.8), (0.025, 0.05), (1.5, 4), (3e-5, 6e-5), (0.12, 0.35), (2000,),
                     (1e-6, 2e-6, 5e-6), (4, 7)),
    "clamp": Machine(((12, 6), (16, 6), (20, 8)), (0.05, 0.10), (0.1, 0.5), ((100, 125, 2.9e-3), (100, 80, 4e-3)),
                     (0.2, 0.6), (0.04, 0.08), (1, 3), (2e-5, 5e-5), (0.12, 0.4), (1000, 2000), (1e-6, 5e-6, 1e-5),
                     (4, 7)),
    "fast": Machine(((20, 8), (25, 10), (32, 0)), (0.03, 0.08), (0.3, 1.0), ((100, 125, 2.9e-3), (350, 100, 4e-3)),
                    (0.12, 0.3), (0.003, 0.01), (2, 6), (2e-5, 3e-5), (0.2, 0.6), (2000,), (5e-7, 1e-6), (4, 6)),
}  # fmt: skip


def between(rng: Generator, ends: tuple[float, float]) -> float:
    """Return a draw that is even in its logarithm."""
    return float(np.exp(rng.uniform(*np.log(ends))))


def pick(rng: Generator, choices: Sequence[Any]) -> Any:
    """Return one of the choices."""
    return choices[rng.integers(len(choices))]


def healthy_rig(family: str, rng: Generator) -> tuple[Record, dict[str, Any]]:
    """Return the true parameters of a healthy rig, and what is not physics: valves, recorder, profile."""
    m, rigs = MACHINES[family], np.zeros(1, RIG)
    r = rigs[0]
    (bore, rod), (litres, hertz, diameter) = pick(rng, m.bores), pick(rng, m.valves)
    r.bore, r.stroke, r.mass = bore * 1e-3, round(between(rng, m.stroke), 2), between(rng, m.mass)
    r.A[:] = np.pi / 4e6 * np.array([bore**2, bore**2 - rod**2])
    C = litres / 60e3 / 4.24e5  # of a valve with b = 0.3 that passes so much from 6 to 5 bar
    r.C_s[:], r.C_e[:] = C * rng.uniform(0.85, 1.05, 2), C * rng.uniform(0.95, 1.15, 2)
    r.b_s, r.b_e, r.C_leak, r.lap = *rng.uniform(0.2, 0.45, 2), C * rng.uniform(5e-4, 2e-3), 0.02
    r.ov_s[:], r.ov_e[:] = rng.uniform(0.005, 0.04, 2), rng.uniform(0.005, 0.04, 2)
    r.curve, r.omega, r.zeta = rng.uniform(0.75, 1.0), 2 * np.pi * hertz * rng.uniform(0.6, 1.2), rng.uniform(0.6, 0.9)
    r.rate, r.play = rng.uniform(200, 400), rng.uniform(0.5e-3, 2e-3)
    r.D, r.L[:], r.Vport = diameter, between(rng, m.hose) * rng.uniform(0.9, 1.1, 2), 2e-6 * max(C / 2.75e-8, 0.5)
    r.V0[:] = r.A * r.stroke * rng.uniform(0.04, 0.1, 2) + rng.uniform(0.5e-6, 2e-6, 2) * bore / 12
    r.Ta, r.pamb, r.pset = rng.uniform(291, 299), rng.uniform(0.98e5, 1.025e5), rng.uniform(6e5, 8e5)
    r.Vb, r.Greg = rng.uniform(2, 8) * 1e-3, C * NORMAL_DENSITY * 6e5 / rng.uniform(2e4, 6e4)
    r.C_sil, r.Ve, r.h0 = 5 * C, 5e-5 * max(C / 2.75e-8, 0.5), rng.uniform(20, 70)
    r.Fc = between(rng, m.dry) * r.A[0] * 6e5
    r.Fs, r.vs = r.Fc * rng.uniform(1.1, 1.4), rng.uniform(5e-3, 3e-2)
    r.visc, r.presl = r.Fc * rng.uniform(*m.viscous), between(rng, m.presliding)
    r.pgain, r.tau_p, r.scale, r.x_scale = rng.uniform(0, 0.015), 1e-4 * rng.uniform(1, 6), rng.normal(1, 0.001), 1.0
    r.off[:], r.k_stop = rng.normal(0.0, 150.0, 2), min(r.mass * 4000.0**2, 2e7)
    two, bipolar, leans = family == "clamp" and rng.random() < 0.5, rng.random() < 0.5, pick(rng, (1.0, -1.0))
    error = rng.normal(0.0, 0.006, 2)
    r.null[:] = error if two else (error[0], -error[0])
    if family == "press":
        r.force = leans * r.mass * GRAVITY
    rest = {"two": two, "null": 0.0 if bipolar else 5.0, "full": 10.0 if bipolar else 5.0, "leans": leans,
            "rate": pick(rng, m.rates), "encoder": pick(rng, m.encoders), "bits": pick(rng, (12, 14, 16)),
            "noise": between(rng, (100, 500)), "speed": between(rng, m.speed), "style": int(rng.integers(3)),
            "supply_logged": bool(rng.random() < 0.6), "setpoint_logged": bool(rng.random() < 0.5),
            "into_stops": family == "clamp" and bool(rng.random() < 0.5), "prefill": 0.03 if two else 0.0,
            "volume_error": rng.normal(0.0, 0.03, 2) * r.V0, "mass_error": rng.normal(0.0, 0.005)}  # fmt: skip
    return rigs, rest


def natural_frequency(r: Record) -> float:
    """Return the frequency of the piston on its gas at mid-stroke in rad/s."""
    volumes = r.V0 + 0.5 * r.A * r.stroke + 0.25 * np.pi * r.D**2 * r.L
    return float(np.sqrt(KAPPA * 0.55 * r.pset * np.sum(r.A**2 / volumes) / r.mass))


def programme(kind: str, r: Record, rest: Mapping[str, Any], rng: Generator, n: int) -> tuple[Array, Array, bool]:
    """Return reference or command (n,), that of the second valve over the reverse, and whether a loop closes."""
    t, out, other = np.arange(n) / rest["rate"], np.zeros(n), np.full(n, rest["prefill"])
    gain, margin = 1.2e5 * np.mean(r.C_s) / r.A[0], 0.0 if rest["into_stops"] else 0.04
    if kind == "sine":
        size = r.stroke * rng.uniform(0.1, 0.4)
        hertz = min(rest["speed"] * rng.uniform(0.4, 1.0) / size, 0.4 * natural_frequency(r)) / (2.0 * np.pi)
        return 0.5 * r.stroke + size * np.sin(2.0 * np.pi * hertz * t), other, True
    if kind in ("moves", "slow"):
        return moves(kind, r, rest, rng, n, margin), other, True
    k, sign = 0, pick(rng, (1.0, -1.0))
    while k < n:
        seconds = {"steps": (0.1, 0.5), "reversals": (0.05, 0.25), "ramp": (1.5, 4.0)}[kind]
        block = slice(k, k := k + int(between(rng, seconds) * rest["rate"]))
        level = 0.03 + rng.uniform(0.15, 1.0) * rest["speed"] / gain
        shape = 1.0 - np.abs(np.linspace(-1.0, 1.0, len(out[block]))) if kind == "ramp" else 1.0
        out[block], sign = sign * min(level, 1.0) * shape, -sign if kind != "steps" else pick(rng, (1.0, -1.0))
        if rest["two"] and kind == "steps" and rng.random() < 0.4:
            other[block] = out[block] * pick(rng, (1.0, 0.5))  # the second valve stays shut, or opens by half
        k += int(rng.uniform(0.15, 0.8) * rest["rate"]) if kind == "steps" else 0
    return out, other, False


def moves(kind: str, r: Record, rest: Mapping[str, Any], rng: Generator, n: int, margin: float) -> Array:
    """Return a reference of point-to-point moves of least jerk with rests, or of slow ones at constant speed."""
    x, parts, count = r.stroke * rng.uniform(0.2, 0.8), [], 0
    hardest = 0.2 * (r.pset - r.pamb) * r.A[1] / r.mass
    while count < n:
        goal = r.stroke * rng.uniform(margin, 1.0 - margin)
        if rest["into_stops"] and rng.random() < 0.4:
            goal = r.stroke * pick(rng, (-0.05, 1.05))
        speed, way = rest["speed"] * rng.uniform(0.4, 1.0), abs(goal - x)
        if kind == "slow":
            goal = x + np.sign(goal - x) * min(way, 0.3 * r.stroke)
            seconds = abs(goal - x) / (speed * rng.uniform(0.04, 0.15))
        else:
            seconds = max(1.875 * way / speed, np.sqrt(5.77 * way / hardest))
        s = np.linspace(0.0, 1.0, max(int(seconds * rest["rate"]), 2))
        rising = s if kind == "slow" else s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        still = int(rng.uniform(0.2, 1.2) * rest["rate"])
        parts += [x + (goal - x) * rising, np.full(still, goal)]
        count, x = count + s.size + still, goal
    return np.concatenate(parts)[:n]


def gains_of(r: Record, rest: Mapping[str, Any]) -> tuple[float, ...]:
    """Return gains of the bench's position controller, damped by the acceleration."""
    gain, omega = 1.2e5 * np.mean(r.C_s) / r.A[0], natural_frequency(r)
    return 0.2 * min(omega, 90.0), 0.5 / (gain * max(omega, 20.0)), gain, float(np.mean(r.ov_s)), max(2e-4, 2 * r.presl)
