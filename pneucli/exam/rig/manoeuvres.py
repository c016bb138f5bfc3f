"""What is done on the three test rigs: steps and staircases of the valve, stick-slip and driven motion, closed loop."""

from __future__ import annotations

import numpy as np

from pneucli.exam.rig.kernel import GAS_CONSTANT, KAPPA, PSI_MAX, Array
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.run import LOOP, Manoeuvre

STAIRS = np.array([1, 2, 3, 4, 3, 2, 1, 0, -1, -2, -3, -4, -3, -2, -1, 0])


def valve_step(par: Parameters, volts: float) -> Manoeuvre:
    """Charge at +volts and discharge at -volts, each 1.15 s, with a rest before either."""
    levels = [(150, 0.0), (1150, volts), (150, 0.0), (1150, -volts)]
    return _bench(par, np.concatenate([np.full(n, level) for n, level in levels]))


def valve_stairs(par: Parameters, small: float, large: float) -> Manoeuvre:
    """Two staircases up, down and back, of 90 ms a level, the second in steps of ``large`` V."""
    first, second = np.repeat(small * STAIRS, 90), np.repeat(large * STAIRS, 90)
    command = np.concatenate([np.zeros(190), first, np.zeros(290), second, np.zeros(200)])
    return _bench(par, np.round(command, 4))


def stick_slip(par: Parameters, rate: float, position: float = 0.03, samples: int = 5000) -> Manoeuvre:
    """Fill chamber 1 through a small constant opening, so that p1 rises at about ``rate`` (Pa/s) while stuck."""
    volume = par.dead_volume_1 + par.dead_volume_added + par.piston_area_1 * position
    mass_flow = rate * volume / (KAPPA * GAS_CONSTANT * par.temperature)
    area = mass_flow / (par.supply * np.sqrt(2 / (GAS_CONSTANT * par.temperature)) * PSI_MAX)
    volts = par.overlap + (10 - par.overlap) * (area / par.effective_area) ** (1 / par.exponent)
    return Manoeuvre(
        np.full(samples, volts),
        chamber_2_open=True,
        position=position,
        pressure_1=par.ambient,
        pressure_2=par.ambient,
    )


def closed_loop(par: Parameters, reference: Array, gain: float, gauge: float) -> Manoeuvre:
    """Position control with chamber 2 closed, from rest in balance, p1 being ``gauge`` (Pa) above ambient."""
    other = gauge * par.piston_area_1 / par.piston_area_2
    return Manoeuvre(
        reference,
        gain=gain,
        position=float(reference[0]),
        pressure_1=par.ambient + gauge,
        pressure_2=par.ambient + other,
    )


def wandering(rng: np.random.Generator, samples: int, stroke: float = 0.2) -> Array:
    """A position reference in m, shape (samples,): two sines from the middle, within 0.1 to 0.95 of ``stroke`` (m)."""
    time = LOOP * np.arange(samples)
    slow, fast = rng.uniform(0.045, 0.065), rng.uniform(0.005, 0.02)
    period, ratio = rng.uniform(2.0, 4.0), rng.uniform(2.2, 3.7)
    phase = 2 * np.pi * time / period * rng.choice([-1.0, 1.0])
    return np.asarray((0.1 + slow * np.sin(phase) + fast * np.sin(ratio * phase)) * (stroke / 0.2))


def _bench(par: Parameters, command: Array) -> Manoeuvre:
    return Manoeuvre(command, pressure_1=par.ambient, pressure_2=par.ambient)
