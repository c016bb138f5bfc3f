"""A number with its 95 % interval, and how attributes become the entries of an answer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Figure:
    """A number, the ends of its 95 % interval, and the SI unit of all three.

    ``determined`` is False where the interval is that of typical values, which hold what the data do not show.
    """

    value: float
    low: float
    high: float
    unit: str = ""
    determined: bool = True

    def excludes(self, value: float) -> bool:
        """Whether the interval excludes a value."""
        return not self.low <= value <= self.high

    @property
    def answer(self) -> dict[str, Any]:
        """The figure in a JSON answer; an end that is not finite is null.

        >>> Figure(2.0, 1.0, math.inf, "N").answer
        {'value': 2.0, 'unit': 'N', 'ci95': [1.0, None]}
        """
        ends = [float(end) if math.isfinite(end) else None for end in (self.low, self.high)]
        return {"value": float(self.value), "unit": self.unit, "ci95": ends}


def named(one: object, names: str) -> dict[str, Any]:
    """Return attributes by their names.

    >>> named(Figure(2.0, 1.0, 3.0, "N"), "value unit")
    {'value': 2.0, 'unit': 'N'}
    """
    return {name: getattr(one, name) for name in names.split()}
