"""One axis of time for all recordings, one after the other, and their panels joined on it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
