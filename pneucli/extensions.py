"""What other packages add to the program, by the entry points of their distributions."""

from __future__ import annotations

import pkgutil
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypeVar

from pneucli.errors import InputError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

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
