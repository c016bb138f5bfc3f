"""The designed controller: parameters by name, and the inverse valve map."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

from pneucli.arrays import Array
from pneucli.controller.layout import FIRST_LAW_PARAMETER, PARAMETERS, STROKE_NODES, STROKE_TABLES

TABLE_MARKER = "C_TABLE"
ROUNDING = 1e-3  # relative difference below which members of a family share a number


@dataclass(frozen=True)
class Controller:
    """Parameters of a controller.

    Attributes:
        values: Parameters by the names of :mod:`pneucli.controller.layout` (SI).
        fill: Commands (n,) in V that fill chamber 1 at effective areas ``(i / (n - 1))^2`` of the largest one.
        vent: Commands (n,) in V that vent chamber 1, likewise.
        fill_2: Commands (n,) in V that fill chamber 2; of a 5/3 valve those of its one spool.
        vent_2: Commands (n,) in V that vent chamber 2.
        law: Name of the control law (:mod:`pneucli.controller.laws`).
        own: Own parameters and tables of the law, in the order of ``ControlLaw.parameters``.
        along: Tables along the stroke, in the order of ``layout.STROKE_TABLES``.
        family: Gains that a commissioning chooses from, in rows: the places of the parameters that they change, then of
            each member delay and overshoot (s) that its relay test shows, and those parameters.

    """

    values: Mapping[str, float]
    fill: tuple[float, ...]
    vent: tuple[float, ...]
    fill_2: tuple[float, ...]
    vent_2: tuple[float, ...]
    law: str = "best"
    own: tuple[float, ...] = ()
    along: tuple[tuple[float, ...], ...] = ((1.0,) * STROKE_NODES,) * 2 + ((0.0,) * STROKE_NODES,) * 3
    family: tuple[tuple[float, ...], ...] = ()

    @property
    def period(self) -> float:
        """Sample time in s."""
        return self.values["C_PERIOD"]

    def vector(self) -> Array:
        """Return the parameter array of :func:`pneucli.controller.cascade.cascade_step`."""
        numbers = [self.values[name] for name in PARAMETERS if name != TABLE_MARKER]
        return np.concatenate([numbers, *self.tables().values(), self.own, *self.family])

    def tables(self) -> dict[str, tuple[float, ...]]:
        """Return the inverse tables and the tables along the stroke by name, in the order of the parameter array."""
        inverse = {"fill": self.fill, "vent": self.vent, "fill_2": self.fill_2, "vent_2": self.vent_2}
        return inverse | dict(zip(STROKE_TABLES, self.along, strict=True))

    def with_values(self, **values: float) -> Controller:
        """Return the controller with some parameters replaced, by the names of the layout."""
        return replace(self, values={**self.values, **values})

    def with_law(self, law: str, values: Mapping[str, float], own: tuple[float, ...]) -> Controller:
        """Return the same axis and valve under another law."""
        return replace(self.with_values(**values), law=law, own=own)

    def with_family(self, members: Sequence[tuple[float, float, Controller]]) -> Controller:
        """Return the controller with a family of gains: of each member delay and overshoot (s) in its relay test."""
        every = [self.values, *(one.values for _, _, one in members)]
        spread = {n: [values[n] for values in every] for n in PARAMETERS if n in self.values}
        names = [n for n, v in spread.items() if max(v) - min(v) > ROUNDING * max(map(abs, v))]
        rows = [(delay, overshoot, *(one.values[n] for n in names)) for delay, overshoot, one in members]
        about = {"C_FAMILY_MEMBERS": len(members), "C_FAMILY_WIDTH": len(names)}
        about["C_FAMILY"] = FIRST_LAW_PARAMETER + len(self.own)
        places = tuple(float(PARAMETERS.index(name)) for name in names)
        return replace(self.with_values(**{n: float(v) for n, v in about.items()}), family=(places, *rows))

    def to_json(self) -> str:
        """Return the controller as JSON; :meth:`from_json` restores it exactly."""
        return json.dumps(asdict(self), indent=1)

    @staticmethod
    def from_json(text: str) -> Controller:
        """Return the controller that :meth:`to_json` wrote."""
        plain = json.loads(text)
        lists = {name: tuple(plain[name]) for name in ("fill", "vent", "fill_2", "vent_2", "own")}
        return Controller(**{**plain, **lists, **{n: tuple(map(tuple, plain[n])) for n in ("along", "family")}})


def nominal_load(c: Mapping[str, float]) -> float:
    """Return the nominal load in N: a tenth of the force of supply against ambient pressure.

    Args:
        c: Parameters of a controller by name (SI).

    References:
        A convention: the load of a scenario that states none, and of the acceptance test.

    >>> round(nominal_load({"C_AREA_1": 8e-4, "C_SUPPLY": 7e5, "C_AMBIENT": 1e5}), 6)
    48.0
    """
    return 0.1 * c["C_AREA_1"] * (c["C_SUPPLY"] - c["C_AMBIENT"])
