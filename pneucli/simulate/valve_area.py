"""The valve's effective area over its command: knots, overlap, and the interpolation between them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from pneucli.experiments import Part

Array = NDArray[np.float64]
POINTS = 4001  # of the kernel's table over both directions
CLOSED_AREA = 1e-14  # m^2, stands for zero where a logarithm is taken
OVERLAPS = ("overlap_fill", "overlap_vent")


def area_name(command: float, label: str = "valve") -> str:
    """Return the parameter's name of the effective area at a command in V from the null one."""
    return f"{label}.effective_area({command:+.4g} V)"


@dataclass(frozen=True)
class ValveArea:
    """Effective areas in m^2 at signed commands in V from the null one, and the overlap (V) of each direction.

    Between knots the area follows a monotone cubic in (log(|u| - overlap), log A), which is exact for a power law
    beyond the overlap; outside them the power law of the two nearest knots goes on.
    """

    commands: tuple[float, ...]
    areas: tuple[float, ...]
    overlap_fill: float = 0.0
    overlap_vent: float = 0.0
    label: str = "valve"
    form: ClassVar[Literal["map", "linear", "switching"]] = "map"
    covers: ClassVar[frozenset[Part]] = frozenset({"linear valve"})  # parts whose effects its knots already show

    def __call__(self, u: Array) -> Array:
        """Return the effective area in m^2 at u, shape of u."""
        u = np.asarray(u, dtype=np.float64)
        return np.where(u > 0, self._side(u, 1.0, self.overlap_fill), self._side(-u, -1.0, self.overlap_vent))

    def table(self, largest: float) -> Array:
        """Return the area at commands up to the ``largest`` (V), both ways, shape (4001,); not to be written to."""
        return _table(self, largest)

    @property
    def area_names(self) -> dict[float, str]:
        """The name of the parameter that is the effective area at a command (V)."""
        return {c: area_name(c, self.label) for c in self.commands}

    def named(self) -> dict[str, tuple[float, str]]:
        """Return value and unit of each parameter by name: the knots' areas, and both overlaps if there are any."""
        areas = {name: (a, "m^2") for name, a in zip(self.area_names.values(), self.areas, strict=True)}
        return areas | ({f"{self.label}.{name}": (getattr(self, name), "V") for name in OVERLAPS} if areas else {})

    def with_named(self, values: Mapping[str, float]) -> ValveArea:
        """Return the valve with parameters replaced; other names are left alone."""
        areas = tuple(values.get(n, a) for n, a in zip(self.area_names.values(), self.areas, strict=True))
        fill, vent = (values.get(f"{self.label}.{name}", getattr(self, name)) for name in OVERLAPS)
        return replace(self, areas=areas, overlap_fill=fill, overlap_vent=vent)

    def scaled(self, factor: float) -> ValveArea:
        """Return the valve with ``factor`` times the area."""
        return replace(self, areas=tuple(a * factor for a in self.areas))

    def roughness(self) -> Array:
        """Return how far each inner knot's log area lies off the line through its neighbours.

        Over log(|u| - overlap), in which a power law is one.
        """
        rows = []
        for sign, overlap in ((1.0, self.overlap_fill), (-1.0, self.overlap_vent)):
            side = sorted((sign * c, a) for c, a in zip(self.commands, self.areas, strict=True) if sign * c > overlap)
            x, y = np.log([c - overlap for c, _ in side]), np.log([max(a, CLOSED_AREA) for _, a in side])
            if x.size > 2:
                w = (x[1:-1] - x[:-2]) / (x[2:] - x[:-2])
                rows.append(y[1:-1] - (1 - w) * y[:-2] - w * y[2:])
        return np.concatenate(rows) if rows else np.zeros(0)

    def _side(self, u: Array, sign: float, overlap: float) -> Array:
        knots = sorted((sign * c, a) for c, a in zip(self.commands, self.areas, strict=True) if sign * c > overlap)
        if not knots:
            return np.zeros_like(u)
        place = np.log([c - overlap for c, _ in knots])
        value = np.log([max(a, CLOSED_AREA) for _, a in knots])
        beyond = np.log(np.maximum(u - overlap, 1e-12))
        if len(knots) == 1:
            return np.where(u > overlap, np.exp(value[0] + beyond - place[0]), 0.0)
        slopes = np.diff(value) / np.diff(place)
        inside = PchipInterpolator(place, value)(np.clip(beyond, place[0], place[-1]))
        below = np.minimum(beyond - place[0], 0.0) * max(slopes[0], 0.0)
        above = np.maximum(beyond - place[-1], 0.0) * max(slopes[-1], 0.0)
        return np.where(u > overlap, np.exp(inside + below + above), 0.0)


@lru_cache(maxsize=1024)
def _table(valve: ValveArea, largest: float) -> Array:
    table = valve(np.linspace(-largest, largest, POINTS))
    table.setflags(write=False)
    return table


NO_VALVE = ValveArea((), ())
