"""The designed controller: plain numbers by name and the inverse of the valve's map."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pneucli.design.layout import PARAMETERS

Array = NDArray[np.float64]
TABLE = "C_TABLE"


@dataclass(frozen=True)
class Controller:
    """A cascade controller: ``values`` by the names of :mod:`pneucli.design.layout` (SI), and the valve's inverse.

    ``fill`` and ``vent``, those of chamber 1 and then of chamber 2, hold commands in V at effective areas
    ``(i / (n - 1))^2`` of the largest one of that direction; all have n entries.
    """

    values: Mapping[str, float]
    fill: tuple[float, ...]
    vent: tuple[float, ...]
    fill_2: tuple[float, ...]
    vent_2: tuple[float, ...]

    @property
    def period(self) -> float:
        """Sample time in s."""
        return self.values["C_PERIOD"]

    def vector(self) -> Array:
        """Return the parameter array of :func:`pneucli.design.step.step`."""
        numbers = [self.values[name] for name in PARAMETERS if name != TABLE]
        return np.concatenate([numbers, *self.tables().values()])

    def tables(self) -> dict[str, tuple[float, ...]]:
        """Return the inverse tables by name, in the order in which they follow the numbers."""
        return {"fill": self.fill, "vent": self.vent, "fill_2": self.fill_2, "vent_2": self.vent_2}

    def with_values(self, **values: float) -> Controller:
        """Return the controller with some numbers replaced, by the names of the layout."""
        return replace(self, values={**self.values, **values})

    def to_json(self) -> str:
        """Return the controller as text from which :meth:`from_json` makes the same one, to the last bit."""
        return json.dumps(asdict(self), indent=1)

    @staticmethod
    def from_json(text: str) -> Controller:
        """Return the controller that :meth:`to_json` wrote."""
        plain = json.loads(text)
        return Controller(plain["values"], *(tuple(plain[name]) for name in ("fill", "vent", "fill_2", "vent_2")))
