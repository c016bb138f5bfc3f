"""A valve that fills, vents, or is shut, without an area in between."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np

from pneucli.arrays import Array
from pneucli.experiments import Part
from pneucli.simulate.valve_forms.area import sampled_table


@dataclass(frozen=True)
class SwitchingValve:
    """Effective areas in m^2 of filling and venting, at commands up to ``max_command`` V.

    ``label`` begins the names of its parameters.
    """

    fill: float
    vent: float
    max_command: float
    label: str = "valve"
    form: ClassVar[Literal["map", "linear", "switching"]] = "switching"
    covers: ClassVar[frozenset[Part]] = frozenset({"linear valve"})
    interpolation_uncertainty: ClassVar[float] = 0.0  # it has no knots

    def __call__(self, u: Array) -> Array:
        """Return the effective area in m^2 at commands u in V, of their shape; 0 at the null command only."""
        return np.where(u > 0.0, self.fill, np.where(u < 0.0, self.vent, 0.0))

    def table(self, largest: float) -> Array:
        """Return the area at commands up to ``largest`` V in both directions, shape (TABLE_POINTS,), read-only."""
        return sampled_table(self, largest)

    @property
    def commands(self) -> tuple[float, ...]:
        """A command of each sign in V."""
        return (-self.max_command, self.max_command)

    @property
    def area_names(self) -> dict[float, str]:
        """Names of the parameters for effective areas, by command in V."""
        return {-self.max_command: f"{self.label}.area_vent", self.max_command: f"{self.label}.area_fill"}

    def parameters(self) -> dict[str, tuple[float, str]]:
        """Return value and unit of each parameter by name."""
        return {f"{self.label}.area_fill": (self.fill, "m^2"), f"{self.label}.area_vent": (self.vent, "m^2")}

    def with_parameters(self, values: Mapping[str, float]) -> SwitchingValve:
        """Return the valve with parameters replaced; other names are ignored."""
        fill, vent = (values.get(name, value) for name, (value, _) in self.parameters().items())
        return replace(self, fill=fill, vent=vent)

    def scaled(self, factor: float) -> SwitchingValve:
        """Return the valve with ``factor`` times the area."""
        return replace(self, fill=self.fill * factor, vent=self.vent * factor)

    def roughness(self) -> Array:
        """Return no residuals: two areas have no shape."""
        return np.zeros(0)

    def changed_ranges(self, other: SwitchingValve) -> tuple[tuple[float, float], ...]:
        """Return the ranges of commands in V in which another valve of this form may differ."""
        both = ((-np.inf, 0.0), self.vent != other.vent), ((0.0, np.inf), self.fill != other.fill)
        return tuple(side for side, differs in both if differs)
