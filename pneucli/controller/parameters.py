"""The designed controller: plain numbers by name and the inverse of the valve's map."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pneucli.controller.layout import PARAMETERS, STROKE_NODES, STROKE_TABLES

Array = NDArray[np.float64]
TABLE_MARKER = "C_TABLE"


@dataclass(frozen=True)
class Controller:
    """A controller: ``values`` by the names of :mod:`pneucli.controller.layout` (SI), and the valve's inverse.

    ``fill`` and ``vent``, those of chamber 1 and then of chamber 2, hold commands in V at effective areas
    ``(i / (n - 1))^2`` of the largest one of that direction; all have n entries. ``law`` names the control law
    (:mod:`pneucli.controller.laws`), ``own`` are the numbers and tables that it has beside the common ones. ``along`` has
    the tables over the stroke by the names of ``layout.ALONG``.
    """

    values: Mapping[str, float]
    fill: tuple[float, ...]
    vent: tuple[float, ...]
    fill_2: tuple[float, ...]
    vent_2: tuple[float, ...]
    law: str = "best"
    own: tuple[float, ...] = ()
    along: tuple[tuple[float, ...], ...] = ((1.0,) * STROKE_NODES,) * 2 + ((0.0,) * STROKE_NODES,) * 3

    @property
    def period(self) -> float:
        """Sample time in s."""
        return self.values["C_PERIOD"]

    def vector(self) -> Array:
        """Return the parameter array of :func:`pneucli.controller.cascade.step`."""
        numbers = [self.values[name] for name in PARAMETERS if name != TABLE_MARKER]
        return np.concatenate([numbers, *self.tables().values(), self.own])

    def tables(self) -> dict[str, tuple[float, ...]]:
        """Return the inverse tables and those along the stroke by name, in the order in which they stand."""
        inverse = {"fill": self.fill, "vent": self.vent, "fill_2": self.fill_2, "vent_2": self.vent_2}
        return inverse | dict(zip(STROKE_TABLES, self.along, strict=True))

    def with_values(self, **values: float) -> Controller:
        """Return the controller with some numbers replaced, by the names of the layout."""
        return replace(self, values={**self.values, **values})

    def with_law(self, law: str, values: Mapping[str, float], own: tuple[float, ...]) -> Controller:
        """Return the same axis and valve under another law."""
        return replace(self.with_values(**values), law=law, own=own)

    def to_json(self) -> str:
        """Return the controller as text from which :meth:`from_json` makes the same one, to the last bit."""
        return json.dumps(asdict(self), indent=1)

    @staticmethod
    def from_json(text: str) -> Controller:
        """Return the controller that :meth:`to_json` wrote."""
        plain = json.loads(text)
        lists = {name: tuple(plain[name]) for name in ("fill", "vent", "fill_2", "vent_2", "own")}
        return Controller(**{**plain, **lists, "along": tuple(map(tuple, plain["along"]))})


def nominal_load(c: Mapping[str, float]) -> float:
    """Return a usual load in N: a tenth of the force that supply makes against ambient pressure."""
    return 0.1 * c["C_AREA_1"] * (c["C_SUPPLY"] - c["C_AMBIENT"])
