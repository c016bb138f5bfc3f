"""The control laws: one file a law, found in this folder; those of other packages by their entry points."""

from collections.abc import Iterable
from typing import Any

from pneucli import imports
from pneucli.controller.laws.base import ControlLaw
from pneucli.errors import InputError, did_you_mean

_FOUND: list[ControlLaw] = [*imports.declared(__name__, ControlLaw), *imports.added(imports.LAWS)]
# the first is the default; the kernel selects a law by its index
LAWS = {law.name: law for law in sorted(_FOUND, key=lambda law: law.place)}
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
