"""Where the time of a diagnosis goes: ``python -m benchmarks.diagnose PIPELINE...`` (default: the demo's).

Prints, for each pipeline file, the processor seconds of ``pneucli diagnose`` behind ``ingest`` in a process of its own,
its start included, and which share of them each phase takes. The shares come from a second run under the profiler,
on one thread.
"""

from __future__ import annotations

import cProfile
import os
import pstats
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks import small
from pneucli.notebook.run import open_pipeline_of

PHASES = {
    "reading and preparing": [("stages/diagnose.py", "_diagnosis_data")],
    "first fit": [("identify/estimation/model_fit.py", "fit_model")],
    "screening": [("diagnose/data.py", "signatures_of")],
    "refits": [("identify/estimation/model_fit.py", name) for name in ("fit_with_effect", "refit", "fit_without")],
    "held-out recordings and tests": [("diagnose/data.py", name) for name in ("fitted_model", "candidate")],
    "what is left": [("diagnose/data.py", "lack_of_fit")],
    "the error that users see": [("diagnose/free_run_error.py", "__call__")],
    "intervals": [("identify/estimation/intervals.py", "with_intervals")],
    "what could not be seen": [("diagnose/detectability.py", "minimum_detectable_effects")],
    "for later comparisons": [("stages/changes.py", "write_baseline")],
}
ALL = ("stages/diagnose.py", "run")
SMALL_PIPELINE = Path(__file__).parents[1] / "fixtures" / "valve_null" / "pipeline.toml"


def seconds(path: Path, out: Path) -> float:
    """Return the processor seconds of a diagnosis, at a prepared ``out``."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "pneucli", "diagnose", str(path), "--out", str(out), "--json", "--quiet"]
    subprocess.run(command, check=False, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def shares(path: Path, out: Path) -> dict[str, float]:
    """Return the share of each phase, of a diagnosis in this process at a prepared ``out``."""
    profile = cProfile.Profile()
    with profile:
        open_pipeline_of(path, out).update(["diagnose"])
    times: dict[tuple[str, str], float] = {}
    for (file, _, name), row in pstats.Stats(profile).stats.items():  # type: ignore[attr-defined]
        key = "/".join(Path(file).parts[-2:]), name
        times[key] = times.get(key, 0.0) + row[3]
    found = {phase: sum(times.get(one, 0.0) for one in those) for phase, those in PHASES.items()}
    return {phase: spent / times[ALL] for phase, spent in found.items()}


def main(arguments: list[str]) -> None:
    """Measure each pipeline file, then the median."""
    os.environ["PNEUCLI_THREADS"] = "1"
    if small.SMALL not in arguments:
        measure([Path(one) for one in arguments] or [Path("pipelines/demo.toml")])
        return
    with tempfile.TemporaryDirectory() as name:
        path = Path(shutil.copytree(SMALL_PIPELINE.parent, Path(name) / "rig")) / SMALL_PIPELINE.name
        small.shorten(path)
        measure([path])


def measure(paths: list[Path]) -> None:
    """Print seconds and shares of each pipeline file, then the median."""
    spent = []
    for path in paths:
        with tempfile.TemporaryDirectory() as name:
            for out in ("timed", "profiled"):
                open_pipeline_of(path, Path(name) / out).update(["ingest"])
            spent.append(seconds(path, Path(name) / "timed"))
            parts = shares(path, Path(name) / "profiled")
        told = ", ".join(f"{phase} {100 * share:.0f} %" for phase, share in parts.items() if share > 0.005)
        rest = 100 * (1 - sum(parts.values()))
        print(f"{path.parent.name}/{path.name}: {spent[-1]:.1f} s; {told}; else {rest:.0f} %", flush=True)
    print(f"median {statistics.median(spent):.1f} s, most {max(spent):.1f} s, of {len(spent)}")


if __name__ == "__main__":
    main(sys.argv[1:])
