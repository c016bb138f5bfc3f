"""Import libraries without what they load and this program does not use."""

from __future__ import annotations

import gc
import importlib.util
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from pneucli.errors import InputError


def library_of_extra(module: str, extra: str, where: object, name: str = "") -> Any:
    """Return a library that an extra installs; raises InputError where it is not there."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        found = f"{name or module.partition('.')[0]} is not installed"
        mend = f"pip install 'pneucli[{extra}]'"
        raise InputError(str(where), found, f"the extra {extra}", mend, code="E009") from error


@contextmanager
def hidden_modules(*names: str) -> Iterator[None]:
    """Let import statements in a ``with`` block find no module of these names, which libraries load if they can.

    Modules that are loaded already stay.
    """
    finder = _NotFound(names)
    sys.meta_path.insert(0, finder)
    try:
        yield
    finally:
        sys.meta_path.remove(finder)


class _NotFound:
    """Finds no module of some names."""

    def __init__(self, names: tuple[str, ...]) -> None:
        self._names = names

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        if name in self._names:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


@contextmanager
def paused_collection() -> Iterator[None]:
    """Collect no garbage in a ``with`` block of imports: their objects stay, and collections look at all of them."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def load_on_use(package: str, *names: str) -> None:
    """Let modules of a package load themselves at the first use of what they hold; libraries import them for a name."""
    parent = importlib.import_module(package)
    for name in names:
        if f"{package}.{name}" in sys.modules or (spec := importlib.util.find_spec(f"{package}.{name}")) is None:
            continue
        assert spec.loader is not None
        spec.loader = importlib.util.LazyLoader(spec.loader)
        module = importlib.util.module_from_spec(spec)
        sys.modules[spec.name] = module
        spec.loader.exec_module(module)
        setattr(parent, name, module)
