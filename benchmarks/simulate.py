"""The simulation core and the exported plant: ``python -m benchmarks.simulate [kernel|fmu]``. Writes nothing.

``kernel``: speed and accuracy of a proportional position loop at 1 kHz over 10 s, chamber 2 closed, valve of
``fixtures/demo``. The reference is the same loop in C (``smoothed.c``: RK4 at 100 us, gcc -O3, friction smoothed by
tanh(v / 1 mm/s)). Each time is the fastest of many runs; the programs take turns. The exit code is 1 where a limit of
the project is exceeded. ``--small`` runs 0.4 s of the task a few times and tests accuracy alone: so short a run
measures no speed.

``fmu``: the exported plant in FMPy against the kernel; needs FMPy and a C compiler. Ten seconds of an axis of the size
of the demo, command and load in steps, called every millisecond. Printed are the largest difference of x, v, a, p1 and
p2 relative to the range of each, and the seconds of FMPy and of the FMU alone.
"""

import ctypes
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import fmpy
import numpy as np
from numba import njit
from scipy.integrate import odeint

from benchmarks.rigs import print_tables
from pneucli.arrays import Array
from pneucli.export.fmu.package import FILE_NAME, write_fmu
from pneucli.export.fmu.plant import Plant, plant_of
from pneucli.physics.declaration import Effect
from pneucli.physics.effects import catalogue
from pneucli.recording import Rig
from pneucli.simulate import layout as at
from pneucli.simulate.build import Kernel, build
from pneucli.simulate.derivatives import as_rows
from pneucli.simulate.dual import LANES
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.kernel.chamber import effective_area
from pneucli.simulate.model import Model
from pneucli.simulate.open_loop import noise_free_recording
from pneucli.simulate.preparation import prepare
from pneucli.simulate.rig_quantities import rig_quantities
from pneucli.simulate.run import run_kernel
from pneucli.simulate.valve_forms import ValveArea

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
PERIOD = 1e-3  # s
TIME = PERIOD * np.arange(10_000)
# steps with standstill, then a sine: the piston breaks away, slides, sticks
REFERENCE = 0.1 + 0.04 * np.where(TIME < 6.0, np.sign(np.sin(2 * np.pi * TIME / 3.0 + 1e-9)), np.sin(2 * np.pi * TIME))
START = np.array([0.1, 0.0, 3e5, 3e5])
GAIN, LIMIT, SMOOTHING = 60.0, 10.0, 1e-3
FINE = 2e-6  # s, step of the exact solution


class Size(NamedTuple):
    """Samples of the task, runs in a batch, and repetitions of each measured time."""

    samples: int = TIME.size
    batch: int = 256
    runs: int = 100


SMALL = Size(400, 8, 2)


class Figure(NamedTuple):
    """One measured figure, its limit, and whether it is a time."""

    name: str
    value: float
    limit: float
    is_time: bool = True


def print_kernel(_: Sequence[str], *, is_small: bool) -> bool:
    """Print every figure and its limit; return whether all keep it."""
    figures = measure(SMALL if is_small else Size())
    failed = [f for f in figures if not f.value <= f.limit and not (is_small and f.is_time)]
    for f in figures:
        verdict = "FAILED" if f in failed else "not tested" if is_small and f.is_time else "ok"
        print(f"{f.name:45s} {f.value:9.3g}  (limit {f.limit:g}) {verdict}")
    return not failed


def measure(size: Size) -> list[Figure]:
    """Run every program on the task."""
    n = size.samples
    bare, whole = build(()), build(tuple(catalogue().values()))
    c = c_library()
    loops = closed_loop(bare, n), closed_loop(whole, n), closed_loop(whole, n, catalogue())
    steps = round(PERIOD / STEP)
    in_c = (lambda: smoothed(c, n)), (lambda: smoothed(c, n, steps))
    t_c, t_equal, t_bare, t_off, t_whole = fastest(*in_c, *loops, runs=size.runs)
    t_lsoda = fastest(lsoda(bare, n), runs=1)[0]
    t_batch = fastest(batch(bare, size), runs=min(3, size.runs))[0] / size.batch
    t_imposed, t_derivatives = fastest(imposed_motion(bare, n), derivatives(bare, n), runs=size.runs)
    exact = positions(bare, n, FINE)
    print(f"C, smoothed: {1e3 * t_c:.2f} ms; kernel, bare: {1e3 * t_bare:.2f} ms, every effect: {1e3 * t_whole:.2f} ms")
    print(f"C with the kernel's {steps} steps a sample: {1e3 * t_equal:.2f} ms, kernel / C: {t_bare / t_equal:.3g}")
    print(f"error of the C program: {1e6 * np.abs(smoothed(c, n)[:, 0] - exact).max():.0f} um")
    error = 1e6 * float(np.abs(positions(bare, n) - exact).max())
    return [
        Figure("closed loop, base model / C", t_bare / t_c, 0.45),
        Figure("  its error against a step of 2 us, um", error, 10.0, is_time=False),
        Figure("  its creep under a held load, um", 1e6 * creep(bare, n), 0.0, is_time=False),
        Figure(f"all {len(catalogue())} effects off / none", t_off / t_bare, 1.3),
        Figure(f"all {len(catalogue())} effects on / none", t_whole / t_bare, 2.3),
        Figure("closed loop, base model / LSODA", t_bare / t_lsoda, 0.01),
        Figure(f"derivatives by {LANES} parameters / differences", t_derivatives / t_imposed / LANES, 0.4),
        Figure(f"one of a batch of {size.batch} / C", t_batch / t_c, 0.25),
    ]


def flags() -> Array:
    """Switches of a cylinder with chamber 2 closed and the controller in the loop."""
    out = np.zeros(at.FLAGS)
    out[[at.MECHANICS, at.PNEUMATICS, at.LOOP]] = 1.0
    out[at.CHAMBER_2], out[at.U_MAX] = at.CLOSED, 10.0
    return out


def inputs(reference: Array) -> Array:
    """Inputs of the kernel: the reference takes the place of the command; the state is read at the start only."""
    out = np.zeros((reference.size, len(at.INPUTS)))
    out[:, at.IN_U], out[:, at.IN_SUPPLY] = reference, RIG.supply_pressure
    out[:, [at.IN_X, at.IN_V, at.IN_P1, at.IN_P2]] = START
    return out


def typical(effects: dict[str, Effect]) -> dict[str, float]:
    """The first typical value of every parameter."""
    facts = rig_quantities(Model(RIG, (), FRICTION, VALVE))
    return {f"{e.name}.{p.name}": p.range_on(facts).typical[0] for e in effects.values() for p in e.parameters}


def closed_loop(
    kernel: Kernel, samples: int, effects: dict[str, Effect] | None = None, step: float = STEP, base: Array = BASE
) -> Callable[[], Array]:
    """The loop as a call without arguments, which returns the kernel's output."""
    th, on = kernel.effect_vector(typical(effects or {})), kernel.effect_switches(effects or {})
    given, out = inputs(REFERENCE[:samples]), np.zeros((samples, at.OUTPUTS))
    starts, clock = np.zeros(1, dtype=np.int64), TIME[:samples]
    switches, gains = flags(), np.array([GAIN, LIMIT])

    def run() -> Array:
        kernel.run(clock, given, starts, base, th, on, switches, AREAS, AREAS, step, step, np.zeros(1), gains, out)
        return out

    return run


def imposed_motion(kernel: Kernel, samples: int) -> Callable[[], None]:
    """A call that simulates both chambers, a valve at each, with an imposed motion, from a restart each 0.5 s."""
    given, out = imposed_inputs(kernel, samples), np.zeros((samples, at.OUTPUTS))
    return lambda: kernel.run(*given, np.zeros(1), np.zeros(2), out)


def derivatives(kernel: Kernel, samples: int) -> Callable[[], None]:
    """The same with the derivatives by as many parameters as a dual number holds."""
    time, given, starts, base, th, on, switches, areas, areas_2, *steps = imposed_inputs(kernel, samples)
    rows, out = [as_rows(numbers) for numbers in (base, th)], np.zeros((samples, at.D_OUTPUTS, 1 + LANES))
    slopes, places = np.repeat(areas[:, None], LANES, axis=1), np.arange(LANES)
    return lambda: kernel.run_duals(
        time, given, starts, *rows, on, switches, areas, areas_2, *steps, slopes, slopes, places, out
    )


def imposed_inputs(kernel: Kernel, samples: int) -> tuple[Any, ...]:
    """The kernel's arguments for a sine of the command and of the position."""
    phase, given, switches = 2 * np.pi * TIME[:samples], inputs(REFERENCE[:samples]), flags()
    given[:, at.IN_U], given[:, at.IN_U2] = 8.0 * np.sin(3.0 * phase), -8.0 * np.sin(3.0 * phase)
    given[:, at.IN_X], given[:, at.IN_V] = 0.1 + 0.04 * np.sin(phase), 0.08 * np.pi * np.cos(phase)
    switches[[at.MECHANICS, at.LOOP]], switches[at.CHAMBER_2] = 0.0, at.VALVE_2
    starts = np.arange(0, samples, 500)
    off = kernel.effect_vector({}), kernel.effect_switches(())
    return TIME[:samples], given, starts, BASE, *off, switches, AREAS, AREAS, 2 * STEP, 2 * STEP


def positions(kernel: Kernel, samples: int, step: float = STEP) -> Array:
    return closed_loop(kernel, samples, step=step)()[:, at.X].copy()


def creep(kernel: Kernel, samples: int) -> float:
    """Distance in m that a force of 99 % of the holding friction moves the piston, the valve shut."""
    given, out, switches = inputs(REFERENCE[:samples]), np.zeros((samples, at.OUTPUTS)), flags()
    given[:, at.IN_FORCE] = 0.99 * FRICTION["friction.coulomb"]
    switches[[at.LOOP, at.PNEUMATICS]] = 0.0
    th, on = kernel.effect_vector({}), kernel.effect_switches(())
    starts = np.zeros(1, dtype=np.int64)
    clock = TIME[:samples]
    kernel.run(clock, given, starts, BASE, th, on, switches, AREAS, AREAS, STEP, STEP, np.zeros(1), np.zeros(2), out)
    return float(np.ptp(out[:, at.X]))


def batch(kernel: Kernel, size: Size) -> Callable[[], None]:
    """A batch of runs with different friction and mass, one thread a core."""
    rng = np.random.default_rng(1)
    factors = np.ones((size.batch, BASE.size))
    factors[:, [at.COULOMB, at.VISCOUS, at.MASS]] = rng.uniform(0.8, 1.2, (size.batch, 3))
    cores = len(os.sched_getaffinity(0))
    chunks = [
        [closed_loop(kernel, size.samples, base=BASE * f) for f in part] for part in np.array_split(factors, cores)
    ]

    def run() -> None:
        with ThreadPoolExecutor(cores) as pool:
            list(pool.map(lambda chunk: [job() for job in chunk], chunks))

    return run


def c_library() -> ctypes.CDLL:
    """Compile and load ``smoothed.c``; the folder of the library is temporary."""
    with tempfile.TemporaryDirectory() as folder:
        library, code = Path(folder, "smoothed.so"), Path(__file__).with_name("smoothed.c")
        subprocess.run(["gcc", "-O3", "-shared", "-fPIC", "-o", library, code, "-lm"], check=True)
        return ctypes.CDLL(str(library))


def smoothed(c: ctypes.CDLL, samples: int, steps: int = 10) -> Array:
    """The same loop in C with so many steps a sample; returns x, v, p1, p2, shape (samples, 4)."""
    out, number = np.zeros((samples, 4)), ctypes.c_double
    arrays = [a.ctypes.data_as(ctypes.POINTER(number)) for a in (REFERENCE, START, BASE, AREAS, out)]
    settings = [number(value) for value in (10.0, SMOOTHING, GAIN, LIMIT)]
    c.run(samples, number(PERIOD), steps, *arrays[:4], AREAS.size, *settings, arrays[4])
    return out


def lsoda(kernel: Kernel, samples: int) -> Callable[[], Array]:
    """The same smoothed equations, compiled, by scipy's LSODA, restarted at each sample; returns (samples, 4)."""
    rates = smoothed_rates(kernel)

    def run() -> Array:
        out = np.zeros((samples, 4))
        out[0] = START
        for k in range(samples - 1):
            u = min(max(GAIN * (REFERENCE[k] - out[k, 0]), -LIMIT), LIMIT)
            setting = (u, effective_area(u, 10.0, AREAS), BASE)
            out[k + 1] = odeint(rates, out[k], (0.0, PERIOD), args=setting, rtol=1e-6, atol=1e-9)[1]
        return out

    return run


def smoothed_rates(kernel: Kernel) -> Callable[..., Array]:
    """Rates of x, v, p1, p2 with tanh for the sign of friction, compiled."""
    flow = sys.modules[kernel.run.__module__].orifice_flow  # which compiled functions may call, and Python may not
    k_gas = math.sqrt(2.0 / (BASE[at.GAS] * BASE[at.TEMP]))

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


def fastest(*programs: Callable[[], object], runs: int) -> list[float]:
    """Shortest time of each program in s after one run to warm up; they take turns, so that all share the load."""
    for program in programs:
        program()
    return [min(times) for times in zip(*([elapsed(p) for p in programs] for _ in range(runs)), strict=True)]


def elapsed(run: Callable[[], object]) -> float:
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


DURATION, SMALL_DURATION = 10.0, 0.3  # s
CHANNELS = {"x": at.X, "v": at.V, "a": at.A, "p1": at.R1, "p2": at.R2}
FMU_VALVE = ValveArea((-5.0, -2.0, -0.5, 0.5, 2.0, 5.0), (1.8e-6, 6e-7, 8e-8, 8e-8, 6e-7, 1.8e-6), 0.1, 0.1)
INTERFACES = ("CoSimulation", "ModelExchange")
CASES = {
    "5/3": ("5/3", ("stribeck",)),
    "5/3, four effects": ("5/3", ("stribeck", "heat-transfer", "valve-lag", "piston-leak")),
    "two valves": ("two", ("stribeck",)),
    "two valves, four effects": ("two", ("friction-hysteresis", "stribeck", "line-delay", "valve-hysteresis")),
    "one chamber, bristles": ("one-chamber", ("presliding", "end-cushion", "pressure-lag")),
}


def axis(arrangement: str, effects: tuple[str, ...], duration: float) -> tuple[Model, Experiment]:
    """Return an axis with typical effects, and an experiment with steps of command and load."""
    rig = replace(RIG, valve_arrangement=arrangement)
    values = {"friction.coulomb": 14.0, "friction.viscous": 45.0}
    chosen = tuple(catalogue()[name] for name in effects)
    facts = rig_quantities(Model(rig, (), values, FMU_VALVE))
    values |= {f"{e.name}.{p.name}": p.range_on(facts).typical[0] for e in chosen for p in e.parameters}
    n = round(1e3 * duration) + 1
    steps = np.random.default_rng(1).uniform(-3.0, 3.0, n // 100 + 1)
    u = np.repeat(steps, 100)[:n]
    signals = {"u": u, "p1": np.full(n, 3e5), "p2": np.full(n, 3e5), "x": np.full(n, 0.1)}
    if arrangement == "two":
        signals["u2"] = -u[::-1]
    chamber_2 = "closed" if arrangement == "one-chamber" else "valve"
    experiment = prepare(noise_free_recording("axis", signals, chamber_2), rig, None)
    return Model(rig, chosen, values, FMU_VALVE), experiment


def simulated(model: Model, experiment: Experiment) -> np.ndarray:
    """Return the kernel's output, as plain Python."""
    return run_kernel(build(model.effects, compiled=False), model, experiment, experiment.inputs)


def in_fmpy(
    path: Path, plant: Plant, experiment: Experiment, first: np.ndarray, interface: str
) -> tuple[np.ndarray, float]:
    """Return what FMPy reads, and the seconds that it took, with the FMU unpacked before."""
    columns = {name: experiment.inputs[:, at.INPUTS.index(name)] for name in plant.inputs}
    signals = np.rec.fromarrays([experiment.time, *columns.values()], names=["time", *columns])
    start = {f"start.{name}": first[i] for name, i in (("x", at.X), ("v", at.V), ("p1", at.P1), ("p2", at.P2))}
    folder = fmpy.extract(str(path), unzipdir=str(path.parent / "unpacked"))
    began = time.perf_counter()
    result = fmpy.simulate_fmu(
        folder,
        fmi_type=interface,
        record_events=False,
        stop_time=float(experiment.time[-1]),
        step_size=1e-3,
        output_interval=1e-3,
        input=signals,
        start_values=start,
        output=list(CHANNELS),
    )
    return result, time.perf_counter() - began


def print_fmu(_: Sequence[str], *, is_small: bool) -> bool:
    """Print a row for each axis; return whether no difference is above 1e-6 of the range."""
    duration = SMALL_DURATION if is_small else DURATION
    cases = dict(list(CASES.items())[:1]) if is_small else CASES
    print(f"| axis | interface | largest difference, of the range | seconds in FMPy for {duration:g} s | file |")
    print("| --- | --- | --- | --- | --- |")
    worst = 0.0
    for name, (arrangement, effects) in cases.items():
        model, experiment = axis(arrangement, effects, duration)
        plant = plant_of(name, model, [experiment], {}, "benchmark")
        plant = replace(plant, flags=experiment.flags, max_step=experiment.max_step)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / FILE_NAME
            write_fmu(path.parent, plant, "benchmark")
            out = simulated(model, experiment)
            found = {one: in_fmpy(path, plant, experiment, out[0], one) for one in INTERFACES}
            size = path.stat().st_size
        ranges = {c: float(np.ptp(out[:, i])) for c, i in CHANNELS.items()}
        for interface, (result, seconds) in found.items():
            difference = max(float(np.max(np.abs(result[c] - out[:, i]))) / ranges[c] for c, i in CHANNELS.items())
            worst = max(worst, difference)
            figures = f"{difference:.2g} | {seconds:.2f} | {size // 1000} kB"
            print(f"| {name} ({', '.join(effects)}) | {interface} | {figures} |", flush=True)
    return worst <= 1e-6


TABLES: dict[str, Callable[..., object]] = {"kernel": print_kernel, "fmu": print_fmu}


def main(arguments: list[str]) -> int:
    """Print one of the tables, or of each a small one; return 1 where a limit of the project is exceeded."""
    return print_tables(TABLES, arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
