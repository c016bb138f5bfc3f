"""A machine moves the piston back and forth while a regulator holds p1; the force of the machine is measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pneucli.arrays import Array
from pneucli.caches import compiled
from pneucli.exam.rig.kernel import P1, P2, V, X, dry_friction, net_force
from pneucli.exam.rig.parameters import Parameters

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
