"""Compiled functions are kept on disk, where there is a place for them; what cannot be read there is made anew."""

from __future__ import annotations

import logging
import os
import tempfile
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import platformdirs
from numba import njit

Function = TypeVar("Function", bound=Callable[..., Any])
_LOG = logging.getLogger(__name__)


def cache_folder() -> Path:
    """Return the folder of the cache: ``PNEUCLI_CACHE``, else the user's, else, with a warning, a temporary one."""
    return _writable_folder(Path(os.environ.get("PNEUCLI_CACHE") or platformdirs.user_cache_dir("pneucli")))


@cache
def _writable_folder(wanted: Path) -> Path:
    try:
        wanted.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=wanted):
            return wanted
    except OSError as error:
        instead = _temporary()
        _LOG.warning("warning: cannot write to %s (%s): compiled kernels go to %s", wanted, error.strerror, instead)
        return instead


def _temporary() -> Path:
    """Return a folder of this user's own; what is in it is run, so nobody else may write there."""
    if not hasattr(os, "getuid"):
        return Path(tempfile.mkdtemp(prefix="pneucli-"))
    usual = Path(tempfile.gettempdir(), f"pneucli-{os.getuid()}")
    usual.mkdir(mode=0o700, exist_ok=True)
    status = usual.lstat()
    own = usual.is_dir() and not usual.is_symlink() and status.st_uid == os.getuid() and not status.st_mode & 0o077
    return usual if own else Path(tempfile.mkdtemp(prefix="pneucli-"))


def compiled(**options: Any) -> Callable[[Function], Function]:
    """Return numba's ``njit`` with a cache on disk, and these options, as a decorator."""

    def decorate(function: Function) -> Function:
        try:
            made = njit(cache=True, **options)(function)
        except RuntimeError:  # numba finds no place that it may write to
            numba.config.CACHE_DIR = str(cache_folder())  # type: ignore[attr-defined]
            made = njit(cache=True, **options)(function)
        return cast("Function", with_cache_fallback(made))

    return decorate


def with_cache_fallback(function: Any) -> Any:
    """Return numba's compiled function: where its cache is damaged or cannot be written, it is compiled anew."""
    kept = function._cache
    load, save = kept.load_overload, kept.save_overload

    def load_or_empty(*arguments: Any) -> Any:
        try:
            return load(*arguments)
        except Exception:  # whatever a damaged file may raise
            with suppress(OSError):
                kept.flush()
            return None

    def save_or_not(*arguments: Any) -> None:
        try:
            save(*arguments)
        except Exception as error:
            _LOG.warning("warning: compiled kernels are not kept: %s", error)

    kept.load_overload, kept.save_overload = load_or_empty, save_or_not
    return function
