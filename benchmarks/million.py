"""A recording of 1,000,000 samples through all stages of identification: ``python -m benchmarks.million [KIND] [N]``.

KIND is axis, friction or valve. Prints processor seconds and peak memory of each stage, in a process of its own.
"""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from pneucli.exam.laboratory import Laboratory, RecordingPlan
from pneucli.exam.rig.excitations import closed_loop, two_sine_reference, valve_staircase, valve_step
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.sensors import Sensors
from pneucli.exam.rig.simulation import Excitation

VESSEL = 160e-6  # m^3


def make(folder: Path, kind: str, samples: int) -> None:
    """Write a pipeline with one recording of ``samples`` rows at 1 kHz and, for an axis, a short test of its valve."""
    rng = np.random.default_rng(4)
    area = 0.0 if kind == "valve" else 8e-4
    rig = Parameters(piston_area_1=area, piston_area_2=area, overlap=0.0 if kind == "friction" else 0.15)
    bench = None if kind == "friction" else VESSEL
    laboratory = Laboratory(kind, rig, Sensors(400.0, 0.5, 0.0), vessel_volume=bench, has_cylinder=kind != "valve")
    takes = []
    if kind == "valve":
        parts = [
            valve_staircase(laboratory.valve_test_rig, 0.5, 1.6),
            *(valve_step(laboratory.valve_test_rig, v) for v in (1.0, 3.5, 8.0)),
        ]
        command = np.resize(np.concatenate([part.command for part in parts]), samples)
        takes = [RecordingPlan("long", "valve", "train", Excitation(command))]
    else:
        driven = closed_loop(rig, two_sine_reference(rng, samples), 150.0, 1.7e5)
        takes = [RecordingPlan("long", "axis" if kind == "axis" else "friction", "train", driven)]
    if kind == "axis":
        takes += [
            RecordingPlan(f"step_{v}", "valve", "train", valve_step(laboratory.valve_test_rig, v))
            for v in (0.5, 1.0, 3.5, 8.0)
        ]
    laboratory.record(folder / "raw", takes, rng)
    (folder / "pipeline.toml").write_text(laboratory.pipeline(takes, "raw"))


def main(arguments: list[str]) -> None:
    """Make the recording and time the stages."""
    kind = arguments[0] if arguments else "axis"
    samples = int(arguments[1]) if len(arguments) > 1 else 1_000_000
    stages = ("ingest", "identify", "compare", "diagnose")
    is_small = "--small" in arguments
    if is_small:
        kind, samples, stages = "valve", 6000, ("ingest",)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if is_small:
            make(folder, kind, samples)
        else:  # apart: what this process held would count as its children's
            maker = multiprocessing.get_context("spawn").Process(target=make, args=(folder, kind, samples))
            maker.start()
            maker.join()
        size = (folder / "raw" / "long.csv").stat().st_size / 1e6
        print(f"{kind}: {samples} samples, {size:.0f} MB of CSV")
        for stage in stages:
            print(f"{stage:9} {measured(stage, folder / 'pipeline.toml')}", flush=True)


def measured(stage: str, pipeline: Path) -> str:
    """Run a stage in a process of its own; return how it ended, its processor and wall time and its peak memory."""
    start = time.monotonic()
    command = [sys.executable, "-m", "pneucli", stage, str(pipeline), "--quiet"]
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(child.pid, 0)
    seconds, memory, wall = used.ru_utime + used.ru_stime, used.ru_maxrss / 1024, time.monotonic() - start
    child.returncode = os.waitstatus_to_exitcode(status)  # Popen does not see that it was waited for
    return f"exit {child.returncode} {seconds:6.1f} s of processor time ({wall:.1f} s), {memory:5.0f} MB"


if __name__ == "__main__":
    main(sys.argv[1:])
