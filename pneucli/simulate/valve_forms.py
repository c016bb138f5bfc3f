"""The forms of a valve: an area over its command by knots, one gain, or filling, venting and shut (switching)."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar, Literal

import numpy as np

from pneucli.arrays import Array
from pneucli.caches import compiled
from pneucli.experiments import Part
from pneucli.noise import NORMAL_MAD

TABLE_POINTS = 8001  # of the kernel's table over both directions
MIN_AREA = 1e-14  # m^2, in place of zero in a logarithm
MAX_OVERLAP_RATIO = 0.95  # of the smallest command with a knot; a larger overlap leaves no area to fit
OVERLAP_FIELDS = ("overlap_fill", "overlap_vent")
Knots = tuple[float, tuple[tuple[float, float], ...]]  # of one direction: overlap (V), and (opening in V, area in m^2)


def area_parameter_name(command: float, label: str = "valve") -> str:
    """Return the name of the parameter for an effective area.

    Args:
        command: Command in V from the null command.
        label: Name of the valve.

    Returns:
        The name.

    >>> area_parameter_name(2.5)
    'valve.effective_area(+2.5 V)'
    """
    return f"{label}.effective_area({command:+.4g} V)"


@dataclass(frozen=True)
class ValveArea:
    """Effective areas at signed commands, and the overlap of each direction.

    Between knots the area follows a monotone cubic in (log(|u| - overlap), log A), exact for a power law beyond the
    overlap. Outside it continues the power law of the two nearest knots.

    Attributes:
        commands: Commands of the knots in V from the null command.
        areas: Effective areas in m^2.
        overlap_fill: Overlap in V toward filling.
        overlap_vent: Overlap in V toward venting.
        label: Name of the valve, with which its parameters' names begin.
    """

    commands: tuple[float, ...]
    areas: tuple[float, ...]
    overlap_fill: float = 0.0
    overlap_vent: float = 0.0
    label: str = "valve"
    form: ClassVar[Literal["map", "linear", "switching"]] = "map"
    # parts whose effects are in the map, or act on another valve
    covers: ClassVar[frozenset[Part]] = frozenset({"linear valve"})

    def __call__(self, u: Array) -> Array:
        """Return the effective area in m^2 at commands u in V, of their shape."""
        u = np.asarray(u, dtype=np.float64)
        return np.where(u > 0, _areas(u, self._knots(1.0)), _areas(-u, self._knots(-1.0)))

    def table(self, largest: float) -> Array:
        """Return the area at commands up to ``largest`` V in both directions, shape (TABLE_POINTS,), read-only."""
        return _table(self, largest)

    @property
    def area_names(self) -> Mapping[float, str]:
        """Names of the parameters for effective areas, by command in V."""
        return _area_names(self.commands, self.label)

    def parameters(self) -> dict[str, tuple[float, str]]:
        """Return value and unit of each parameter by name: the knots' areas and both overlaps."""
        areas = {name: (a, "m^2") for name, a in zip(self.area_names.values(), self.areas, strict=True)}
        return areas | (
            {f"{self.label}.{name}": (getattr(self, name), "V") for name in OVERLAP_FIELDS} if areas else {}
        )

    def with_parameters(self, values: Mapping[str, float]) -> ValveArea:
        """Return the valve with parameters replaced; other names are ignored."""
        areas = tuple(values.get(n, a) for n, a in zip(self.area_names.values(), self.areas, strict=True))
        fill, vent = (values.get(f"{self.label}.{name}", getattr(self, name)) for name in OVERLAP_FIELDS)
        return replace(self, areas=areas, overlap_fill=fill, overlap_vent=vent)

    def scaled(self, factor: float) -> ValveArea:
        """Return the valve with ``factor`` times the area."""
        return replace(self, areas=tuple(a * factor for a in self.areas))

    def roughness(self) -> Array:
        """Return the distance of the log area of each inner knot from the line through its neighbours."""
        rows = []
        for sign, overlap in ((1.0, self.overlap_fill), (-1.0, self.overlap_vent)):
            side = sorted((sign * c, a) for c, a in zip(self.commands, self.areas, strict=True) if sign * c > overlap)
            x, y = np.log([c - overlap for c, _ in side]), np.log([max(a, MIN_AREA) for _, a in side])
            if x.size > 2:
                w = (x[1:-1] - x[:-2]) / (x[2:] - x[:-2])
                rows.append(y[1:-1] - (1 - w) * y[:-2] - w * y[2:])
        return np.concatenate(rows) if rows else np.zeros(0)

    @property
    def interpolation_uncertainty(self) -> float:
        """The relative standard uncertainty of an area between two knots.

        An inner knot departs from the line through its neighbours, which lie twice as far apart as the knots between
        which the map interpolates. The error of a line grows with the square of that distance: a quarter remains.
        """
        departures = np.abs(self.roughness())
        return float(NORMAL_MAD * np.median(departures)) / 4.0 if departures.size else 0.0

    def changed_ranges(self, other: ValveArea) -> tuple[tuple[float, float], ...]:
        """Return the ranges of commands in V in which another valve with the same knots may differ.

        The cubic depends on knots up to the second neighbour, the power laws on the two last ones.
        """
        return _changed(self, other)

    def _knots(self, sign: float) -> Knots:
        overlap = self.overlap_fill if sign > 0.0 else self.overlap_vent
        side = sorted((sign * c, a) for c, a in zip(self.commands, self.areas, strict=True) if sign * c > overlap)
        return overlap, tuple(side)


@lru_cache(maxsize=256)
def _area_names(commands: tuple[float, ...], label: str) -> Mapping[float, str]:
    return {c: area_parameter_name(c, label) for c in commands}


@lru_cache(maxsize=64)  # asked for each recording
def _changed(one: ValveArea, other: ValveArea) -> tuple[tuple[float, float], ...]:
    sides = ((sign, one._knots(sign), other._knots(sign)) for sign in (1.0, -1.0))
    found = [(sign, _changed_openings(mine, its)) for sign, mine, its in sides if mine != its]
    return tuple((low, high) if sign > 0.0 else (-high, -low) for sign, (low, high) in found)


def _changed_openings(mine: Knots, its: Knots) -> tuple[float, float]:
    """Return the openings in V between which two sides with different knots may differ."""
    commands = [c for c, _ in mine[1]]
    if mine[0] != its[0] or commands != [c for c, _ in its[1]]:
        return 0.0, np.inf
    moved = [i for i, (a, b) in enumerate(zip(mine[1], its[1], strict=True)) if a != b]
    first, last = moved[0] - 2, moved[-1] + 2
    return commands[first] if first >= 0 else 0.0, commands[last] if last < len(commands) else np.inf


def _areas(u: Array, side: Knots) -> Array:
    """Return the area at openings u (n,) of one direction."""
    overlap, knots = side
    out = np.zeros(u.shape)
    if knots:
        place = np.log([c - overlap for c, _ in knots])
        value = np.log([max(a, MIN_AREA) for _, a in knots])
        _write_areas(np.ascontiguousarray(u).ravel(), overlap, place, value, out.ravel())
    return out


@compiled(nogil=True, error_model="numpy")
def _write_areas(u: Array, overlap: float, place: Array, value: Array, out: Array) -> None:
    """Write the areas at openings u (n,) over log openings and log areas of the knots, each (m,); 0 in the overlap.

    ``scipy.interpolate.PchipInterpolator`` is the same cubic, in several passes.
    """
    last = place.size - 1
    tangent = _monotone_tangents(place, value)
    first_slope = max((value[1] - value[0]) / (place[1] - place[0]), 0.0) if last else 1.0
    last_slope = max((value[last] - value[last - 1]) / (place[last] - place[last - 1]), 0.0) if last else 1.0
    for i in range(u.size):
        if not u[i] > overlap:
            continue
        at = math.log(max(u[i] - overlap, 1e-12))
        if at <= place[0]:
            log_area = value[0] + (at - place[0]) * first_slope
        elif at >= place[last]:
            log_area = value[last] + (at - place[last]) * last_slope
        else:
            k = 0
            while at > place[k + 1]:
                k += 1
            width, s = place[k + 1] - place[k], at - place[k]
            slope = (value[k + 1] - value[k]) / width
            excess = (tangent[k] + tangent[k + 1] - 2.0 * slope) / width
            log_area = value[k] + s * (tangent[k] + s * ((slope - tangent[k]) / width - excess + s * excess / width))
        out[i] = math.exp(log_area)


@compiled(nogil=True, error_model="numpy")
def _monotone_tangents(x: Array, y: Array) -> Array:
    """Return the slopes at the knots (m,) of a cubic that is monotone between them.

    References:
        F. N. Fritsch and J. Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300-304.

    """
    m = x.size
    out = np.zeros(m)
    if m == 1:
        return out
    h, slope = np.empty(m - 1), np.empty(m - 1)
    for i in range(m - 1):  # differences of whole arrays take ten times as long to compile
        h[i] = x[i + 1] - x[i]
        slope[i] = (y[i + 1] - y[i]) / h[i]
    if m == 2:
        out[0] = out[1] = slope[0]
        return out
    for i in range(1, m - 1):
        if slope[i - 1] * slope[i] > 0.0:
            w, w_before = 2.0 * h[i - 1] + h[i], h[i - 1] + 2.0 * h[i]
            out[i] = (w + w_before) / (w_before / slope[i - 1] + w / slope[i])
    out[0] = _end_tangent(h[0], h[1], slope[0], slope[1])
    out[m - 1] = _end_tangent(h[m - 2], h[m - 3], slope[m - 2], slope[m - 3])
    return out


@compiled(nogil=True, error_model="numpy")
def _end_tangent(h: float, h_next: float, slope: float, slope_next: float) -> float:
    """Return the slope at an end knot: of the parabola through three knots, as far as it keeps the cubic monotone."""
    out = ((2.0 * h + h_next) * slope - h * slope_next) / (h + h_next)
    if out * slope <= 0.0:
        return 0.0
    if slope * slope_next < 0.0 and abs(out) > 3.0 * abs(slope):
        return 3.0 * slope
    return out


@lru_cache(maxsize=128)
def _half_table(side: Knots, largest: float) -> Array:
    """Return the areas of one direction from the smallest opening of the kernel's table to the largest."""
    return _areas(np.linspace(-largest, largest, TABLE_POINTS)[TABLE_POINTS // 2 + 1 :], side)


@lru_cache(maxsize=64)
@lru_cache(maxsize=64)  # more than a valve has parameters
def _table(valve: ValveArea, largest: float) -> Array:
    halves = [_half_table(valve._knots(sign), largest) for sign in (-1.0, 1.0)]
    table = np.concatenate([halves[0][::-1], [0.0], halves[1]])
    table.setflags(write=False)
    return table


NO_VALVE = ValveArea((), ())


class _WithoutKnots(ABC):
    """What valves have in common whose area is no curve through knots."""

    max_command: float
    interpolation_uncertainty: ClassVar[float] = 0.0

    @abstractmethod
    def __call__(self, u: Array) -> Array:
        """Return the effective area in m^2 at u, shape of u."""

    def table(self, largest: float) -> Array:
        """Return the area at commands up to ``largest`` V in both directions, shape (TABLE_POINTS,), read-only."""
        table = self(np.linspace(-largest, largest, TABLE_POINTS))
        table.setflags(write=False)
        return table

    @property
    def commands(self) -> tuple[float, ...]:
        """The largest command in V of each sign."""
        return (-self.max_command, self.max_command)

    def roughness(self) -> Array:
        """Return no residuals: a line and two areas have no shape that could be rough."""
        return np.zeros(0)


@dataclass(frozen=True)
class LinearValve(_WithoutKnots):
    """One gain in m^2/V for both directions, up to ``max_command`` V; ``label`` begins its parameter's name."""

    gain: float
    max_command: float
    label: str = "valve"
    form: ClassVar[Literal["map", "linear", "switching"]] = "linear"
    covers: ClassVar[frozenset[Part]] = frozenset()

    def __call__(self, u: Array) -> Array:
        """Return the effective area in m^2 at u, shape of u."""
        return self.gain * np.abs(u)

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

    def changed_ranges(self, other: LinearValve) -> tuple[tuple[float, float], ...]:
        """Return the ranges of commands in V in which another valve of this form may differ."""
        return ((-np.inf, np.inf),) if self != other else ()


@dataclass(frozen=True)
class SwitchingValve(_WithoutKnots):
    """Effective areas in m^2 of filling and venting, at commands up to ``max_command`` V.

    ``label`` begins the names of its parameters.
    """

    fill: float
    vent: float
    max_command: float
    label: str = "valve"
    form: ClassVar[Literal["map", "linear", "switching"]] = "switching"
    covers: ClassVar[frozenset[Part]] = frozenset({"linear valve"})

    def __call__(self, u: Array) -> Array:
        """Return the effective area in m^2 at commands u in V, of their shape; 0 at the null command only."""
        return np.where(u > 0.0, self.fill, np.where(u < 0.0, self.vent, 0.0))

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

    def changed_ranges(self, other: SwitchingValve) -> tuple[tuple[float, float], ...]:
        """Return the ranges of commands in V in which another valve of this form may differ."""
        both = ((-np.inf, 0.0), self.vent != other.vent), ((0.0, np.inf), self.fill != other.fill)
        return tuple(side for side, differs in both if differs)
