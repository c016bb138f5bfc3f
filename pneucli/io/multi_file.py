"""One recording in several files, each on a clock of its own: one table over all stamps, as of a long table.

A clock is moved by an offset that is stated, that the calendar tells, or that is found where both files hold a signal.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pneucli.arrays import Array
from pneucli.errors import InputError
from pneucli.io.clock import difference_of_starts
from pneucli.io.raw_file import Batch, Repair, joined
from pneucli.io.signal_reader import SignalReader, rebatch
from pneucli.io.timestamp_order import Table, align_tables, loss_repairs
from pneucli.messages.formatting import format_interval, format_plain, format_signal

MIN_OVERLAP = 0.3  # of the shorter recording
MIN_CORRELATION = 0.9  # correlation that the same signal has at least in both files
MAX_RIVAL_ERROR_RATIO = 2.0  # times the least error: another offset that fits as well
MAX_GRID_SAMPLES = 1 << 16  # samples that offsets are tried with
FIND_OFFSET = "find"


@dataclass(frozen=True)
class AdditionalFile:
    """A further file: its signals, and by how much (s) its clock is moved.

    ``offset`` None: as the calendars say, if both files have one, else not at all; ``"find"``: by the signal ``match``.
    """

    opened: SignalReader
    offset: float | str | None = None
    match: str | None = None


class MultiFileRecording:
    """Files that are one recording, to be read like one; ``first`` gives the clock."""

    def __init__(self, first: SignalReader, parts: Sequence[AdditionalFile]) -> None:
        self._first, self._parts = first, parts
        self._all = [first, *(part.opened for part in parts)]
        self._tables: list[Table] = []
        self._rows = np.empty(0, dtype=np.intp)
        self._losses: Counter[str] = Counter()
        self._found: list[Repair] = []
        owners = {name: one for one in reversed(self._all) for name in one.positions}
        self._names = [[name for name in one.positions if owners[name] is one] for one in self._all]
        self.positions = dict.fromkeys(["time", *(name for names in self._names for name in names)])

    @property
    def names(self) -> list[str]:
        """The columns of all files."""
        return [name for one in self._all for name in one.names]

    @property
    def rows(self) -> int:
        """Rows that were read so far."""
        return sum(one.rows for one in self._all)

    @property
    def losses(self) -> Counter[str]:
        """Rows that are none of :meth:`batches`, by kind."""
        return sum((one.losses for one in self._all), self._losses)

    @property
    def repairs(self) -> list[Repair]:
        """What had to be mended or noticed to read the files, and how their clocks were moved."""
        noted = [repair for one in self._all for repair in one.own_repairs]
        return [*noted, *self._found, *loss_repairs(self.losses)]

    def locate(self, row: int) -> str:
        """Return where a row of :meth:`batches` stands in its file."""
        row = int(self._rows[row]) if row < self._rows.size else row
        for one, table in zip(self._all, self._tables, strict=True):
            if row < table.time.size:
                return one.locate(row)
            row -= table.time.size
        return str(self._first.raw.path)

    def batches(self) -> Iterator[Batch]:
        """Yield signals in SI over all stamps; raises InputError where an offset is not to be found."""
        read = [joined(one.batches()) for one in self._all]
        offsets = [0.0, *(self._offset(part, read[0], own) for part, own in zip(self._parts, read[1:], strict=True))]
        first = 0
        for names, own, offset in zip(self._names, read, offsets, strict=True):
            rows = np.arange(first, first + own["time"].size)
            columns = {name: own[name] for name in names if name != "time"}
            self._tables.append(Table(own["time"] + offset, columns, rows))
            first += rows.size
        held = {name for one in self._all for name in one.held}
        aligned = align_tables(self._tables, held, self.locate)
        table, self._losses, self._rows = aligned.table, aligned.losses, aligned.table.rows
        self._found += aligned.repairs
        yield from rebatch(iter([{"time": table.time, **table.columns}]), list(self.positions))

    def _offset(self, part: AdditionalFile, first: Batch, own: Batch) -> float:
        if isinstance(part.offset, float):
            return part.offset
        path = part.opened.raw.path
        if part.offset == FIND_OFFSET:
            offset, evidence = estimate_clock_offset(first, own, part.match or "", f"{path}, key offset")
            self._found.append(Repair("time", "offset", 1, f"{path.name}: its clock was moved by {evidence}"))
            return offset
        starts = self._first.reader.start, part.opened.reader.start
        if starts[0] is None or starts[1] is None:
            if starts != (None, None):
                bare = path if starts[1] is None else self._first.raw.path
                message = (
                    f"{bare.name}: no date says when its clock starts, as the other file's does; both are taken as"
                )
                self._found.append(Repair("time", "offset", 1, f"{message} one clock: state offset where they are not"))
            return 0.0
        offset, zone = difference_of_starts(starts[0], starts[1])
        message = f"{path.name}: its clock was moved by {format_plain(offset)} s, as the dates of both files say"
        message += (
            f"; {format_plain(zone / 3600, 4)} h between them are a time zone that one of them does not write"
            * bool(zone)
        )
        self._found.append(Repair("time", "offset", 1, message))
        return offset


def estimate_clock_offset(first: Batch, own: Batch, match: str, where: str) -> tuple[float, str]:
    """Return by how much (s) the clock of ``own`` is moved so that ``match`` is the same in both, and that in words.

    Raises InputError, ``where`` named, where a file has not the signal, where the two are not alike at any offset, or
    are as much alike at another one.
    """
    for batch in (first, own):
        if match not in batch:
            wanted = 'a signal that both files hold, or offset = "0.35 s"'
            raise InputError(
                where, f'"{match}" is not recorded in both files', wanted, "state match or offset", code="E049"
            )
    a, b = _finite_samples(first, match), _finite_samples(own, match)
    lags, errors, likeness = _cross_correlation(a, b)
    best = int(np.argmin(errors))
    step, slope = float(np.median(np.diff(lags))), _rms_slope(b)
    far = np.abs(lags - lags[best]) > 2.0 * float(np.std(b[1])) / slope  # s, in which it changes by its deviation
    from scipy.optimize import minimize_scalar  # noqa: PLC0415 - few recordings look for an offset

    wanted, mend = f"{match} of one motion in both files", 'state it: offset = "... s"'
    if not likeness[best] > MIN_CORRELATION:
        raise InputError(where, f"{match} is not alike in both files at any offset", wanted, mend, code="E049")
    between = slope**2 * step**2 / 12  # what trying only whole samples adds to an error
    if far.any() and errors[far].min() < MAX_RIVAL_ERROR_RATIO * (errors[best] + between):
        other = lags[far][int(np.argmin(errors[far]))]
        found = f"{match} fits at {format_plain(lags[best], 4)} s and as well at {format_plain(other, 4)} s"
        raise InputError(where, found, f"a {match} that does not repeat itself", mend, code="E049")
    bounds = (lags[best] - step, lags[best] + step)
    fit = minimize_scalar(
        lambda lag: _mean_squared_difference(a, b, lag), bounds=bounds, method="bounded", options={"xatol": 1e-6 * step}
    )
    offset, rest = float(fit.x), float(fit.fun) ** 0.5
    half_width = 2 * rest / (slope * b[0].size ** 0.5)
    evidence = format_interval(offset, "s", (offset - half_width, offset + half_width))
    return offset, f"{evidence}, where {match} fits best (it differs by {format_signal(rest, match, 2)} rms)"


def _finite_samples(batch: Batch, name: str) -> tuple[Array, Array]:
    """Return stamps that rise and values of a signal."""
    good = np.isfinite(batch[name]) & np.isfinite(batch["time"])
    time, at = np.unique(batch["time"][good], return_index=True)
    return time, batch[name][good][at]


def _cross_correlation(a: tuple[Array, Array], b: tuple[Array, Array]) -> tuple[Array, Array, Array]:
    """Return offsets, mean squared differences and correlations; infinite where too little overlaps."""
    from scipy.signal import correlate  # noqa: PLC0415 - slow to import, and few recordings look for an offset

    step = max(
        min(float(np.median(np.diff(t))) for t, _ in (a, b)),
        max(float(np.ptp(t)) for t, _ in (a, b)) / MAX_GRID_SAMPLES,
    )
    grids = [np.arange(t[0], t[-1] + step / 2, step) for t, _ in (a, b)]
    middle = float(np.mean(a[1]))
    x, y = (np.interp(grid, t, v) - middle for grid, (t, v) in zip(grids, (a, b), strict=True))
    ones = np.ones_like(x), np.ones_like(y)
    count = np.round(correlate(ones[0], ones[1]))
    sums = {"x": correlate(x, ones[1]), "y": correlate(ones[0], y), "xx": correlate(x**2, ones[1])}
    sums |= {"yy": correlate(ones[0], y**2), "xy": correlate(x, y)}
    enough = count >= MIN_OVERLAP * min(x.size, y.size)
    n = np.maximum(count, 1)
    errors = np.where(enough, np.maximum(sums["xx"] + sums["yy"] - 2 * sums["xy"], 0.0) / n, np.inf)
    spread = [np.maximum(sums[s + s] / n - (sums[s] / n) ** 2, 0.0) for s in "xy"]
    both = sums["xy"] / n - sums["x"] * sums["y"] / n**2
    likeness = np.where(enough, both / np.maximum(np.sqrt(spread[0] * spread[1]), 1e-300), -1.0)
    lags = (np.arange(count.size) - (y.size - 1)) * step + grids[0][0] - grids[1][0]
    return lags, errors, likeness


def _rms_slope(b: tuple[Array, Array]) -> float:
    return max(float(np.sqrt(np.mean(np.gradient(b[1], b[0]) ** 2))), 1e-300)


def _mean_squared_difference(a: tuple[Array, Array], b: tuple[Array, Array], lag: float) -> float:
    time = b[0] + lag
    inside = (time >= a[0][0]) & (time <= a[0][-1])
    return float(np.mean((np.interp(time[inside], *a) - b[1][inside]) ** 2)) if inside.any() else np.inf
