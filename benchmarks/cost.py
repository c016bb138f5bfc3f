"""Processor time and peak memory of ``ingest``, ``identify`` and ``diagnose``: ``python -m benchmarks.cost FOLDER...``.

FOLDER has a pipeline file, or folders that have one. ``--samples N,N`` adds an axis with one recording of N samples and
a short test of its valve (``--kind friction`` or ``valve``: another rig). ``--stages diagnose`` measures that stage
alone, ``--out DIR`` keeps the artifacts, ``--beside CHECKOUT`` adds the start of each stage, interpreter and imports,
here and by the program of that folder, which has its own ``.venv``. Prints one Markdown table, with the median and the
largest value of all folders, then the share of each phase of ``diagnose``. The libraries' start is part of each time; a
run in which numba compiled is repeated.

The measured process samples itself: a timer of processor time interrupts it, and the time since the last interrupt
counts for the phase in which the main thread is. A profiler would double the time of short functions. This module
imports nothing that the program does not.
"""

import argparse
import json
import os
import re
import runpy
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import pneucli

SAMPLED = "--sampled"  # REPORT COMMAND...: how this module runs and samples one command
PERIOD = 0.002  # s of processor time between two samples
REST = "the rest"
IMPORTS = "imports"
PHASES = {
    IMPORTS: [("importlib._bootstrap>", "_find_and_load")],
    "loading of compiled code": [
        ("pneucli/caches.py", "load_or_empty"),
        ("pneucli/caches.py", "import_generated"),
        ("pneucli/caches.py", "compiled"),
    ],
    "reading and preparing": [
        ("stages/diagnose.py", "_diagnosis_data"),
        ("guesses/base_model.py", "guess_base_model"),
        ("stages/pipeline_data.py", "experiments"),
    ],
    "first fit": [("estimation/model_fit.py", "fit_model")],
    "screen": [("diagnose/data.py", "signatures_of")],
    "refits": [("estimation/model_fit.py", name) for name in ("fit_with_effect", "refit", "fit_without")],
    "costs and tests": [("diagnose/data.py", name) for name in ("fitted_model", "candidate")],
    "lack of fit": [("diagnose/data.py", "lack_of_fit")],
    "smooth terms": [("diagnose/spline_regression.py", name) for name in ("_term_designs", "_fit_smooth_term")],
    "equivalents": [("diagnose/equivalence.py", "equivalents")],
    "free-run error": [("diagnose/free_run_error.py", "channels")],
    "intervals": [("estimation/intervals.py", "with_intervals")],
    "detectability": [("diagnose/diagnosis.py", "minimum_detectable_effects")],
    "fit of all recordings, baseline": [
        ("stages/changes.py", "write_baseline"),
        ("stages/changes.py", "fit_all_recordings"),
        ("stages/changes.py", "compare_with_baseline"),
    ],
}


KERNELS = {
    ("simulate/run.py", "_outputs"),
    ("simulate/derivatives.py", "derivatives"),
    ("simulate/outputs.py", "required_force"),
    ("simulate/outputs.py", "_force_residual"),
    ("residuals/chambers.py", "balance"),
}  # what calls compiled equations


@dataclass(frozen=True)
class Cost:
    """What a command cost: exit code, processor and wall time (s), peak memory (MB), and processor time by phase (s).

    ``kernels``: processor time (s) in the compiled equations of simulations and force balances, part of the phases.
    ``was_compiled``: numba compiled functions in it, so that it measures nothing.
    """

    code: int
    seconds: float
    wall: float
    memory: float
    was_compiled: bool
    kernels: float
    phases: dict[str, float]

    def __str__(self) -> str:
        return f"exit {self.code} {self.seconds:6.1f} s of processor time ({self.wall:.1f} s), {self.memory:5.0f} MB"


@cache
def environment() -> dict[str, str]:
    """Return the environment of a measured command: as installed, the program's byte code is on disk."""
    variables = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    subprocess.run([sys.executable, "-m", "compileall", "-q", pneucli.__path__[0]], env=variables, check=True)
    return variables


def measured(stage: str, pipeline: Path, out: Path | None = None) -> Cost:
    """Run a command on a pipeline file; return its cost, that of its children included."""
    with tempfile.TemporaryDirectory() as name:
        report = Path(name) / "report.json"
        words = [stage, str(pipeline), "--quiet", *(["--out", str(out)] if out else [])]
        start = time.monotonic()
        child = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.cost", SAMPLED, str(report), *words],
            stdout=subprocess.DEVNULL,
            env=environment(),
        )
        _, status, used = os.wait4(child.pid, 0)
        wall = time.monotonic() - start
        child.returncode = os.waitstatus_to_exitcode(status)  # Popen does not see that it was waited for
        found = json.loads(report.read_text(encoding="utf-8"))
    return Cost(child.returncode, used.ru_utime + used.ru_stime, wall, **found)


class Sampler:
    """Counts the processor time of this process by phase."""

    def __init__(self) -> None:
        self.seconds: Counter[str] = Counter()
        self.kernels = 0.0
        self._phase_of: dict[CodeType, str | None] = {}
        self._last = 0.0

    def start(self) -> None:
        """Start the timer; what the process has used so far counts as the rest."""
        signal.signal(signal.SIGPROF, self._sample)
        signal.setitimer(signal.ITIMER_PROF, PERIOD, PERIOD)

    def stop(self) -> None:
        """Stop the timer."""
        signal.setitimer(signal.ITIMER_PROF, 0.0)

    def _sample(self, _: int, frame: FrameType | None) -> None:
        now, phase = time.process_time(), None
        if frame is not None and any(
            frame.f_code.co_name == n and frame.f_code.co_filename.endswith(f) for f, n in KERNELS
        ):
            self.kernels += now - self._last
        while frame is not None and phase is None:
            phase = self._phase(frame.f_code)
            frame = frame.f_back
        self.seconds[phase or REST] += now - self._last
        self._last = now

    def _phase(self, code: CodeType) -> str | None:
        if code not in self._phase_of:
            named = [(phase, file) for phase, places in PHASES.items() for file, name in places if name == code.co_name]
            self._phase_of[code] = next((phase for phase, file in named if code.co_filename.endswith(file)), None)
        return self._phase_of[code]


def peak_memory() -> float:
    """Return the peak of the resident memory of this process in MB; what its parent held does not count."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    found = re.search(r"VmHWM:\s+(\d+) kB", status)
    assert found is not None
    return int(found[1]) / 1024


def was_compiled() -> bool:
    """Return whether this process compiled a function that the cache did not have; such a run measures the compiler."""
    if "numba.core.dispatcher" not in sys.modules:
        return False
    dispatcher: Any = sys.modules["numba.core.dispatcher"]
    objects = [o for module in list(sys.modules.values()) for o in list(vars(module).values())]
    return any(sum(o.stats.cache_misses.values()) for o in objects if isinstance(o, dispatcher.Dispatcher))


def run_sampled(report: Path, words: Sequence[str]) -> None:
    """Run a command as ``python -m pneucli`` does, and write what it cost this process."""
    sys.argv = ["pneucli", *words]
    sampler = Sampler()
    sampler.start()
    try:
        runpy.run_module("pneucli", run_name="__main__", alter_sys=True)
    finally:
        sampler.stop()
        found = {
            "memory": peak_memory(),
            "was_compiled": was_compiled(),
            "kernels": sampler.kernels,
            "phases": dict(sampler.seconds),
        }
        report.write_text(json.dumps(found), encoding="utf-8")


STAGES = ("ingest", "identify", "diagnose")
START_RUNS = 5  # of which the shortest counts
START = """
import sys
from pneucli.pipeline import runner
try:
    runner._run(runner.STAGES[sys.argv[1]], None, None)
except AttributeError:
    pass  # it has imported the stage, and looks into the pipeline that there is not
"""
SMALL_PIPELINE = Path(__file__).parents[1] / "fixtures" / "valve_null" / "pipeline.toml"
Row = dict[str, Cost]  # by stage


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


def started(stage: str, python: Path, program: Path) -> float:
    """Return the processor time in s that a program needs to start and to import a stage."""
    spent = []
    for _ in range(START_RUNS):
        child = subprocess.Popen([python, "-c", START, stage], cwd=program, env=environment())
        _, status, used = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        spent.append(used.ru_utime + used.ru_stime)
    return min(spent)


def starts(stages: Sequence[str], other: Path) -> list[str]:
    """Return the table of the start of each stage here and by another program, by turns in one run."""
    own, former = (Path(sys.executable), Path(__file__).parents[1]), (other / ".venv/bin/python", other)
    started(stages[0], *former)  # whose byte code is then on disk
    rows = [(stage, started(stage, *own), started(stage, *former)) for stage in stages]
    shown = [f"| {stage} | {here:.2f} | {there:.2f} | {here / there:.2f} |" for stage, here, there in rows]
    return ["", f"| start | here, s | {other.name}, s | ratio |", "| --- | --- | --- | --- |", *shown]


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
    parser.add_argument("--beside", type=Path)
    parser.add_argument("--small", action="store_true")
    return parser.parse_args(list(arguments))


def main(arguments: list[str]) -> None:
    """Print the tables, or run one command and sample it."""
    if arguments[:1] == [SAMPLED]:
        run_sampled(Path(arguments[1]), arguments[2:])
    else:
        print_costs(parsed(arguments))


def print_costs(asked: argparse.Namespace) -> None:
    """Print the table of costs, then the shares of the phases of ``diagnose``."""
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
            from benchmarks.rigs import write_long_recording  # a measured process imports this module, not the rigs

            write_long_recording(made, asked.kind, samples)
            rows.append(measure(made / "pipeline.toml", stages, made / "out"))
            print(line(f"{asked.kind}, {samples} samples", rows[-1]), flush=True)
        if asked.beside:
            print("\n".join(starts(stages, asked.beside.absolute())), flush=True)
        if "diagnose" in stages and rows:
            print("\n".join(["", *shares([row["diagnose"] for row in rows])]))


if __name__ == "__main__":
    main(sys.argv[1:])
