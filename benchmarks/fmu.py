"""The exported plant in FMPy against the simulation: ``python -m benchmarks.fmu``. Needs FMPy and a C compiler.

Ten seconds of an axis of the size of the demo, command and load in steps, called every millisecond. Printed are the
largest difference of x, v, a, p1 and p2 relative to the range of each, and the seconds of FMPy and of the FMU alone.
"""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np

from benchmarks import small
from benchmarks.simulate import RIG
from pneucli.export.fmu.package import FILE_NAME, write_fmu
from pneucli.export.fmu.plant import Plant, plant_of
from pneucli.physics.effects import catalogue
from pneucli.simulate import layout as at
from pneucli.simulate.build import build
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.open_loop import noise_free_recording
from pneucli.simulate.preparation import prepare
from pneucli.simulate.rig_quantities import rig_quantities
from pneucli.simulate.run import run_kernel
from pneucli.simulate.valve_forms.area import ValveArea

DURATION, SMALL_DURATION = 10.0, 0.3  # s
CHANNELS = {"x": at.X, "v": at.V, "a": at.A, "p1": at.R1, "p2": at.R2}
VALVE = ValveArea((-5.0, -2.0, -0.5, 0.5, 2.0, 5.0), (1.8e-6, 6e-7, 8e-8, 8e-8, 6e-7, 1.8e-6), 0.1, 0.1)
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
    facts = rig_quantities(Model(rig, (), values, VALVE))
    values |= {f"{e.name}.{p.name}": p.range_on(facts).typical[0] for e in chosen for p in e.parameters}
    n = round(1e3 * duration) + 1
    steps = np.random.default_rng(1).uniform(-3.0, 3.0, n // 100 + 1)
    u = np.repeat(steps, 100)[:n]
    signals = {"u": u, "p1": np.full(n, 3e5), "p2": np.full(n, 3e5), "x": np.full(n, 0.1)}
    if arrangement == "two":
        signals["u2"] = -u[::-1]
    chamber_2 = "closed" if arrangement == "one-chamber" else "valve"
    experiment = prepare(noise_free_recording("axis", signals, chamber_2), rig, None)
    return Model(rig, chosen, values, VALVE), experiment


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


def main(arguments: list[str]) -> int:
    """Print a row for each axis; return 1 where a difference is above 1e-6 of the range."""
    duration = SMALL_DURATION if small.SMALL in arguments else DURATION
    cases = dict(list(CASES.items())[:1]) if small.SMALL in arguments else CASES
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
    return int(worst > 1e-6)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
