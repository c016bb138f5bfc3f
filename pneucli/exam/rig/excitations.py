"""The excitations of the three test rigs: steps and staircases of the valve, stick-slip motion, position control."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pneucli.arrays import Array
from pneucli.exam.rig.gas import GAS_CONSTANT, KAPPA, PSI_MAX
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.simulation import LOOP_PERIOD, Excitation

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
