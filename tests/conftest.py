"""Compiled kernels are shared by all tests and runs of them, and kept apart from the user's own.

Of the processes of a run, one compiles a function; another that needs it waits and loads what the first one wrote.
"""

from __future__ import annotations

import gc
import getpass
import hashlib
import os
import tempfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numba
import pytest
from filelock import FileLock
from hypothesis import settings
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher
from numba.core.typed_passes import BaseNativeLowering

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


class Part(JITCodeLibrary):
    """Code that another function contains, which optimizes it and makes it machine code: a third less to compile.

    numba does both for a part alone, too, and again for each function on the way to the one that Python calls. The
    program leaves it at that, since older versions of numba have no place for a shorter way.
    """

    def finalize(self) -> None:
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        self._ensure_finalized()
        return 0  # it stands in no memory

    @property
    def codegen(self) -> Any:
        return SimpleNamespace(set_env=lambda name, env: None)


lower_here = BaseNativeLowering.run_pass


def lower_parts(lowering: Any, state: Any) -> bool:
    """Lower a function; one that Python cannot call is a part."""
    if state.flags.no_cpython_wrapper and state.flags.no_cfunc_wrapper and state.library is None:
        state.library = Part(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
    return lower_here(lowering, state)


if numba.version_info >= (0, 68):
    BaseNativeLowering.run_pass = lower_parts

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
