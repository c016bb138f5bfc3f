"""Import libraries without what they load needlessly, and what other packages add by their entry points."""

from __future__ import annotations

import gc
import importlib.util
import pkgutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypeVar

from pneucli.errors import InputError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint


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


T = TypeVar("T")
GROUPS = ("pneucli.commands", "pneucli.effects", "pneucli.laws", "pneucli.formats", "pneucli.detectors")
COMMANDS, EFFECTS, LAWS, FORMATS, DETECTORS = GROUPS


@cache
def _entry_points() -> tuple[tuple[EntryPoint, str], ...]:
    """Return the entry points of these groups, each with name and version of its distribution."""
    from importlib.metadata import distributions  # noqa: PLC0415 - takes a while

    found = [(point, one) for one in distributions() for point in one.entry_points if point.group in GROUPS]
    return tuple((point, f"{one.name} {one.version}") for point, one in found)


def entry_points(group: str) -> dict[str, EntryPoint]:
    """Return the entry points of a group by name."""
    return {point.name: point for point, _ in _entry_points() if point.group == group}


def load(point: EntryPoint) -> Any:
    """Return what an entry point names; raises InputError where that cannot be loaded."""
    try:
        return point.load()
    except Exception as error:  # a package may raise anything
        found = f"{point.value} cannot be loaded: {type(error).__name__}: {error}"
        mend = "repair or uninstall the package that names it"
        raise InputError(f"entry point {point.name} of {point.group}", found, mend=mend, code="E028") from error


def declared(package: str, kind: type[T]) -> list[T]:
    """Return what the files of a package declare of a kind."""
    files = pkgutil.iter_modules(import_module(package).__path__, f"{package}.")
    return [one for file in files for one in vars(import_module(file.name)).values() if isinstance(one, kind)]


def added(group: str) -> list[Any]:
    """Return what other packages add to a group; raises InputError where one of them cannot be loaded."""
    return [load(point) for point in entry_points(group).values()]


def versions() -> list[str]:
    """Return what is added, with name and version of its distribution: another one makes results stale."""
    return sorted(f"{point.group} {point.name} {about}" for point, about in _entry_points())
