"""The control laws: one file a law, found in this folder; those of other packages by their entry points."""

from __future__ import annotations

import pkgutil
from collections.abc import Iterable, Iterator
from importlib import import_module
from typing import Any

from pneucli import extensions
from pneucli.controller.laws.base import ControlLaw
from pneucli.errors import InputError, did_you_mean


def _declared() -> Iterator[ControlLaw]:
    for one in pkgutil.iter_modules(__path__, f"{__name__}."):
        yield from (law for law in vars(import_module(one.name)).values() if isinstance(law, ControlLaw))
    yield from map(extensions.load, extensions.entry_points(extensions.LAWS).values())


# the first is the default; the kernel selects a law by its index
LAWS: dict[str, ControlLaw] = {law.name: law for law in sorted(_declared(), key=lambda law: law.place)}
DEFAULT = next(iter(LAWS))


def find_law(name: Any, where: str) -> ControlLaw:
    """Return a law by its name.

    Args:
        name: The name; anything else is refused.
        where: The key of the pipeline file that names it.

    Raises:
        InputError: There is no law of that name (E031).
    """
    if not isinstance(name, str) or name not in LAWS:
        raise InputError(where, f"{name!r}", f"one of {', '.join(LAWS)}", did_you_mean(str(name), LAWS), code="E031")
    return LAWS[name]


def select_laws(names: Iterable[str], where: str) -> list[ControlLaw]:
    """Return laws by their names, each once, in the given order."""
    return [find_law(name, where) for name in dict.fromkeys(names)]
