"""Processor time and peak memory of ``ingest``, ``identify`` and ``diagnose``: ``python -m benchmarks.cost FOLDER...``.

FOLDER has a pipeline file, or folders that have one. ``--samples N,N`` adds an axis with one recording of N samples and
a short test of its valve (``--kind friction`` or ``valve``: another rig). ``--stages diagnose`` measures that stage
alone, ``--out DIR`` keeps the artifacts. Prints one Markdown table, with the median and the largest value of all
folders, then the share of each phase of ``diagnose``. The libraries' start is part of each time; a run in which numba
compiled is repeated.
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks import small
from benchmarks.measure import REST, Cost, measured
from pneucli.exam.laboratory import Laboratory, RecordingPlan
from pneucli.exam.rig.excitations import closed_loop, two_sine_reference, valve_staircase, valve_step
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.sensors import Sensors
from pneucli.exam.rig.simulation import Excitation

STAGES = ("ingest", "identify", "diagnose")
VESSEL = 160e-6  # m^3
SMALL_PIPELINE = Path(__file__).parents[1] / "fixtures" / "valve_null" / "pipeline.toml"
Row = dict[str, Cost]  # by stage


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


def pipelines(folder: Path) -> list[Path]:
    """Return the pipeline file of a folder, or those of the folders in it."""
    own = folder / "pipeline.toml"
    return [own] if own.is_file() else sorted(folder.glob("*/pipeline.toml"))


def measure(path: Path, stages: Sequence[str], out: Path) -> Row:
    """Run the stages of a pipeline file one after another; return the cost of each."""
    row: Row = {}
    for stage in STAGES:
        if stage in stages or stage == "ingest":
            cost = measured(stage, path, out)
            if cost.was_compiled:
                shutil.rmtree(out / stage, ignore_errors=True)
                cost = measured(stage, path, out)
            row[stage] = cost
    return {stage: row[stage] for stage in stages}


def cells(stages: Sequence[str], values: dict[str, tuple[float, float]]) -> str:
    """Return seconds and memory of each stage as cells of a table."""
    return " | ".join("{:.1f} | {:.0f}".format(*values[stage]) for stage in stages)


def header(stages: Sequence[str]) -> str:
    """Return the first lines of the table."""
    names = ["pipeline", *(f"{stage}, {unit}" for stage in stages for unit in ("s", "MB"))]
    return f"| {' | '.join(names)} |\n|{' --- |' * len(names)}"


def line(title: str, row: Row) -> str:
    """Return a line of the table; a stage that did not end with exit code 0 is marked."""
    marks = "".join(f" ({stage}: exit {cost.code})" for stage, cost in row.items() if cost.code)
    values = {stage: (cost.seconds, cost.memory) for stage, cost in row.items()}
    return f"| {title}{marks} | {cells(list(row), values)} |"


def summary(rows: Sequence[Row]) -> list[str]:
    """Return the lines with the median and the largest value of each column."""
    lines = []
    for title, choose in ((f"median of {len(rows)}", statistics.median), ("most", max)):
        values = {
            stage: (choose([row[stage].seconds for row in rows]), choose([row[stage].memory for row in rows]))
            for stage in rows[0]
        }
        lines.append(f"| {title} | {cells(list(rows[0]), values)} |")
    return lines


def shares(costs: Sequence[Cost]) -> list[str]:
    """Return a table with the processor time of each phase, summed over some diagnoses, and its share."""
    total: Counter[str] = Counter()
    for cost in costs:
        total.update(cost.phases)
        total[REST] += cost.seconds - sum(cost.phases.values())
    whole = sum(cost.seconds for cost in costs)
    listed = [*total.most_common(), ("of all these, compiled equations", sum(cost.kernels for cost in costs))]
    rows = [f"| {name} | {spent / len(costs):.2f} | {100 * spent / whole:.0f} |" for name, spent in listed]
    return ["| phase of `diagnose` | mean, s | share, % |", "| --- | --- | --- |", *rows]


def parsed(arguments: Sequence[str]) -> argparse.Namespace:
    """Return what the command line asks for."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.cost")
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--samples", default="")
    parser.add_argument("--kind", default="axis", choices=("axis", "friction", "valve"))
    parser.add_argument("--stages", default=",".join(STAGES))
    parser.add_argument("--out", type=Path)
    parser.add_argument(small.SMALL, action="store_true")
    return parser.parse_args(list(arguments))


def main(arguments: list[str]) -> None:
    """Print the table."""
    asked = parsed(arguments)
    os.environ["PNEUCLI_THREADS"] = "1"
    stages = asked.stages.split(",")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        paths = [path for one in asked.folders for path in pipelines(one)]
        if asked.small:
            paths, stages = [Path(shutil.copytree(SMALL_PIPELINE.parent, folder / "rig")) / "pipeline.toml"], ["ingest"]
        print(header(stages), flush=True)
        rows = []
        for path in paths:
            rows.append(measure(path, stages, (asked.out or folder / "out") / path.parent.name))
            print(line(path.parent.name, rows[-1]), flush=True)
        if rows:
            print("\n".join(summary(rows)), flush=True)
        for samples in [int(n) for n in asked.samples.split(",") if n]:
            made = folder / f"{samples}"
            made.mkdir()
            make(made, asked.kind, samples)
            rows.append(measure(made / "pipeline.toml", stages, made / "out"))
            print(line(f"{asked.kind}, {samples} samples", rows[-1]), flush=True)
        if "diagnose" in stages:
            print("\n".join(["", *shares([row["diagnose"] for row in rows])]))


if __name__ == "__main__":
    main(sys.argv[1:])
