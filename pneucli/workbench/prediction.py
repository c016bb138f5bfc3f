"""Curves between two simulated values of one parameter: what is shown of a long recording while the hand moves."""

import math
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array, Integers
from pneucli.compare import ChannelResult, Comparison
from pneucli.messages.envelope import envelope_indices, with_gap_indices
from pneucli.quantities import SIGNALS
from pneucli.report.page_elements import Panel, Series
from pneucli.report.report_data import Table
from pneucli.simulate.experiment import Experiment

Interval = tuple[float, float]  # s
GAP = 0.02  # of the longest recording, between two recordings
MAX_RESTARTS = 400  # ticks of a panel; more would be a bar


@dataclass(frozen=True)
class Place:
    """A recording's place: it goes from ``begin`` to ``end`` in s of the axis; its own first time is ``first``."""

    name: str
    begin: float
    end: float
    first: float

    def own(self, interval: Interval | None) -> Interval | None:
        """Return the recording's own times within an interval of the axis (None: everything), None where none are.

        >>> Place("second", 10.0, 14.0, 1.0).own((12.0, 20.0))
        (3.0, 5.0)
        """
        begin, end = (self.begin, self.end) if interval is None else interval
        begin, end = max(begin, self.begin), min(end, self.end)
        return (begin - self.shift, end - self.shift) if begin < end else None

    @property
    def shift(self) -> float:
        """The time in s from one of the recording's own times to its place on the axis."""
        return self.begin - self.first


def lay_out(experiments: Iterable[Experiment]) -> dict[str, Place]:
    """Return the place of each recording: those held out first, else in the given order."""
    ordered = sorted(experiments, key=lambda one: one.recording.use != "test")
    gap = GAP * max((float(np.ptp(one.time)) for one in ordered), default=0.0)
    places, begin = {}, 0.0
    for one in ordered:
        first, last = float(one.time[0]), float(one.time[-1])
        places[one.recording.name] = Place(one.recording.name, begin, begin + last - first, first)
        begin += last - first + gap
    return places


def visible(places: Mapping[str, Place], interval: Interval | None) -> dict[str, Interval]:
    """Return the recordings within an interval of the axis, and the own times of each."""
    found = {name: own for name, one in places.items() if (own := one.own(interval)) is not None}
    # between two recordings or beyond the last there is nothing to draw: then the nearest stands alone
    if found or interval is None or not places:
        return found
    nearest = min(places.values(), key=lambda one: abs(one.begin + one.end - sum(interval)))
    return {nearest.name: (nearest.first, nearest.first + nearest.end - nearest.begin)}


def within(table: Table, interval: Interval) -> Table:
    """Return the rows within an interval, and one more on each side, so that curves go on to the edge."""
    time = table["time"]
    first, last = np.searchsorted(time, interval)
    rows = slice(max(int(first) - 1, 0), max(int(last) + 1, 2))
    return Table({n: v if n == "unit" else np.asarray(v)[rows] for n, v in table.columns.items()}, table.units)


def joined(parts: Sequence[tuple[Place, Sequence[Panel]]]) -> list[Panel]:
    """Return the panels of recordings as one panel of each title on the common axis, with a gap between recordings."""
    by_title: dict[tuple[str, str], list[tuple[Place, Panel]]] = {}
    for place, panels in parts:
        for panel in panels:
            by_title.setdefault((panel.title, panel.unit), []).append((place, panel))
    return [_joined(some) for some in by_title.values()]


def _joined(parts: Sequence[tuple[Place, Panel]]) -> Panel:
    roles = {series.label: series.role for _, panel in parts for series in panel.series}
    times: list[NDArray[Any]] = []
    curves: dict[str, list[NDArray[Any]]] = {label: [] for label in roles}
    for i, (place, panel) in enumerate(parts):
        time = np.asarray(panel.time, dtype=np.float64) + place.shift
        # a sample without a value: no line leads from one recording to the next
        break_at = [0.5 * (times[-1][-1:] + time[:1])] if i else []
        times += [*break_at, time]
        values = {one.label: one.values for one in panel.series}
        for label, curve in curves.items():
            missing = np.full(time.size, np.nan)
            curve.extend(np.full(1, np.nan) for _ in break_at)
            curve.append(values.get(label, missing))
    restarts = [one + place.shift for place, panel in parts for one in panel.restarts]
    return replace(
        parts[0][1],
        time=np.concatenate(times),
        series=[Series(label, roles[label], np.concatenate(some)) for label, some in curves.items()],
        restarts=restarts if len(restarts) <= MAX_RESTARTS else (),
    )


MAX_SIMULATED = 3  # simulations that are kept: of long recordings each is large
MAX_REACH = 30.0  # distances of two simulations, over which the line through them is carried on
SPARE = 4  # times as many samples as are drawn: the extremes move with the parameter


@dataclass(frozen=True, eq=False)
class Simulated:
    """One simulation of the recordings that were visible.

    Attributes:
        others: What tells its model from the fitted one, but for the values of parameters.
        values: The values that differ from the fitted ones, by name, SI.
        found: The comparison of each recording.
        seconds: How long it took.

    """

    others: object
    values: Mapping[str, float]
    found: Mapping[str, Comparison]
    seconds: float


@dataclass(frozen=True)
class Line:
    """Two simulations that differ in one parameter; the asked value lies at ``share``, from the first's (0) to the
    second's (1).
    """

    first: Simulated
    second: Simulated
    share: float


class Prediction:
    """The last simulations, and straight lines between them: sample by sample, over the value of one parameter.

    One thread may keep a simulation while another one predicts.
    """

    def __init__(self) -> None:
        self._simulated: deque[Simulated] = deque(maxlen=MAX_SIMULATED)
        self._thinned: dict[str, tuple[object, _Thinned]] = {}

    def keep(self, one: Simulated) -> None:
        """Keep a simulation; the oldest is forgotten."""
        self._simulated.append(one)
        self._thinned.clear()

    def same(self, others: object, values: Mapping[str, float], recordings: Sequence[str]) -> Simulated | None:
        """Return the kept simulation of exactly this model and these recordings; None where there is none."""
        kept = tuple(self._simulated)
        fits = [one for one in kept if one.others == others and one.values == values]
        return next((one for one in fits if set(recordings) <= set(one.found)), None)

    def line(
        self, others: object, values: Mapping[str, float], moving: str, fitted: float, recordings: Sequence[str]
    ) -> Line | None:
        """Return the line through the two simulations that are nearest in one parameter and equal in all else.

        Args:
            others: As :attr:`Simulated.others`.
            values: The values that are asked for.
            moving: The parameter that moves.
            fitted: Its fitted value.
            recordings: Those that are visible.

        Returns:
            The line; None where there are no two simulations, or both are too close for so far a value.

        """
        rest = {name: value for name, value in values.items() if name != moving}
        asked = values.get(moving, fitted)
        near: dict[float, Simulated] = {}
        for one in tuple(self._simulated):
            alike = one.others == others and {n: v for n, v in one.values.items() if n != moving} == rest
            if alike and set(recordings) <= set(one.found):
                near[one.values.get(moving, fitted)] = one
        if len(near) < 2:
            return None
        first, second = sorted(near, key=lambda value: abs(value - asked))[:2]
        share = (asked - first) / (second - first)
        return Line(near[first], near[second], share) if abs(share) <= MAX_REACH else None

    def tables(
        self, line: Line, recording: str, interval: Interval, max_samples: int
    ) -> tuple[dict[str, Table], tuple[ChannelResult, ...], Integers]:
        """Return a recording's columns by channel, its errors, and the rows of the interval that the columns have.

        The errors are those of the predicted curves over all samples of the recording.
        """
        key = line.first, line.second, interval, max_samples
        kept = self._thinned.get(recording)
        if kept is None or kept[0] != key:
            kept = self._thinned[recording] = key, _thin(line, recording, interval, max_samples)
        thinned, tables = kept[1], {}
        for channel, (table, slope) in thinned.channels.items():
            change = line.share * slope
            moved = {"model": table["model"] + change, "residual": table["residual"] - change}
            tables[channel] = Table({**table.columns, **moved})
        results = tuple(_moved(one, thinned.squares[one.channel], line.share) for one in thinned.results)
        return tables, results, thinned.rows


@dataclass(frozen=True)
class _Thinned:
    """What two simulations of one recording have in common, at few samples.

    ``channels``: the first one's columns and the second's model minus the first's; ``squares``: the mean squares of the
    first's residual, of its product with that difference, and of the difference, over all samples.
    """

    rows: Integers
    channels: Mapping[str, tuple[Table, Array]]
    results: Sequence[ChannelResult]
    squares: Mapping[str, tuple[float, float, float]]


def _thin(line: Line, recording: str, interval: Interval, max_samples: int) -> _Thinned:
    first, second = line.first.found[recording], line.second.found[recording]
    results = [one for one in first.results if one.channel in second.modelled]
    tables, squares, changes = {}, {}, {}
    for channel, table in comparison_tables(first).items():
        change = second.modelled[channel] - first.modelled[channel]
        squares[channel] = _mean_squares(table["residual"], change)
        tables[channel] = within(Table({**table.columns, "change": change}), interval)
        changes[channel] = tables[channel]["change"]
    residuals = [table["residual"] for table in tables.values()]
    moved = [table["residual"] - table["change"] for table in tables.values()]
    measured = [table["measured"] for table in tables.values()]
    rows = envelope_indices([*measured, *residuals, *moved], SPARE * len(tables) * max_samples)
    for residual in residuals:
        rows = with_gap_indices(rows, residual)
    kept = {channel: (at_rows(table, rows), changes[channel][rows]) for channel, table in tables.items()}
    return _Thinned(rows, kept, results, squares)


def at_rows(table: Table, rows: Integers) -> Table:
    """Return some rows of a table whose unit is stated once."""
    return Table({n: v if n == "unit" else np.asarray(v)[rows] for n, v in table.columns.items()})


def comparison_tables(found: Comparison) -> dict[str, Table]:
    """Return the columns of ``compare/residuals.parquet`` by channel, from a comparison in memory."""
    segment = found.experiment.segments.astype(np.float64)
    return {
        r.channel: Table(
            {
                "time": found.experiment.time,
                "unit": np.array([SIGNALS[r.channel].unit]),
                "measured": found.measured[r.channel],
                "model": found.modelled[r.channel],
                "residual": found.residual(r.channel),
                "segment": segment,
            }
        )
        for r in found.results
    }


def _mean_squares(residual: Array, change: Array) -> tuple[float, float, float]:
    """Return the mean squares of a residual, of its product with its change, and of the change, each (n,)."""
    found = np.array([residual @ residual, residual @ change, change @ change])
    if not np.isfinite(found).all():
        known = np.isfinite(residual) & np.isfinite(change)
        return _mean_squares(residual[known], change[known])
    start, product, size = found / max(residual.size, 1)
    return float(start), float(product), float(size)


def _moved(one: ChannelResult, squares: tuple[float, float, float], share: float) -> ChannelResult:
    """Return the errors of a channel whose model has moved by a share of the change."""
    start, product, change = squares
    rmsd = math.sqrt(max(start - 2.0 * share * product + share**2 * change, 0.0))
    times = rmsd / one.rmsd if one.rmsd > 0.0 else math.nan
    return replace(
        one,
        rmsd=rmsd,
        percent=one.percent * times,
        relative_error_percent=one.relative_error_percent * times,
        fit_percent=100.0 - (100.0 - one.fit_percent) * times,
        ratio_to_noise=one.ratio_to_noise * times,
    )
