"""One kind of condition under which the cases of an exam are recorded."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from pneucli.errors import InputError

Kind = Literal["valve", "friction", "axis"]
KINDS: tuple[Kind, ...] = ("valve", "friction", "axis")


@dataclass(frozen=True)
class Condition:
    """One kind of condition: ``#`` in its ``pattern`` is a number from ``minimum`` to ``maximum``, from which
    ``change`` makes fields of :class:`Conditions`.
    """

    pattern: str
    description: str
    change: Callable[[float], dict[str, Any]]
    minimum: float = 0.0
    maximum: float = 0.0
    kinds: tuple[Kind, ...] = KINDS
    excluded: frozenset[str] = frozenset()

    def match(self, name: str) -> dict[str, Any] | None:
        """Return the changes for ``name``; None where the pattern differs. Raises InputError beyond the limits."""
        found = re.fullmatch(re.escape(self.pattern).replace(r"\#", r"(\d+(?:\.\d+)?)"), name)
        if found is None:
            return None
        value = float(found[1]) if found.groups() else 0.0
        if not self.minimum <= value <= self.maximum:
            raise InputError(
                "--condition", name, f"{self.pattern} with # from {self.minimum:g} to {self.maximum:g}", code="E031"
            )
        return self.change(value)


def constant_change(**change: Any) -> Callable[[float], dict[str, Any]]:
    """Return a change that does not depend on a number."""
    return lambda _: change
