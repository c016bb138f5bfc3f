"""Compiled kernels are shared by all tests and runs of them, and kept apart from the user's own.

Of the processes of a run, one compiles a function; another that needs it waits and loads what the first one wrote.
"""

import gc
import getpass
import hashlib
import os
import tempfile
from pathlib import Path
from typing import Any

import pytest
from filelock import FileLock
from hypothesis import settings
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher

gc.set_threshold(100_000, 50, 100)  # a compiler makes many objects, and few that are garbage
os.environ.setdefault("PNEUCLI_CACHE", str(Path(tempfile.gettempdir(), f"pneucli-tests-{getpass.getuser()}")))

compile_here = Dispatcher.compile


def compile_once(function: Any, signature: Any) -> Any:
    """Compile or load a function while no other process compiles it; threads take the locks in the same order."""
    name = f"{function.py_func.__code__.co_filename} {function.py_func.__qualname__} {signature}"
    folder = Path(os.environ["PNEUCLI_CACHE"], "locks")
    folder.mkdir(parents=True, exist_ok=True)
    with global_compiler_lock, FileLock(folder / hashlib.sha256(name.encode()).hexdigest()[:24]):
        return compile_here(function, signature)


if "PYTEST_XDIST_WORKER" in os.environ:
    Dispatcher.compile = compile_once


# the same examples each time: a run that fails says that something changed
settings.register_profile("pneucli", derandomize=True, deadline=None, max_examples=25)
settings.load_profile("pneucli")

# simulations with a controller; together, so that one of the processes of a run compiles their large kernels
WITH_CONTROLLER = ("closed_loop", "controller", "design", "export", "stages/test_design", "test_benchmarks", "exam")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the tests that simulate a controller first; processes get contiguous shares of all tests."""
    here = Path(__file__).parent
    items.sort(key=lambda item: not item.path.relative_to(here).as_posix().startswith(WITH_CONTROLLER))


def pytest_collection_finish() -> None:
    """Look for garbage only among what the tests make: of all that was imported there is none."""
    gc.freeze()
