"""What moves the test rigs: steps and staircases of the valve, position control, machines, rows of steady flow."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from pneucli.arrays import Array
from pneucli.caches import compiled
from pneucli.exam.rig.gas import GAS_CONSTANT, KAPPA, PSI_MAX, orifice_flow, pump_flow, regulated_opening
from pneucli.exam.rig.kernel import P1, P2, PS, V, X, dry_friction, net_force, valve_area, valve_flow
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.simulation import LOOP_PERIOD, Excitation

THROTTLE_RATIO = 0.4  # critical pressure ratio of the throttle


@dataclass(frozen=True)
class SteadyRows:
    """The rows of a steady bench: openings (V from the null) and areas of the throttle to ambient (m^2), each pair."""

    openings: Array
    throttles: Array


@dataclass(frozen=True)
class RowSensors:
    """Noise of a row, which is a mean of many readings: of pressures (Pa), of the flow relative to it."""

    pressure: float = 100.0
    flow: float = 0.004


def simulate_steady_rows(par: Parameters, rows: SteadyRows) -> dict[str, Array]:
    """Return the true signals of all rows, each of shape (n,), SI: u, p_supply (inlet), p1 (outlet), flow.

    The inlet of a pump is open to ambient.
    """
    opening, throttle = (part.ravel() for part in np.meshgrid(rows.openings, rows.throttles, indexing="ij"))
    p1 = np.array([_outlet(par, o, a) for o, a in zip(opening.tolist(), throttle.tolist(), strict=True)])
    flow = np.array([_throttled(par, a, p) for a, p in zip(throttle.tolist(), p1.tolist(), strict=True)])
    inlet = par.ambient if par.pump_flow > 0.0 else par.supply
    u = par.command_null + par.command_sign * opening
    return {"u": u, "p_supply": np.full(u.size, inlet), "p1": p1, "flow": flow}


def measure_rows(
    par: Parameters, sensors: RowSensors, truth: dict[str, Array], rng: np.random.Generator
) -> dict[str, Array]:
    """Return the written rows, SI, pressures above ambient."""
    n = truth["u"].size
    seen = {name: truth[name] - par.ambient + sensors.pressure * rng.standard_normal(n) for name in ("p_supply", "p1")}
    return {"u": truth["u"], **seen, "flow": truth["flow"] * (1.0 + sensors.flow * rng.standard_normal(n))}


def _outlet(par: Parameters, opening: float, throttle: float) -> float:
    """Return the pressure in Pa at which as much comes in as the throttle lets out."""

    def surplus(p: float) -> float:
        return _delivered(par, opening, p) - _throttled(par, throttle, p)

    highest = par.ambient + 1.0 / par.pump_clearance if par.pump_flow > 0.0 else par.supply
    return float(brentq(surplus, par.ambient, highest, xtol=1e-3))


def _delivered(par: Parameters, opening: float, p: float) -> float:
    """Return what the source delivers less what its own exhaust takes, in kg/s."""
    if par.pump_flow > 0.0:
        return float(pump_flow(par, opening, p))
    s = np.full(10, par.temperature)
    s[P1], s[PS] = p, par.supply
    q_in, q_out = valve_flow(par, valve_area(par, regulated_opening(par, opening, p), 0.0), 0.0, s)
    return float(q_in - q_out)


def _throttled(par: Parameters, throttle: float, p: float) -> float:
    return float(orifice_flow(throttle, p, par.temperature, par.ambient, THROTTLE_RATIO))


REVERSAL_TIME = 0.15  # s, in which the machine turns round


@dataclass(frozen=True)
class MotionMachine:
    """The motion of the machine: strokes between two positions (m), their speeds in turn (m/s), p1 at ``pressure``.

    The pressure (Pa) is absolute; ``swing`` is the share of its gauge value by which it varies with the position.
    Chamber 2 is open to ambient.
    """

    positions: tuple[float, float]
    speeds: tuple[float, ...]
    strokes: int
    pressure: float
    swing: float = 0.0
    steady: bool = False  # only what has the constant speed is logged


def simulate_imposed_motion(par: Parameters, machine: MotionMachine, rate: float) -> dict[str, Array]:
    """Return the true signals (n,), SI, at the samples 0, 1, ... over ``rate`` (Hz), with the machine's ``force``."""
    velocity = _velocity(machine, rate)
    x = machine.positions[0] + np.concatenate([[0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]))]) / rate
    a = np.gradient(velocity, 1.0 / rate)
    middle, half = float(np.mean(machine.positions)), 0.5 * float(np.ptp(machine.positions))
    gauge = (machine.pressure - par.ambient) * (1.0 - machine.swing * (x - middle) / half)
    p1, p2 = par.ambient + gauge, np.full(x.size, par.ambient)
    force = _machine_force(par, np.arange(x.size) / rate, x, velocity, a, p1, p2)
    still = dict.fromkeys(("u", "u2"), np.zeros(x.size)) | {"p_supply": np.full(x.size, par.supply)}
    truth = still | {"p1": p1, "p2": p2, "x": x, "v": velocity, "a": a, "force": force}
    if not machine.steady:
        return truth
    logged = (np.abs(velocity) == np.max(np.abs(velocity))) & (np.abs(a) < 1e-9)
    return {name: signal[logged] for name, signal in truth.items()}


def _velocity(machine: MotionMachine, rate: float) -> Array:
    """Return the velocity: a trapezoid for each stroke."""
    way, parts = machine.positions[1] - machine.positions[0], []
    for k in range(machine.strokes):
        speed = machine.speeds[k % len(machine.speeds)]
        time = np.arange(0.0, abs(way) / speed + REVERSAL_TIME, 1.0 / rate)
        ramp = np.minimum(np.minimum(time, time[-1] - time) / REVERSAL_TIME, 1.0)
        parts.append((-1.0) ** k * np.sign(way) * speed * ramp)
    return np.concatenate(parts)


@compiled()
def _machine_force(par: Parameters, time: Array, x: Array, v: Array, a: Array, p1: Array, p2: Array) -> Array:
    """Return the force in N toward +x that the motion needs in addition to all forces of the rig."""
    out, s, direction = np.zeros(x.size), np.zeros(10), 1.0
    for k in range(x.size):
        s[X], s[V], s[P1], s[P2] = x[k], v[k], p1[k], p2[k]
        direction = np.sign(v[k]) if v[k] != 0.0 else direction
        rising, slowing = dry_friction(par, time[k], s, direction)
        friction = rising if a[k] * direction >= 0.0 else slowing
        out[k] = (par.mass + par.extra_mass) * a[k] - net_force(par, time[k], s) + direction * friction
    return out


FOLLOWING_TIME = 0.4  # s, in which the piston reaches its reference
STAIRCASE = np.array([1, 2, 3, 4, 3, 2, 1, 0, -1, -2, -3, -4, -3, -2, -1, 0])


def valve_step(par: Parameters, volts: float) -> Excitation:
    """Charge with +volts and discharge with -volts from the null, 1.15 s each, with a rest before each."""
    levels = [(150, 0.0), (1150, volts), (150, 0.0), (1150, -volts)]
    return _valve_test(par, np.concatenate([np.full(n, level) for n, level in levels]))


def valve_staircase(par: Parameters, small: float, large: float) -> Excitation:
    """Return two staircases up, down and back, 90 ms for each level; the second has steps of ``large`` V."""
    first, second = np.repeat(small * STAIRCASE, 90), np.repeat(large * STAIRCASE, 90)
    command = np.concatenate([np.zeros(190), first, np.zeros(290), second, np.zeros(200)])
    return _valve_test(par, np.round(command, 4))


def valve_pulses(par: Parameters, rng: np.random.Generator) -> Excitation:
    """Charge in pulses of 15 to 60 ms at the full command, with rests of 40 to 90 ms between; then discharge alike."""
    levels = [(150, 0.0)]
    for side in (1.0, -1.0):
        for _ in range(14):
            levels += [(int(rng.integers(15, 60)), side * par.command_range), (int(rng.integers(40, 90)), 0.0)]
    return _valve_test(par, np.concatenate([np.full(n, level) for n, level in levels]))


def stick_slip(
    par: Parameters, rate: float, position: float = 0.03, samples: int = 5000, load: float = 0.0
) -> Excitation:
    """Fill chamber 1 through a small constant opening, so that p1 rises at about ``rate`` (Pa/s) while stuck.

    At the start p1 carries a ``load`` (N, toward x = 0).
    """
    volume = par.dead_volume_1 + par.dead_volume_added + par.piston_area_1 * position
    mass_flow = rate * volume / (KAPPA * GAS_CONSTANT * par.temperature)
    area = mass_flow / (par.supply * np.sqrt(2 / (GAS_CONSTANT * par.temperature)) * PSI_MAX)
    opened = (area / par.effective_area) ** (1 / par.exponent)
    volts = par.overlap + (par.command_range - par.overlap) * opened
    return Excitation(
        np.full(samples, volts),
        chamber_2_open=True,
        position=position,
        pressure_1=par.ambient + load / par.piston_area_1,
        pressure_2=par.ambient,
    )


def closed_loop(
    par: Parameters, reference: Array, gain: float, gauge: float, load: float = 0.0, command_2: Array | None = None
) -> Excitation:
    """Return position control that starts at rest, in balance with a ``load`` (N, toward x = 0) at p1 = ``gauge`` (Pa).

    Chamber 2 is shut, or driven by the valve; ``command_2`` (V) is added to the negated command of the first valve.
    """
    other = max((gauge * par.piston_area_1 - load) / par.piston_area_2, 0.0)
    return Excitation(
        reference,
        command_2=np.zeros(1) if command_2 is None else command_2,
        gain=gain,
        position=float(reference[0]),
        pressure_1=par.ambient + gauge,
        pressure_2=par.ambient + other,
    )


def single_acting(par: Parameters, reference: Array, gain: float, load: float) -> Excitation:
    """Return position control with chamber 2 open; at the start p1 carries the ``load`` (N, toward x = 0)."""
    shut = closed_loop(par, reference, gain, load / par.piston_area_1, load)
    return replace(shut, chamber_2_open=True, pressure_2=par.ambient)


def two_sine_reference(rng: np.random.Generator, samples: int, stroke: float = 0.2) -> Array:
    """Return a reference in m, shape (samples,): two sines about the middle, within 0.1 to 0.95 of ``stroke`` (m)."""
    time = LOOP_PERIOD * np.arange(samples)
    slow, fast = rng.uniform(0.045, 0.065), rng.uniform(0.005, 0.02)
    period, ratio = rng.uniform(2.0, 4.0), rng.uniform(2.2, 3.7)
    phase = 2 * np.pi * time / period * rng.choice([-1.0, 1.0])
    return np.asarray((0.1 + slow * np.sin(phase) + fast * np.sin(ratio * phase)) * (stroke / 0.2))


def back_and_forth_reference(
    rng: np.random.Generator, samples: int, share: float, levels: tuple[float, float]
) -> Array:
    """Return a reference in m, shape (samples,), between two levels, each held for about that share of the time.

    A level beyond an end presses the piston against it.
    """
    travels = rng.uniform(0.3, 0.8, 1 + samples // 300)  # s
    corners, heights = [0.0], [0.5 * (max(levels[0], 0.0) + levels[1])]
    for k, travel in enumerate(travels):
        rest = (travel + FOLLOWING_TIME) * share / (1.0 - share) * rng.uniform(0.8, 1.2)
        corners += [corners[-1] + travel, corners[-1] + travel + FOLLOWING_TIME + rest]
        heights += [levels[k % 2], levels[k % 2]]
    return np.asarray(np.interp(LOOP_PERIOD * np.arange(samples), corners, heights))


def _valve_test(par: Parameters, command: Array) -> Excitation:
    return Excitation(command, pressure_1=par.ambient, pressure_2=par.ambient)
