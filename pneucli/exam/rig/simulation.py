"""Simulate the rig: spool, line and controller around the kernel's equations, one row for each sample.

The controller has its own clock, so commands may change between two samples or stay over many.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from pneucli.arrays import Array, Indices
from pneucli.caches import compiled, part
from pneucli.exam.rig.gas import SEGMENTS, flow_through_hose, pump_flow, regulated_opening
from pneucli.exam.rig.kernel import (
    MAX_STEP,
    P1,
    P2,
    PS,
    T1,
    T2,
    XL,
    Flows,
    V,
    X,
    motion_sign,
    state_rates,
    valve_area,
    valve_area_2,
    valve_flow,
)
from pneucli.exam.rig.parameters import FIVE_THREE, ONE_CHAMBER, TWO_VALVES, Parameters

COLUMNS = ("u", "u2", "p_supply", "p1", "p2", "x", "v", "a", "temperature", "temperature_2")
NO_PRESSURES = np.empty((0, 2))
LOOP_PERIOD = 1e-3  # s, the period of the commands


@dataclass(frozen=True)
class Excitation:
    """The commands of an experiment, one value for each ``LOOP_PERIOD``, held until the next.

    Attributes:
        command: The opening of the valve in V from its null. With a ``gain`` it is a position reference in m, and the
            opening is gain (reference - x) within the valve's range; a switching valve opens beyond a tenth of it.
        gain: The gain of the position loop (V/m); 0 for none.
        command_2: The same for the valve of chamber 2; with a gain it is added to the negated opening of the first.
        imposed: Both pressures in Pa, shape (n, 2), linear between the commands.
        cycle: The controller works in every n-th ``LOOP_PERIOD``; in between its command is held.

    """

    command: Array
    command_2: Array = field(default_factory=lambda: np.zeros(1))
    gain: float = 0.0
    chamber_2_open: bool = False
    position: float = 0.0
    velocity: float = 0.0
    pressure_1: float = 101_300.0
    pressure_2: float = 101_300.0
    imposed: Array = field(default_factory=lambda: NO_PRESSURES)
    cycle: int = 1


def simulate_rig(par: Parameters, excitation: Excitation, rate: float = 1000.0) -> dict[str, Array]:
    """Return the true signals, each of shape (n,), SI, at the samples 0, 1, ... over ``rate`` (Hz)."""
    m = excitation
    every, hold = _steps(rate)
    step = 1.0 / (rate * every)
    start = np.array([m.position, m.velocity, m.pressure_1, m.pressure_2])
    held = 2 if m.imposed.size else int(m.chamber_2_open)
    rows = _simulate_rows(
        par,
        m.command,
        np.resize(m.command_2, m.command.size),
        m.gain,
        held,
        start,
        m.imposed,
        step,
        hold,
        every,
        m.cycle,
    )
    return dict(zip(COLUMNS, rows.T, strict=True))


def _steps(rate: float) -> tuple[int, int]:
    """Return the steps of the integrator for each sample at ``rate`` (Hz), and for each command."""
    every = math.ceil(1.0 / (rate * MAX_STEP) - 1e-9)
    return every, round(LOOP_PERIOD * rate * every)


def command_stamps(excitation: Excitation, rate: float) -> tuple[Array, Indices]:
    """Return the times (s) at which the controller gives a command, and the samples over ``rate`` (Hz) that show it."""
    every, hold = _steps(rate)
    commands = np.arange(math.ceil(excitation.command.size / excitation.cycle), dtype=np.intp)
    steps = hold * excitation.cycle * commands
    samples = -(-steps // every)
    seen = samples <= (excitation.command.size * hold - 1) // every
    return steps[seen] / (rate * every), samples[seen]


@part()
def _step(par: Parameters, t: float, h: float, s: Array, mode: float, q: Flows, held: int, work: Array) -> None:
    """Advance ``s`` by one midpoint step of length h (s)."""
    middle, ds = work[0], work[1]
    state_rates(par, t, s, mode, q, held, ds)
    middle[:] = s + 0.5 * h * ds
    state_rates(par, t + 0.5 * h, middle, mode, q, held, ds)
    s += h * ds


@part()
def _advance(par: Parameters, t: float, h: float, s: Array, rest: float, q: Flows, held: int, work: Array) -> float:
    """Advance ``s`` by h (s), in two parts where the piston comes to rest; return the time at rest in s."""
    mode = motion_sign(par, t, s, rest)
    before = work[2]
    before[:] = s
    _step(par, t, h, s, mode, q, held, work)
    if mode != 0.0 and s[V] * mode < 0.0 and par.bristle_stiffness == 0.0:
        part = before[V] / (before[V] - s[V])
        s[:] = before
        _step(par, t, part * h, s, mode, q, held, work)
        s[V] = 0.0
        mode = motion_sign(par, t, s, 0.0)
        _step(par, t, (1.0 - part) * h, s, mode, q, held, work)
    return rest + h if mode == 0.0 else 0.0


@part()
def _spool(par: Parameters, h: float, u: float, aim: float, spool: float, opening: float) -> tuple[float, float, float]:
    """Return the spool's target (stiction), its position (lag) and the opening (play), in V after one step."""
    if abs(u - aim) > par.spool_stiction:
        aim = u
    slow = par.valve_lag + (par.sluggish_opening if abs(aim) > abs(spool) else 0.0)
    spool = aim + (spool - aim) * math.exp(-h / slow) if slow > 0.0 else aim
    width = par.valve_half_width
    return aim, spool, min(max(opening, spool - width), spool + width)


@compiled()
def _switched(par: Parameters, h: float, o: float, coil: Array) -> float:
    """Return the opening (V) of a switching valve whose command is o (V) for a step.

    ``coil`` (2,) has its opening (V) and the time (s) for which the command has asked for another one.
    """
    energised = o > coil[0] if o * coil[0] < 0.0 else o != 0.0
    late = par.opening_time if energised else par.closing_time
    if o == coil[0] or coil[1] >= late - 0.5 * h:
        coil[0], coil[1] = o, 0.0
    else:
        coil[1] += h
    return float(coil[0])


@compiled()
def empty_delay_line(par: Parameters, step: float) -> Array:
    """Return an empty delay line for the flows (kg/s) in the hoses: as many steps as the longest delays, and this.

    Hoses with a bore have a row for each segment: pressure (Pa; 0: not yet set) and flow of the one and of the other.
    """
    if par.hose_bore > 0.0:
        segments: Array = np.zeros((SEGMENTS, 4))
        return segments
    longest = par.line_delay + max(par.line_delay_1, par.line_delay_2)
    line: Array = np.zeros((round(longest / step) + 1, 4))
    return line


@compiled()
def step_rig(
    par: Parameters,
    i: int,
    step: float,
    o: float,
    o2: float,
    spools: Array,
    line: Array,
    s: Array,
    rest: float,
    held: int,
    work: Array,
) -> tuple[float, Flows]:
    """Advance by step ``i`` of length ``step`` (s) under openings o and o2 (V): spools, flows, hose, gas and motion.

    ``spools`` (6,) has target, position and opening (V) of each valve's spool, ``line`` the flows in the hose; both
    are updated together with ``s``. Returns the time at rest in s and the flows.
    """
    t = i * step
    o = regulated_opening(par, o, s[P1])
    spools[0], spools[1], spools[2] = _spool(par, step, o, spools[0], spools[1], spools[2])
    at_valve = work[2]  # the state, with the pressures before a hose with a bore
    at_valve[:] = s
    if par.hose_bore > 0.0:
        for column, chamber in ((0, P1), (2, P2)):
            if line[0, column] == 0.0:
                line[:, column] = s[chamber]
            at_valve[chamber] = line[0, column]
    now = line[i % len(line)] if par.hose_bore == 0.0 else np.zeros(4)
    now[0], now[1] = valve_flow(par, valve_area(par, spools[2], t), t, at_valve)
    if par.pump_flow > 0.0:
        now[0] = pump_flow(par, spools[2], at_valve[P1])
    if par.arrangement == TWO_VALVES:
        spools[3], spools[4], spools[5] = _spool(par, step, o2, spools[3], spools[4], spools[5])
    elif par.arrangement == FIVE_THREE:
        spools[5] = -spools[2]
    if par.arrangement != ONE_CHAMBER:
        now[2], now[3] = valve_flow(par, valve_area_2(par, spools[5], t), t, at_valve, 1)
    if par.hose_bore > 0.0:
        q_1 = flow_through_hose(par, step, now[0] - now[1], s[P1], line[:, 0], line[:, 1])
        q_2 = 0.0
        if par.arrangement != ONE_CHAMBER:
            q_2 = flow_through_hose(par, step, now[2] - now[3], s[P2], line[:, 2], line[:, 3])
        q = (max(q_1, 0.0), max(-q_1, 0.0), max(q_2, 0.0), max(-q_2, 0.0))
        return _advance(par, t, step, s, rest, q, held, work), q
    late = line[(i - round((par.line_delay + par.line_delay_1) / step)) % len(line)]
    late_2 = line[(i - round((par.line_delay + par.line_delay_2) / step)) % len(line)]
    q = (late[0], late[1], late_2[2], late_2[3])
    return _advance(par, t, step, s, rest, q, held, work), q


@compiled()
def limit_opening(par: Parameters, opening: float) -> float:
    """Return the opening in V after the limits of the valve's amplifier."""
    if par.switching > 0.0:
        return math.copysign(par.command_range, opening) if abs(opening) > 0.1 * par.command_range else 0.0
    return min(max(opening, -par.command_range), par.command_range)


@part()
def _row(
    par: Parameters, o: float, o2: float, t: float, s: Array, rest: float, q: Flows, held: int, work: Array
) -> Array:
    state_rates(par, t, s, motion_sign(par, t, s, rest), q, held, work[1])
    u, u2 = par.command_null + par.command_sign * o, par.command_null + o2
    return np.array([u, u2, s[PS], s[P1], s[P2], s[X], s[V], work[1][V], s[T1], s[T2]])


@compiled()
def _simulate_rows(
    par: Parameters,
    command: Array,
    second: Array,
    gain: float,
    held: int,
    start: Array,
    imposed: Array,
    step: float,
    hold: int,
    every: int,
    cycle: int,
) -> Array:
    """Return the true signals, a row every ``every`` steps of ``step`` (s); a command is held for ``hold`` steps."""
    steps = command.size * hold
    s, work, rows = np.zeros(10), np.zeros((3, 10)), np.empty(((steps - 1) // every + 1, 10))
    s[X], s[V], s[P1], s[P2], s[XL] = start[0], start[1], start[2], start[3], start[0]
    s[T1], s[T2], s[PS] = par.temperature, par.temperature, par.supply
    spools, line = np.zeros(6), empty_delay_line(par, step)
    o, o2, rest, q = 0.0, 0.0, 0.0, (0.0, 0.0, 0.0, 0.0)
    coils = np.zeros((2, 2))
    for i in range(steps):
        k, t = i // hold, i * step
        if i % (hold * cycle) == 0:
            o = limit_opening(par, command[k])
            if gain > 0.0:
                o = round(limit_opening(par, gain * (command[k] - s[X])), 4)
            if par.arrangement == TWO_VALVES:
                o2 = limit_opening(par, second[k] - o if gain > 0.0 else second[k])
        if i % every == 0:
            rows[i // every] = _row(par, o, o2, t, s, rest, q, held, work)
        if imposed.size:
            s[P1 : P2 + 1 : 2] = _interpolated(imposed, k, (i % hold + 0.5) / hold)
        opening, opening_2 = o, o2
        if par.switching > 0.0:
            opening, opening_2 = _switched(par, step, o, coils[0]), _switched(par, step, o2, coils[1])
        rest, q = step_rig(par, i, step, opening, opening_2, spools, line, s, rest, held, work)
    return rows


@part()
def _interpolated(imposed: Array, k: int, part: float) -> Array:
    after = min(k + 1, len(imposed) - 1)
    value: Array = imposed[k] * (1.0 - part) + imposed[after] * part
    return value
