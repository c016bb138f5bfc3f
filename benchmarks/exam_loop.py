"""Exported controllers on the exam's rig: ``python -m benchmarks.exam_loop [CONDITION ...]``. Needs gcc.

For each condition (see ``docs/exam.md``) a healthy axis is recorded, identified, and a controller designed for it and
exported as C. The C then drives the rig, which shares no code with the model. Prints the error at rest after steps, on
the default sine and under a load; all in um. ``SEED`` in the environment draws another rig.
"""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks import small
from pneucli.caches import compiled
from pneucli.exam.cases import generate_case, prepare_case
from pneucli.exam.conditions import parse
from pneucli.exam.rig.kernel import MAX_STEP, P1, P2, PS, T1, T2, XL, V, X, motion_sign, state_rates
from pneucli.exam.rig.parameters import TWO_VALVES, Parameters
from pneucli.exam.rig.sensors import Sensors
from pneucli.exam.rig.simulation import LOOP_PERIOD, empty_delay_line, limit_opening, step_rig

Array = NDArray[np.float64]
ASKED = ("usual", "5/3", "5/3-5V", "5/3-null", "two-valves", "differential+5/3", "hanging-load+5/3", "return-spring")
TIME = LOOP_PERIOD * np.arange(6000)
LOAD = 0.1  # of the supply's force
SETTLED = 500  # samples before the next change


@compiled()
def period(
    par: Parameters, first: int, steps: int, s: Array, o: Array, spools: Array, line: Array, held: int, rest: float,
    work: Array,
) -> tuple[float, float, float]:  # fmt: skip
    """Run the rig for ``steps`` steps with openings ``o`` (V): time at rest (s), air (kg), acceleration (m/s^2)."""
    air, q = 0.0, (0.0, 0.0, 0.0, 0.0)
    for i in range(first, first + steps):
        rest, q = step_rig(par, i, MAX_STEP, o[0], o[1], spools, line, s, rest, held, work)
        air += MAX_STEP * (q[0] + q[2])
    t = (first + steps) * MAX_STEP
    state_rates(par, t, s, motion_sign(par, t, s, rest), q, held, work[1])
    return rest, air, work[1][V]


class Sensed:
    """What the sensors of a rig read, a sample every ``h`` s: x, p1, p2; lag and delay of the pressures' included."""

    def __init__(self, par: Parameters, sensors: Sensors, h: float, start: Array, seed: int) -> None:
        self._par, self._sensors, self._h = par, sensors, h
        self._rng = np.random.default_rng(seed)
        self._noise, self._lagged = np.zeros(2), np.array([start[P1], start[P2]])
        self._past = [self._lagged] * (round(par.pressure_skew / h) + 1)

    def __call__(self, s: Array) -> Array:
        par, sensors = self._par, self._sensors
        share = 1.0 - np.exp(-self._h / par.pressure_lag) if par.pressure_lag > 0.0 else 1.0
        self._lagged = self._lagged + share * (np.array([s[P1], s[P2]]) - self._lagged)
        self._past = [*self._past[1:], self._lagged]
        pole = sensors.pole ** (1000.0 * self._h)
        self._noise = pole * self._noise + np.sqrt(1.0 - pole**2) * self._rng.standard_normal(2)
        shown = par.ambient + par.pressure_scale * (self._past[0] - par.ambient) + sensors.pressure * self._noise
        x = np.round(s[X] / sensors.position_step) * sensors.position_step
        return np.array([x, shown[0] + par.pressure_offset, shown[1]])


class Exported:
    """An exported controller, compiled."""

    def __init__(self, folder: Path) -> None:
        library = folder / "controller.so"
        source = folder / "pneucli_controller.c"
        if not library.exists() or library.stat().st_mtime_ns <= source.stat().st_mtime_ns:
            subprocess.run(["gcc", "-O2", "-std=c99", "-shared", "-fPIC", source, "-o", library, "-lm"], check=True)
        self._library = ctypes.CDLL(str(library))
        self._state = ctypes.create_string_buffer(1 << 16)
        self._step = self._library.pneucli_controller_step
        real = ctypes.c_float if "float state" in (folder / "pneucli_controller.h").read_text() else ctypes.c_double
        self._step.argtypes = [ctypes.c_void_p, *4 * [real], ctypes.POINTER(real)]
        self._library.pneucli_controller_init(self._state)
        self._u = (real * 2)()

    def __call__(self, x_ref: float, x: float, p1: float, p2: float) -> tuple[float, float]:
        self._step(self._state, x_ref, x, p1, p2, self._u)
        return self._u[0], self._u[1]


class Trace(NamedTuple):
    """What a loop did, one value a sample: true position (m), commands (V), readings of x, p1, p2, a; air (kg)."""

    x: Array
    u: Array
    air: float
    u2: Array
    read: Array
    supply: Array
    a: Array


def driven(
    par: Parameters, sensors: Sensors, control: Exported, reference: Array, load: Array, is_open: bool,
    h: float = LOOP_PERIOD, seed: int = 0,
) -> Trace:  # fmt: skip
    """Let the controller follow a ``reference`` (m) under a ``load`` (N), called every ``h`` s."""
    s, o, work, rest = np.zeros(10), np.zeros(2), np.zeros((3, 10)), 1.0
    spools, line, steps = np.zeros(6), empty_delay_line(par, MAX_STEP), round(h / MAX_STEP)
    s[X] = s[XL] = reference[0]
    balanced = par.constant_force + par.spring_stiffness * (reference[0] - par.spring_rest)
    s[P1] = s[P2] = np.sqrt(par.ambient * par.supply)
    s[P1] = (balanced + (par.ambient if is_open else s[P2]) * par.piston_area_2) / par.piston_area_1
    s[P1] += par.ambient * (par.piston_area_1 - par.piston_area_2) / par.piston_area_1
    s[P2] = par.ambient if is_open else s[P2]
    s[T1] = s[T2] = par.temperature
    s[PS] = par.supply
    sensed, n = Sensed(par, sensors, h, s, seed), reference.size
    x, u, u2, supply, a, read, air = *(np.zeros(n) for _ in range(5)), np.zeros((n, 3)), 0.0
    rng = np.random.default_rng([seed, 1])
    for k in range(n):
        x[k], supply[k], read[k] = s[X], s[PS], sensed(s)
        u[k], u2[k] = control(reference[k], *read[k])
        o[0] = limit_opening(par, par.command_sign * (u[k] - par.command_null))
        o[1] = limit_opening(par, u2[k] - par.command_null) if par.arrangement == TWO_VALVES else 0.0
        loaded = par._replace(constant_force=par.constant_force + load[k])
        rest, used, moved = period(loaded, k * steps, steps, s, o, spools, line, int(is_open), rest, work)
        air += used
        a[min(k + 1, n - 1)] = moved
    return Trace(x, u, air, u2, read, supply, a + sensors.acceleration * rng.standard_normal(n))


def figures(par: Parameters, sensors: Sensors, control: Path, is_open: bool) -> tuple[float, float, float]:
    """Return errors in um: the largest at rest after steps, rms on a sine, the largest at rest under a load."""
    at = 0.5 * par.stroke + par.stroke * np.where(TIME < 0.5, 0.0, np.where(TIME < 3.0, 0.15, -0.15))
    sine = 0.5 * par.stroke + 0.15 * par.stroke * np.sin(np.pi * np.maximum(TIME - 0.5, 0.0))
    still, pushed = np.full(TIME.size, 0.5 * par.stroke), (TIME >= 1.5) & (TIME < 4.0)
    push = LOAD * (par.supply - par.ambient) * par.piston_area_1 * pushed

    def error(reference: Array, load: Array) -> Array:
        return 1e6 * (driven(par, sensors, Exported(control), reference, load, is_open).x - reference)

    stepped, followed, loaded = (error(r, f) for r, f in ((at, 0 * TIME), (sine, 0 * TIME), (still, push)))
    at_rest = [
        max(abs(e[k - SETTLED : k]).max() for k in (ends, e.size)) for e, ends in ((stepped, 3000), (loaded, 4000))
    ]
    return at_rest[0], float(np.sqrt(np.mean(followed[1500:] ** 2))), at_rest[1]


def designed(folder: Path, *commands: list[str]) -> Path:
    """Return the folder with the exported C of a pipeline."""
    for command in commands or (["design"], ["export", "--to", "c"]):
        told = subprocess.run(
            [sys.executable, "-m", "pneucli", command[0], "pipeline.toml", *command[1:], "--out", "out", "--quiet"],
            check=False,
            cwd=folder,
            capture_output=True,
            text=True,
            env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[1])},
        )
        if told.returncode:
            raise RuntimeError(told.stderr.strip())
    return folder / "out" / "export"


def main(arguments: list[str]) -> None:
    """Print a row for each condition."""
    seed = int(os.environ.get("SEED", "1"))
    print(
        "| condition | at rest after steps, um | sine, rms, um | at rest under a load, um |\n| --- | --- | --- | --- |"
    )
    if small.SMALL in arguments:
        main_small()
        return
    for name in arguments or ASKED:
        conditions = parse(name)
        with tempfile.TemporaryDirectory() as folder:
            generate_case(Path(folder), "axis", (), "", 1.0, seed, conditions)
            laboratory = prepare_case("rig", "axis", (), "", 1.0, seed, conditions).laboratory
            try:
                par, is_open = laboratory.parameters, conditions.load == "spring" and conditions.valve is None
                shown = [f"{value:.3g}" for value in figures(par, laboratory.sensors, designed(Path(folder)), is_open)]
            except RuntimeError as error:
                shown = [str(error).replace("\n", " ")[:300]]
        print(f"| `{name}` | {' | '.join(shown)} |", flush=True)


def main_small() -> None:
    """Print the row of a controller for the exact model."""
    rig = small.laboratory()
    with tempfile.TemporaryDirectory() as folder:
        found = figures(rig.parameters, rig.sensors, small.exported(Path(folder), rig), False)
    print(f"| `usual` | {' | '.join(f'{value:.3g}' for value in found)} |")


if __name__ == "__main__":
    main(sys.argv[1:])
