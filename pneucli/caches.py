"""Cache compiled functions on disk where possible; compile them again where the cache is unreadable."""

import hashlib
import importlib.util
import logging
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from types import ModuleType, SimpleNamespace
from typing import Any, TypeVar, cast

from pneucli.imports import hidden_modules
from pneucli.paths import cache_folder

with hidden_modules("coverage", "yaml"):  # numba loads them, and uses them for its own tests and a file of settings
    import numba
from numba import njit
from numba.core.caching import FunctionCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.runtime.nrt import rtsys

Function = TypeVar("Function", bound=Callable[..., Any])
_LOG = logging.getLogger(__name__)


def import_generated(text: str, prefix: str) -> ModuleType:
    """Import Python text as a module, so that numba caches what it compiles of it.

    Args:
        text: The module's text.
        prefix: The start of the module's name; a hash of the text follows.

    Returns:
        The module; its file is written to the folder ``kernels`` of the cache where it is missing.
    """
    name = f"{prefix}_{hashlib.sha256(text.encode()).hexdigest()[:24]}"
    if name in sys.modules:
        return sys.modules[name]
    folder = cache_folder() / "kernels"
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.py"
    if not path.is_file() or path.read_bytes() != text.encode():
        draft = folder / f".{name}.{os.getpid()}"
        draft.write_bytes(text.encode())
        draft.replace(path)
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    for function in vars(module).values():
        if isinstance(getattr(function, "_cache", None), FunctionCache) and function.py_func.__module__ == name:
            with_cache_fallback(function)
    sys.modules[name] = module  # where numba looks for what it cached
    return module


def compiled(**options: Any) -> Callable[[Function], Function]:
    """Return a decorator: numba's ``njit`` with a cache on disk and these options."""

    def decorate(function: Function) -> Function:
        try:
            made = njit(cache=True, **options)(function)
        except RuntimeError:  # numba finds no writable folder
            numba.config.CACHE_DIR = str(cache_folder())  # type: ignore[attr-defined]
            made = njit(cache=True, **options)(function)
        return cast("Function", with_cache_fallback(made))

    return decorate


class _PartLibrary(JITCodeLibrary):
    """Code that only other code contains: it is optimised, and becomes machine code, once, as a part of that."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()  # type: ignore[no-untyped-call]
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return 0: there is nothing to run."""
        self._ensure_finalized()  # type: ignore[no-untyped-call]
        return 0

    @property
    def codegen(self) -> Any:
        """What would give the function's objects of Python a place; without machine code there is none."""
        return SimpleNamespace(set_env=lambda name, environment: None)


class _PartCompiler(Compiler):
    """Numba's compiler, of a :class:`_PartLibrary`."""

    def define_pipelines(self) -> list[Any]:
        """Return numba's own pipelines."""
        name, made_for = self.state.func_id.func_qualname, self.state.targetctx.codegen()
        self.state.library = _PartLibrary(made_for, name)  # type: ignore[no-untyped-call]
        self.state.library.enable_object_caching()
        return cast("list[Any]", super().define_pipelines())  # type: ignore[no-untyped-call]


def part(**options: Any) -> Callable[[Function], Function]:
    """Return a decorator of functions that only compiled ones call; called from Python one would end the process.

    Without the wrappers for Python, machine code and a place of its own in the cache, what calls it compiles in half
    the time.
    """
    without: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "pipeline_class": _PartCompiler}
    return cast("Callable[[Function], Function]", njit(**without, **options))


def with_cache_fallback(function: Any) -> Any:
    """Make a compiled function ignore a damaged cache and a cache that cannot be written."""
    disk_cache = function._cache
    load, save = partial(_load, disk_cache), disk_cache.save_overload

    def load_or_empty(*arguments: Any) -> Any:
        try:
            return load(*arguments)
        except Exception:  # a damaged file may raise anything
            with suppress(OSError):
                disk_cache.flush()
            return None

    def save_or_not(*arguments: Any) -> None:
        try:
            save(*arguments)
        except Exception as error:
            _LOG.warning("warning: compiled kernels are not cached: %s", error)

    disk_cache.load_overload, disk_cache.save_overload = load_or_empty, save_or_not
    return function


def _load(disk_cache: Any, signature: Any, target_context: Any) -> Any:
    """Load a compiled function as ``load_overload`` does, without the types of all of numpy.

    numba registers them before it loads anything; only a compilation needs them, and registers them itself.
    """
    if not hasattr(disk_cache, "_load_overload"):  # an inner function of numba
        return type(disk_cache).load_overload(disk_cache, signature, target_context)
    rtsys.initialize(target_context)
    with disk_cache._guard_against_spurious_io_errors():
        return disk_cache._load_overload(signature, target_context)
