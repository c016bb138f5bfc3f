"""A valve whose effective area is proportional to the command, for rigs without a valve test."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np

from pneucli.arrays import Array
from pneucli.experiments import Part
from pneucli.simulate.valve_forms.area import sampled_table


@dataclass(frozen=True)
class LinearValve:
    """One gain in m^2/V for both directions, up to ``max_command`` V; ``label`` begins its parameter's name."""

    gain: float
    max_command: float
    label: str = "valve"
    form: ClassVar[Literal["map", "linear", "switching"]] = "linear"
    covers: ClassVar[frozenset[Part]] = frozenset()
    interpolation_uncertainty: ClassVar[float] = 0.0  # it has no knots

    def __call__(self, u: Array) -> Array:
        """Return the effective area in m^2 at u, shape of u."""
        return self.gain * np.abs(u)

    def table(self, largest: float) -> Array:
        """Return the area at commands up to ``largest`` V in both directions, shape (TABLE_POINTS,), read-only."""
        return sampled_table(self, largest)

    @property
    def commands(self) -> tuple[float, ...]:
        """Both ends of the line in V."""
        return (-self.max_command, self.max_command)

    @property
    def area_names(self) -> dict[float, str]:
        """No area is a parameter; all follow from the gain."""
        return {}

    def parameters(self) -> dict[str, tuple[float, str]]:
        """Return value and unit of each parameter by name."""
        return {f"{self.label}.gain": (self.gain, "m^2/V")}

    def with_parameters(self, values: Mapping[str, float]) -> LinearValve:
        """Return the valve with parameters replaced; other names are ignored."""
        return replace(self, gain=values.get(f"{self.label}.gain", self.gain))

    def scaled(self, factor: float) -> LinearValve:
        """Return the valve with ``factor`` times the area."""
        return replace(self, gain=self.gain * factor)

    def roughness(self) -> Array:
        """Return no residuals: a line is a power law."""
        return np.zeros(0)

    def changed_ranges(self, other: LinearValve) -> tuple[tuple[float, float], ...]:
        """Return the ranges of commands in V in which another valve of this form may differ."""
        return ((-np.inf, np.inf),) if self != other else ()
