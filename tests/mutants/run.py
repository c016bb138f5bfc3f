"""Mutants against tests: which tests run a line, each mutant in a copy of the tree, two at a time."""

import hashlib
import json
import multiprocessing
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from collections.abc import Set as AbstractSet
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from queue import Queue
from typing import Any, Literal

import pytest

from tests.mutants.places import Mutant

ROOT = Path(__file__).parents[2]
LIMIT = 20  # s of the processor a mutant, so that a busy machine kills no more and no fewer than an idle one
BUDGET = 8.0  # s of them that the chosen tests took when nothing was mutated
ASLEEP = 1200.0  # s after which a mutant that waits for something is given up, however busy the machine
TOGETHER = 2
FAILED = (1, 2, 4)  # pytest's exit code where a test fails, or where tests cannot even be imported
NOT_COPIED = (".git", ".venv", ".mypy_cache", ".ruff_cache", ".pytest_cache", ".hypothesis", "artifacts", "demo")
QUIET = ("-p", "no:cacheprovider", "-p", "no:xdist", "--no-header", "--assert=plain")  # nobody reads what differs
ENVIRONMENT = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONHASHSEED": "0"}
LIBRARIES = (
    *("hypothesis", "numba", "pint", "pyarrow.parquet", "pydantic", "pytest", "scipy.optimize", "scipy.signal"),
    "scipy.stats",
)
_FORKS = multiprocessing.get_context("forkserver")
_FORKS.set_forkserver_preload([*LIBRARIES, __name__])
Outcome = Literal["killed", "survived", "timeout", "no test"]


@dataclass(frozen=True)
class Contexts:
    """Which tests, and fixtures that they share, run each line of each file, and the seconds that each takes itself.

    ``shares`` holds the shared fixtures of each test.
    """

    seconds: dict[str, float]
    shares: dict[str, list[str]]
    lines: dict[str, dict[str, list[str]]]

    def tests(self, mutant: Mutant) -> list[str]:
        """Return the tests that run the mutated statement, fastest first, as many as the time allows.

        What runs on import, and what is compiled, no tracer sees: for that, all tests that run anything of the file's
        folder stand in.
        """
        lines = self.lines.get(mutant.file, {})
        found = self._of({one for line in mutant.lines for one in lines.get(str(line), [])})
        if not found:
            folder = mutant.file.rpartition("/")[0]
            files = [at for file, at in self.lines.items() if file.rpartition("/")[0] == folder]
            found = self._of({one for at in files for names in at.values() for one in names})
        chosen: list[str] = []
        made: set[str] = set()
        spent = 0.0
        for test in sorted(found, key=self.takes):
            takes = self.takes(test, made)
            if not chosen or spent + takes <= BUDGET:
                chosen.append(test)
                made |= set(self.shares[test])
                spent += takes
        return chosen

    def takes(self, test: str, made: AbstractSet[str] = frozenset()) -> float:
        """Return the seconds of a test, its shared fixtures included but for those that are ``made`` already."""
        return self.seconds[test] + sum(self.seconds.get(one, 0.0) for one in self.shares[test] if one not in made)

    def _of(self, names: AbstractSet[str]) -> set[str]:
        """Return the tests among names of tests and fixtures, and those that share one of these."""
        return {test for test, shares in self.shares.items() if test in names or names.intersection(shares)}


def copied(target: Path, tree: Path = ROOT) -> Path:
    """Copy a tree with its times, so that what is compiled stays valid."""
    return Path(shutil.copytree(tree, target, ignore=shutil.ignore_patterns(*NOT_COPIED)))


def contexts(tree: Path, packages: Sequence[str], folders: Sequence[str]) -> Contexts:
    """Return which lines the tests of all folders run.

    Raises SystemExit where a test fails without any mutant.
    """
    with ThreadPoolExecutor(TOGETHER) as pool:
        found = list(pool.map(lambda folder: _contexts(tree, packages, folder), folders))
    if failed := [test for one in found for test in one["failed"]]:
        sys.exit("tests fail though nothing is mutated: " + ", ".join(failed))
    seconds, shares = ({test: row for one in found for test, row in one[key].items()} for key in ("seconds", "shares"))
    lines: dict[str, dict[str, list[str]]] = defaultdict(lambda: defaultdict(list))
    for file, line, names in ((f, k, n) for one in found for f, at in one["lines"].items() for k, n in at.items()):
        lines[file][line] += names
    return Contexts(seconds, shares, lines)


def _contexts(tree: Path, packages: Sequence[str], folder: str) -> dict[str, Any]:
    """Return what the plug-in says of the tests of one folder, or what it said where nothing has changed since."""
    out = Path(tempfile.gettempdir(), f"pneucli-mutants-{_digest(tree, packages, folder)}.json")
    if not out.exists():
        more = {"MUTANTS_CONTEXTS": str(out), "MUTANTS_SOURCE": ",".join(packages)}
        command = [sys.executable, "-m", "pytest", *QUIET, "-p", "tests.mutants.contexts", folder]
        subprocess.run(command, cwd=tree, env=os.environ | more, check=False)
    if not out.exists():
        sys.exit(f"the tests of {folder} did not run")
    found: dict[str, Any] = json.loads(out.read_text())
    if found["failed"]:
        out.unlink()
    return found


def _digest(tree: Path, packages: Sequence[str], folder: str) -> str:
    """Return a name for all that the tests of a folder depend on: the tests of other folders do not matter."""
    every = sorted(file for top in ("pneucli", "tests") for file in (tree / top).rglob("*.py"))
    files = [f for f in every if not f.name.startswith("test_") or f.is_relative_to(tree / folder)]
    return hashlib.sha256("".join([*packages, folder, *(f.read_text() for f in files)]).encode()).hexdigest()[:16]


def outcomes(
    mutants: Sequence[Mutant], known: Contexts, trees: Sequence[Path], done: Callable[[Mutant, Outcome], None]
) -> list[Outcome]:
    """Return what becomes of each mutant; ``done`` hears of each as it ends.

    Raises SystemExit where tests fail in a copy though nothing is mutated: then they would kill everything.
    """
    quick = sorted(known.shares, key=known.takes)[:50]
    if any(_outcome(tree, quick) != "survived" for tree in trees):
        sys.exit("tests fail in a copy of the tree though nothing is mutated")
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

    Compiled functions of files of its folder that import it are forgotten: they hold what was mutated.
    """
    file = tree / mutant.file
    if file.read_text() != mutant.was:
        raise RuntimeError(f"{file} is not what was mutated")
    kept = shutil.copy2(file, tree / "kept")
    compiled = _compiled(file)
    aside = tree / "compiled"
    aside.mkdir()
    for one in compiled:
        shutil.move(one, aside / one.name)
    try:
        file.write_text(mutant.text)
        yield
    finally:
        os.replace(kept, file)
        for one in _compiled(file):
            one.unlink()
        for one in compiled:
            shutil.move(aside / one.name, one)
        aside.rmdir()


def _compiled(file: Path) -> list[Path]:
    """Return the compiled functions of a file, and of those in its folder that import it, directly or not."""
    texts = {one.stem: one.read_text() for one in file.parent.glob("*.py")}
    found: set[str] = set()
    more = {file.stem}
    while more:
        found |= more
        imports = re.compile(rf"^(?:from|import) .*\b(?:{'|'.join(found)})\b", re.MULTILINE)
        more = {name for name, text in texts.items() if imports.search(text)} - found
    return [one for one in (file.parent / "__pycache__").glob("*.nb?") if one.name.partition(".")[0] in found]


def _outcome(tree: Path, tests: Sequence[str]) -> Outcome:
    if not tests:
        return "no test"
    process = _FORKS.Process(target=_fails, args=(str(tree), ["-x", "--tb=no", *tests]))
    process.start()
    process.join(ASLEEP)
    if process.is_alive():
        process.kill()
        process.join()
    code = process.exitcode
    if code in (-signal.SIGKILL, -signal.SIGXCPU):
        return "timeout"
    if code is None or code > max(FAILED):
        raise RuntimeError(f"pytest ended with {code}, running {' '.join(tests)}")
    return "killed" if code in FAILED or code < 0 else "survived"


def _fails(tree: str, arguments: list[str]) -> None:
    """Run tests in a fork that has the libraries loaded, but nothing of this tree yet; ends with pytest's exit code."""
    resource.setrlimit(resource.RLIMIT_CPU, (LIMIT, LIMIT))
    for name in [n for n in sys.modules if n.partition(".")[0] in ("pneucli", "tests")]:
        del sys.modules[name]
    os.chdir(tree)
    sys.path[0], sys.dont_write_bytecode = tree, True
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        os.dup2(nowhere.fileno(), 2)
        sys.exit(pytest.main([*QUIET, *arguments]))
