"""Under which conditions an exam's cases are recorded; each has a name, such as ``rate-200Hz``.

Names joined by ``+`` hold at once. Where nothing is said, things are as usual: a bore near 32 mm, 7 bar, 1 kHz.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from pneucli.errors import InputError, did_you_mean

USUAL = "usual"


@dataclass(frozen=True)
class Conditions:
    """All conditions of a case, SI; the defaults are the usual ones, None leaves it to the case."""

    names: tuple[str, ...] = ()
    bore: float | None = None  # m
    supply: float | None = None  # Pa, absolute
    rate: float = 1000.0  # Hz, of the logger


@dataclass(frozen=True)
class Condition:
    """One kind of condition: its form (``#`` stands for a number from ``low`` to ``high``) and what it changes."""

    form: str
    about: str
    change: Callable[[float], dict[str, Any]]
    low: float = 0.0
    high: float = 0.0

    def read(self, name: str) -> dict[str, Any] | None:
        """What ``name`` changes; None where it is no name of this form. Raises InputError beyond the limits."""
        found = re.fullmatch(re.escape(self.form).replace(r"\#", r"(\d+(?:\.\d+)?)"), name)
        if found is None:
            return None
        value = float(found[1]) if found.groups() else 0.0
        if not self.low <= value <= self.high:
            raise InputError("--condition", name, f"{self.form} with # from {self.low:g} to {self.high:g}")
        return self.change(value)


CONDITIONS = (
    Condition(USUAL, "nothing but the usual", lambda _: {}),
    Condition("bore-#mm", "a piston of this diameter", lambda mm: {"bore": mm * 1e-3}, 6, 200),
    Condition("supply-#bar", "a supply of this pressure, absolute", lambda bar: {"supply": bar * 1e5}, 3, 50),
    Condition("rate-#Hz", "logged at this rate; the loop keeps its 1 kHz", lambda hz: {"rate": hz}, 100, 10_000),
)


def parse(text: str) -> Conditions:
    """Read names joined by ``+``. Raises InputError for an unknown one, or two that exclude each other."""
    names = tuple(text.split("+"))
    changes: dict[str, Any] = {}
    for name in names:
        change = _change(name)
        if taken := set(change) & set(changes):
            raise InputError("--condition", text, f"one condition for {', '.join(sorted(taken))}")
        changes |= change
    return replace(Conditions(names), **changes)


def listed() -> str:
    """All forms in one sentence, for the help."""
    return "; ".join(
        f"{c.form} ({c.about}" + (f", {c.low:g} to {c.high:g}" if c.high else "") + ")" for c in CONDITIONS
    )


def _change(name: str) -> dict[str, Any]:
    for condition in CONDITIONS:
        change = condition.read(name)
        if change is not None:
            return change
    forms = [condition.form for condition in CONDITIONS]
    wanted = f"one of {', '.join(forms)}, where # is a number, or several joined by +"
    raise InputError("--condition", f'"{name}"', wanted, did_you_mean(re.sub(r"\d+(\.\d+)?", "#", name), forms))
