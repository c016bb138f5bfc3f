"""Raw files as they would be taken: each signal with its column, unit, range, rests and a curve, then doubts."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from pneucli.figure import optional
from pneucli.messages import each, init, labelled, table
from pneucli.messages.formatting import format_percent, format_plain, format_quantity

CURVE = 40  # characters
_LEVELS = "▁▂▃▄▅▆▇█"
MAX_RESTS = 3  # levels that are said


@dataclass(frozen=True)
class Rest:
    """A level at which a signal rests, and the share of the time that it does."""

    level: float
    share: float


@dataclass(frozen=True)
class Signal:
    """A signal of a recording in SI: its readings, the share of them that is missing, its noise, and a curve of it."""

    signal: str
    unit: str
    least: float
    median: float
    most: float
    missing: float
    noise: float | None
    noise_ci95: Sequence[float] | None
    rests: Sequence[Rest]
    time: Sequence[float]
    values: Sequence[float | None]

    @property
    def row(self) -> tuple[str, ...]:
        """The signal in a table: its curve, its rests, its range and its noise."""
        shown = [format_quantity(one, self.unit) for one in (self.least, self.median, self.most)]
        noise = "" if not self.noise else format_quantity(self.noise, self.unit, 2)
        if self.noise and self.noise_ci95:
            noise += f" ({' to '.join(format_quantity(end, self.unit, 2) for end in self.noise_ci95)})"
        return self.signal, curve(self.time, self.values), self.rest_text, *shown, noise

    @property
    def rest_text(self) -> str:
        """The levels at which it rests, in words."""
        return ", ".join(
            f"{format_quantity(one.level, self.unit, 3)} ({format_percent(one.share)})"
            for one in self.rests[:MAX_RESTS]
        )


@dataclass(frozen=True)
class Recording:
    """A recording as it would be read; ``rate`` is in Hz, None where its samples have none."""

    name: str
    experiment: str
    samples: int
    seconds: float
    rate: float | None
    signals: Sequence[Signal]


@dataclass(frozen=True)
class Answer:
    """What raw files hold; ``recordings`` is empty where a ``?`` keeps them from being read."""

    schema: str
    kinds: Sequence[init.Kind]
    columns: Sequence[init.Column]
    left_out: Sequence[str]
    cannot: Sequence[str]
    recordings: Sequence[Recording]
    repairs: Sequence[str]
    doubts: Sequence[str]
    page: str | None = optional()

    def lines(self, file: str, verbose: bool) -> Iterator[str]:
        """Yield columns as ``init`` shows them, the curves of each recording, what is left out, and doubts."""
        yield from init.column_lines(self.kinds, self.columns)
        for one in self.recordings:
            rate = "" if one.rate is None else f", {format_plain(one.rate, 4)} Hz"
            about = f"{one.experiment}, {one.samples} samples{rate}, {format_plain(one.seconds, 4)} s"
            yield from labelled("reads", f"{one.name}: {about}")
            head = ("signal", "curve", "rests at", "least", "median", "most", "noise")
            yield from table(head, [signal.row for signal in one.signals], texts=3)
            yield ""
        yield from each("left out", self.left_out)
        yield from each("cannot", self.cannot)
        yield from each("doubt", self.doubts)
        if verbose:
            yield from each("repair", self.repairs)
        yield from labelled("do", f"pneucli init DIR --from {file}, which writes this into a pipeline file")


def curve(time: Sequence[float], values: Sequence[float | None]) -> str:
    """Return a curve in one line of characters, each the middle of what was read meanwhile; a blank where nothing was.

    >>> curve([0.0, 1.0, 2.0, 3.0, 4.0, 5.0], [0.0, 1.0, 2.0, None, 7.0, 7.0])
    '▁▂▃ ██'
    """
    known = [(at, value) for at, value in zip(time, values, strict=True) if value is not None and math.isfinite(value)]
    if not known:
        return ""
    count, begin, length = min(CURVE, len(values)), time[0], (time[-1] - time[0]) or 1.0
    cells: list[list[float]] = [[] for _ in range(count)]
    for at, value in known:
        cells[min(int(count * (at - begin) / length), count - 1)].append(value)
    middle = [0.5 * (min(cell) + max(cell)) if cell else None for cell in cells]
    low, span = min(value for _, value in known), max(value for _, value in known) - min(value for _, value in known)
    marks = (" " if one is None else _LEVELS[round((one - low) / (span or 1.0) * (len(_LEVELS) - 1))] for one in middle)
    return "".join(marks)
