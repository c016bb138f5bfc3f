"""Table of the control laws: one module a law, one entry here and in ``design.control_laws.SYNTHESIS``."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from pneucli.controller.laws import cascade, compensated, pdc, pid, relay, sector
from pneucli.controller.laws.base import ControlLaw
from pneucli.errors import InputError, did_you_mean

# the first is the default; the kernel selects a law by its index
LAWS: dict[str, ControlLaw] = {
    law.name: law
    for law in (cascade.LAW, pid.PID, pid.PID_FEEDFORWARD, relay.LAW, sector.LAW, compensated.LAW, pdc.LAW)
}
DEFAULT = cascade.LAW.name


def find_law(name: Any, where: str) -> ControlLaw:
    """Return a law by its name; raises InputError at ``where`` for an unknown one."""
    if not isinstance(name, str) or name not in LAWS:
        raise InputError(where, f"{name!r}", f"one of {', '.join(LAWS)}", did_you_mean(str(name), LAWS), code="E031")
    return LAWS[name]


def select_laws(names: Iterable[str], where: str) -> list[ControlLaw]:
    """Return laws by their names, each once, in the given order."""
    return [find_law(name, where) for name in dict.fromkeys(names)]
