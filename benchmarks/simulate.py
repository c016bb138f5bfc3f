"""Speed and accuracy of the simulation core in one run: ``python -m benchmarks.simulate``. Writes nothing.

10 s of a proportional position loop at 1 kHz, chamber 2 closed, valve of ``fixtures/demo``. Every time is the fastest
of many, the rivals taking turns, and stands beside the same loop in C (``smoothed.c``: RK4 at 100 us, gcc -O3, friction
smoothed by tanh(v / 1 mm/s)). Exit code 1 where a limit, which the project has set itself, is not held.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import ctypes
import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.integrate import odeint

from pneucli.physics.declaration import Effect
from pneucli.physics.effects import catalogue
from pneucli.recording import Rig
from pneucli.simulate import layout as at
from pneucli.simulate.build import Kernel, build
from pneucli.simulate.kernel.valve import effective_area
from pneucli.simulate.model import Model
from pneucli.simulate.rig_quantities import rig_quantities
from pneucli.simulate.valve_forms.area import ValveArea

Array = NDArray[np.float64]

RIG = Rig(
    ambient_pressure=101_300.0,
    supply_pressure=7e5,
    piston_area_1=8.04e-4,
    piston_area_2=8.04e-4,
    stroke=0.2,
    dead_volume_1=32e-6,
    dead_volume_2=30e-6,
    moving_mass=2.2,
)
STEP = 2.5e-4  # s, the kernel's longest
FRICTION = {"friction.coulomb": 14.0, "friction.viscous": 45.0}
VALVE = ValveArea((-10.0, -5.0, 5.0, 10.0), (1.8e-6, 0.83e-6, 0.83e-6, 1.8e-6), 0.2, 0.2)
AREAS = VALVE.table(10.0)
BASE = np.array([Model(RIG, (), FRICTION).base_values()[name] for name in at.BASE_NAMES])
PERIOD, N, BATCH = 1e-3, 10_000, 256
TIME = PERIOD * np.arange(N)
# steps with rests, then a sine: breaks away, slides, holds
REFERENCE = 0.1 + 0.04 * np.where(TIME < 6.0, np.sign(np.sin(2 * np.pi * TIME / 3.0 + 1e-9)), np.sin(2 * np.pi * TIME))
START = np.array([0.1, 0.0, 3e5, 3e5])
GAIN, LIMIT, SMOOTHING = 60.0, 10.0, 1e-3
FINE = 2e-6


def main() -> int:
    """Print every figure beside its limit; return the exit code."""
    bare, whole = build(()), build(tuple(catalogue().values()))
    c = c_library()
    t_c, t_bare, t_whole = fastest(lambda: smoothed(c), closed_loop(bare), closed_loop(whole, catalogue()))
    t_lsoda = fastest(lsoda(bare), runs=1)[0]
    t_batch = fastest(batch(bare), runs=3)[0] / BATCH
    exact = positions(bare, FINE)
    print(f"C, smoothed: {1e3 * t_c:.2f} ms; kernel, bare: {1e3 * t_bare:.2f} ms, every effect: {1e3 * t_whole:.2f} ms")
    print(f"the C's own error: {1e6 * np.abs(smoothed(c)[:, 0] - exact).max():.0f} um")
    figures = [
        ("closed loop, base model / C", t_bare / t_c, 0.45),
        ("  its error against a step of 2 us, um", 1e6 * float(np.abs(positions(bare) - exact).max()), 10.0),
        ("  its creep under a held load in 10 s, um", 1e6 * creep(bare), 0.0),
        (f"all {len(catalogue())} effects on / none", t_whole / t_bare, 2.3),
        ("closed loop, base model / LSODA", t_bare / t_lsoda, 0.01),
        (f"one of a batch of {BATCH} / C", t_batch / t_c, 0.25),
    ]
    for name, value, limit in figures:
        print(f"{name:45s} {value:9.3g}  (limit {limit:g}) {'ok' if value <= limit else 'FAILED'}")
    return int(any(value > limit for _, value, limit in figures))


def flags() -> Array:
    """Switches of a cylinder with chamber 2 closed and the controller in the loop."""
    out = np.zeros(at.FLAGS)
    out[[at.MECHANICS, at.PNEUMATICS, at.LOOP]] = 1.0
    out[at.CHAMBER_2], out[at.U_MAX] = at.CLOSED, 10.0
    return out


def inputs(reference: Array) -> Array:
    """The reference stands where a command would; pressures and position are read at the start alone."""
    out = np.zeros((reference.size, len(at.INPUTS)))
    out[:, at.IN_U], out[:, at.IN_SUPPLY] = reference, RIG.supply_pressure
    out[:, [at.IN_X, at.IN_V, at.IN_P1, at.IN_P2]] = START
    return out


def typical(effects: dict[str, Effect]) -> dict[str, float]:
    """The first typical value of every parameter."""
    facts = rig_quantities(Model(RIG, (), FRICTION, VALVE))
    return {f"{e.name}.{p.name}": p.range_on(facts).typical[0] for e in effects.values() for p in e.parameters}


def closed_loop(
    kernel: Kernel, effects: dict[str, Effect] | None = None, step: float = STEP, base: Array = BASE
) -> Callable[[], Array]:
    """The loop as a call without arguments, which returns the kernel's output."""
    th, on = kernel.effect_vector(typical(effects or {})), kernel.effect_switches(effects or {})
    given, out, starts = inputs(REFERENCE), np.zeros((N, at.OUTPUTS)), np.zeros(1, dtype=np.int64)
    switches, gains = flags(), np.array([GAIN, LIMIT])

    def run() -> Array:
        kernel.run(TIME, given, starts, base, th, on, switches, AREAS, step, np.zeros(1), gains, out)
        return out

    return run


def positions(kernel: Kernel, step: float = STEP) -> Array:
    return closed_loop(kernel, step=step)()[:, at.X].copy()


def creep(kernel: Kernel) -> float:
    """Distance in m that a force of 99 % of what holds moves the piston in 10 s, the valve shut."""
    given, out, switches = inputs(REFERENCE), np.zeros((N, at.OUTPUTS)), flags()
    given[:, at.IN_FORCE] = 0.99 * FRICTION["friction.coulomb"]
    switches[[at.LOOP, at.PNEUMATICS]] = 0.0
    th, on = kernel.effect_vector({}), kernel.effect_switches(())
    starts = np.zeros(1, dtype=np.int64)
    kernel.run(TIME, given, starts, BASE, th, on, switches, AREAS, STEP, np.zeros(1), np.zeros(2), out)
    return float(np.ptp(out[:, at.X]))


def batch(kernel: Kernel) -> Callable[[], None]:
    """As many runs with friction and mass of their own, one thread a core."""
    rng = np.random.default_rng(1)
    factors = np.ones((BATCH, BASE.size))
    factors[:, [at.COULOMB, at.VISCOUS, at.MASS]] = rng.uniform(0.8, 1.2, (BATCH, 3))
    cores = len(os.sched_getaffinity(0))
    chunks = [[closed_loop(kernel, base=BASE * f) for f in part] for part in np.array_split(factors, cores)]

    def run() -> None:
        with ThreadPoolExecutor(cores) as pool:
            list(pool.map(lambda chunk: [job() for job in chunk], chunks))

    return run


def c_library() -> ctypes.CDLL:
    """Compile ``smoothed.c`` into a folder that is gone when it is loaded."""
    with tempfile.TemporaryDirectory() as folder:
        library, code = Path(folder, "smoothed.so"), Path(__file__).with_name("smoothed.c")
        subprocess.run(["gcc", "-O3", "-shared", "-fPIC", "-o", library, code, "-lm"], check=True)
        return ctypes.CDLL(str(library))


def smoothed(c: ctypes.CDLL) -> Array:
    """The same loop in C; returns x, v, p1, p2, shape (N, 4)."""
    out, number = np.zeros((N, 4)), ctypes.c_double
    arrays = [a.ctypes.data_as(ctypes.POINTER(number)) for a in (REFERENCE, START, BASE, AREAS, out)]
    settings = [number(value) for value in (10.0, SMOOTHING, GAIN, LIMIT)]
    c.run(N, number(PERIOD), 10, *arrays[:4], AREAS.size, *settings, arrays[4])
    return out


def lsoda(kernel: Kernel) -> Callable[[], Array]:
    """The same smoothed equations, compiled, by scipy's LSODA, restarted at each sample; returns shape (N, 4)."""
    rates = smoothed_rates(kernel)

    def run() -> Array:
        out = np.zeros((N, 4))
        out[0] = START
        for k in range(N - 1):
            u = min(max(GAIN * (REFERENCE[k] - out[k, 0]), -LIMIT), LIMIT)
            setting = (u, effective_area(u, 10.0, AREAS), BASE)
            out[k + 1] = odeint(rates, out[k], (0.0, PERIOD), args=setting, rtol=1e-6, atol=1e-9)[1]
        return out

    return run


def smoothed_rates(kernel: Kernel) -> Callable[..., Array]:
    """Rates of x, v, p1, p2 with tanh for the sign of friction, compiled."""
    flow, k_gas = kernel.functions.orifice_flow, math.sqrt(2.0 / (BASE[at.GAS] * BASE[at.TEMP]))

    @njit(error_model="numpy")  # type: ignore[untyped-decorator]
    def rates(s: Array, t: float, u: float, area: float, b: Array) -> Array:
        x, v, p1, p2 = s
        q = -area * flow(p1, b[at.AMBIENT], b[at.CRITICAL], k_gas, k_gas)
        if u > 0.0:
            q = area * flow(b[at.SUPPLY], p1, b[at.CRITICAL], k_gas, k_gas)
        push = b[at.AREA_1] * (p1 - b[at.AMBIENT]) - b[at.AREA_2] * (p2 - b[at.AMBIENT])
        friction = b[at.COULOMB] * math.tanh(v / SMOOTHING) + b[at.VISCOUS] * v
        volume_1 = b[at.DEAD_1] + b[at.AREA_1] * x
        volume_2 = b[at.DEAD_2] + b[at.AREA_2] * (b[at.STROKE] - x)
        dp1 = b[at.GAMMA] * (b[at.GAS] * b[at.TEMP] * q - p1 * b[at.AREA_1] * v) / volume_1
        dp2 = b[at.GAMMA] * p2 * b[at.AREA_2] * v / volume_2
        return np.array([v, (push - friction) / b[at.MASS], dp1, dp2])

    return rates


def fastest(*rivals: Callable[[], object], runs: int = 100) -> list[float]:
    """Shortest time of each in s, after one run to warm up; they take turns, so that all meet the same machine."""
    for rival in rivals:
        rival()
    return [min(times) for times in zip(*([clocked(r) for r in rivals] for _ in range(runs)), strict=True)]


def clocked(run: Callable[[], object]) -> float:
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


if __name__ == "__main__":
    sys.exit(main())
