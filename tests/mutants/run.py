"""Mutants against tests: which tests run a line, each mutant in a copy of the tree, two at a time."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from queue import Queue
from typing import Literal

from tests.mutants.places import Mutant

ROOT = Path(__file__).parents[2]
LIMIT = 20.0  # s a mutant
BUDGET = 12.0  # s that the chosen tests took when nothing was mutated: what a busy machine still ends within LIMIT
TOGETHER = 2
FAILED = (1, 2)  # pytest's exit code where a test fails, or where the code cannot even be imported
NOT_COPIED = (".git", ".venv", ".mypy_cache", ".ruff_cache", ".pytest_cache", ".hypothesis", "artifacts", "demo")
Outcome = Literal["killed", "survived", "timeout", "no test"]


@dataclass(frozen=True)
class Contexts:
    """Which tests run each line of each file, and the seconds that each test takes."""

    seconds: dict[str, float]
    lines: dict[str, dict[str, list[str]]]

    def tests(self, mutant: Mutant) -> list[str]:
        """Return the tests that run the mutated statement, fastest first, as many as the time allows.

        What runs on import, and what is compiled, no tracer sees: for that, all tests that run anything of the file's
        folder stand in.
        """
        lines = self.lines.get(mutant.file, {})
        found = {test for line in mutant.lines for test in lines.get(str(line), [])}
        if not found:
            folder = mutant.file.rpartition("/")[0]
            files = [at for file, at in self.lines.items() if file.rpartition("/")[0] == folder]
            found = {test for at in files for tests in at.values() for test in tests}
        chosen, spent = [], 0.0
        for test in sorted(found, key=lambda t: self.seconds[t]):
            spent += self.seconds[test]
            if chosen and spent > BUDGET:
                break
            chosen.append(test)
        return chosen


def copied(target: Path) -> Path:
    """Copy the tree with its times, so that what is compiled stays valid."""
    return Path(shutil.copytree(ROOT, target, ignore=shutil.ignore_patterns(*NOT_COPIED)))


def contexts(tree: Path, packages: Sequence[str], folders: Sequence[str]) -> Contexts:
    """Run all tests once and return which lines they run. Raises SystemExit where one fails without any mutant."""
    out = tree / "contexts.json"
    more = {"MUTANTS_CONTEXTS": str(out), "MUTANTS_SOURCE": ",".join(packages)}
    subprocess.run(_pytest(["-p", "tests.mutants.contexts", *folders]), cwd=tree, env=_environment(more), check=False)
    if not out.exists():
        sys.exit("the tests did not run")
    found = json.loads(out.read_text())
    if found["failed"]:
        sys.exit("tests fail though nothing is mutated: " + ", ".join(found["failed"]))
    return Contexts(found["seconds"], found["lines"])


def outcomes(
    mutants: Sequence[Mutant], known: Contexts, trees: Sequence[Path], done: Callable[[Mutant, Outcome], None]
) -> list[Outcome]:
    """Return what becomes of each mutant; ``done`` hears of each as it ends."""
    free: Queue[Path] = Queue()
    for tree in trees:
        free.put(tree)

    def one(mutant: Mutant) -> Outcome:
        tree = free.get()
        try:
            with mutated(tree, mutant):
                outcome = _outcome(tree, known.tests(mutant))
        finally:
            free.put(tree)
        done(mutant, outcome)
        return outcome

    with ThreadPoolExecutor(len(trees)) as pool:
        return list(pool.map(one, mutants))


@contextmanager
def mutated(tree: Path, mutant: Mutant) -> Iterator[None]:
    """The copy with the mutant in it; afterwards the file is as it was, its times too.

    Compiled functions of its folder are forgotten: they may hold what was mutated, from another file.
    """
    file = tree / mutant.file
    if file.read_text() != mutant.was:
        raise RuntimeError(f"{file} is not what was mutated")
    kept = shutil.copy2(file, tree / "kept")
    compiled = list((file.parent / "__pycache__").glob("*.nb?"))
    aside = tree / "compiled"
    aside.mkdir()
    for one in compiled:
        shutil.move(one, aside / one.name)
    try:
        file.write_text(mutant.text)
        yield
    finally:
        os.replace(kept, file)
        for one in (file.parent / "__pycache__").glob("*.nb?"):
            one.unlink()
        for one in compiled:
            shutil.move(aside / one.name, one)
        aside.rmdir()


def _outcome(tree: Path, tests: Sequence[str]) -> Outcome:
    if not tests:
        return "no test"
    process = subprocess.Popen(
        _pytest(["-x", "--tb=no", *tests]),
        cwd=tree,
        env=_environment({"PYTHONDONTWRITEBYTECODE": "1"}),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        code = process.wait(LIMIT)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        return "timeout"
    if code > max(FAILED):
        raise RuntimeError(f"pytest ended with {code}, running {' '.join(tests)}")
    return "killed" if code in FAILED or code < 0 else "survived"


def _pytest(arguments: Sequence[str]) -> list[str]:
    return [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-p", "no:xdist", "--no-header", *arguments]


def _environment(more: dict[str, str]) -> dict[str, str]:
    return {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONHASHSEED": "0", **more}
