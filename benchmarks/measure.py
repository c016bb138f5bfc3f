"""Run one command of the program in a process of its own, and measure it.

The process samples itself: a timer of processor time interrupts it, and the time since the last interrupt counts for
the phase in which the main thread is. This costs next to nothing, whereas a profiler doubles the time of short
functions.
"""

from __future__ import annotations

import json
import os
import re
import runpy
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import pneucli

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
    "detectability": [("diagnose/detectability.py", "minimum_detectable_effects")],
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
    ("residuals/force_balance.py", "balance"),
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
            [sys.executable, "-m", "benchmarks.measure", str(report), *words],
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


def main(arguments: list[str]) -> None:
    """Run the command that follows the name of the report as ``python -m pneucli`` does."""
    report, sys.argv = Path(arguments[0]), ["pneucli", *arguments[1:]]
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


if __name__ == "__main__":
    main(sys.argv[1:])
