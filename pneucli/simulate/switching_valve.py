"""A valve that is open one way or the other, or shut: no map between."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from pneucli.experiments import Part
from pneucli.simulate.valve_area import POINTS

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SwitchingValve:
    """Effective areas in m^2 of filling and venting; ``label`` begins the names of its parameters."""

    fill: float
    vent: float
    u_max: float = 10.0
    label: str = "valve"
    covers: ClassVar[frozenset[Part]] = frozenset({"linear valve"})

    def __call__(self, u: Array) -> Array:
        """Return the effective area in m^2 at u, shape of u; 0 at the null command alone."""
        return np.where(u > 0.0, self.fill, np.where(u < 0.0, self.vent, 0.0))

    def table(self) -> Array:
        """Return the area over -u_max..u_max, shape (4001,)."""
        return self(np.linspace(-self.u_max, self.u_max, POINTS))

    @property
    def commands(self) -> tuple[float, ...]:
        """Any of either sign."""
        return (-self.u_max, self.u_max)

    def named(self) -> dict[str, tuple[float, str]]:
        """Return value and unit of each parameter by name."""
        return {f"{self.label}.area_fill": (self.fill, "m^2"), f"{self.label}.area_vent": (self.vent, "m^2")}

    def with_named(self, values: Mapping[str, float]) -> SwitchingValve:
        """Return the valve with parameters replaced; other names are left alone."""
        fill, vent = (values.get(name, value) for name, (value, _) in self.named().items())
        return replace(self, fill=fill, vent=vent)

    def scaled(self, factor: float) -> SwitchingValve:
        """Return the valve with ``factor`` times the area."""
        return replace(self, fill=self.fill * factor, vent=self.vent * factor)

    def roughness(self) -> Array:
        """Return how far the area is from a power law: it has no shape."""
        return np.zeros(0)
