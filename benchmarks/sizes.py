"""Many recordings, and files much wider than what is asked of them: ``python -m benchmarks.sizes [RECORDINGS...]``.

Prints processor seconds and peak memory of the stages with 125, 250 and 500 recordings of a valve test, then of
``ingest`` of eight HDF5 files with a camera's image of 100 MB beside the signals, and of the same without it.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np

from benchmarks.cost import VESSEL
from benchmarks.measure import measured
from pneucli.exam.laboratory import Laboratory, RecordingPlan
from pneucli.exam.rig.excitations import valve_step
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.sensors import Sensors

COUNTS = (125, 250, 500)
STAGES = ("ingest", "identify", "compare")
FILES, IMAGE = 8, (100, 1000, 1000)  # bytes of a camera


def valve_tests(folder: Path, count: int) -> Path:
    """Write ``count`` step responses of one valve; return the pipeline file."""
    rig = Parameters(piston_area_1=0.0, piston_area_2=0.0, overlap=0.15)
    laboratory = Laboratory("valve", rig, Sensors(400.0, 0.5, 0.0), vessel_volume=VESSEL, has_cylinder=False)
    steps = [valve_step(laboratory.valve_test_rig, v) for v in np.geomspace(0.5, 10.0, 10)]
    takes = [RecordingPlan(f"step_{n}", "valve", "train", steps[n % len(steps)]) for n in range(count)]
    laboratory.record(folder / "raw", takes, np.random.default_rng(4))
    (folder / "pipeline.toml").write_text(laboratory.pipeline(takes, "raw"))
    return folder / "pipeline.toml"


def with_images(folder: Path, *, image: bool, count: int = FILES) -> Path:
    """Write so many step responses as HDF5, an image in each; return the pipeline file."""
    path = valve_tests(folder, count)
    for raw in sorted((folder / "raw").glob("*.csv")):
        lines = [line for line in raw.read_text().splitlines() if not line.startswith("#")]
        names, values = lines[0].split(","), np.loadtxt(lines[1:], delimiter=",")
        with h5py.File(raw.with_suffix(".h5"), "w") as file:
            for name, column in zip(names, values.T, strict=True):
                file[name.replace("/", "|")] = column
            if image:
                file["camera"] = np.random.default_rng(1).integers(0, 255, IMAGE, dtype=np.uint8)
    path.write_text(path.read_text().replace(".csv", ".h5"))
    return path


def main(arguments: list[str]) -> None:
    """Make the files and run the stages; ``--small``: ingest of the HDF5 files without an image."""
    is_small = "--small" in arguments
    for count in () if is_small else [int(count) for count in arguments] or COUNTS:
        with tempfile.TemporaryDirectory() as name:
            path = valve_tests(Path(name), count)
            for stage in STAGES:
                print(f"{count} recordings, {stage:9} {measured(stage, path)}", flush=True)
    for image in (False,) if is_small else (True, False):
        with tempfile.TemporaryDirectory() as name:
            count = 2 if is_small else FILES
            path = with_images(Path(name), image=image, count=count)
            size = sum(raw.stat().st_size for raw in path.parent.glob("raw/*.h5")) / 1e6
            print(f"{count} HDF5 files, {size:.0f} MB, ingest {measured('ingest', path)}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
