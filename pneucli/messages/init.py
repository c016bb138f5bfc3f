"""What was seen in raw files, what was made of it, and what is left to people."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from shlex import quote

from pneucli.messages import StageAnswer, each, labelled, table
from pneucli.messages.formatting import format_plain


@dataclass(frozen=True)
class Column:
    """A column of a kind of file: its range in ``unit``, the signal it is taken for, "" for none, and why."""

    file: str
    part: int | None
    run: str
    column: str | int
    signal: str
    unit: str
    gauge: bool
    least: float | None
    median: float | None
    most: float | None
    why: str

    @property
    def row(self) -> tuple[str, ...]:
        """The column in a table: its name, signal, unit and range."""
        gauge = " gauge" * self.gauge
        numbers = ("" if one is None else format_plain(one, 4) for one in (self.least, self.median, self.most))
        return (f"{self.column}", self.signal or "-", f"{self.unit}{gauge}", *numbers)


@dataclass(frozen=True)
class Kind:
    """A kind of recording: its first file, part and run, how many files there are, and which are held out."""

    file: str
    part: int | None
    run: str
    files: int
    experiment: str
    held_out: Sequence[str]


@dataclass(frozen=True)
class Waiting:
    """A key of the pipeline file that waits to be filled in, and its line."""

    line: int
    key: str


@dataclass(frozen=True)
class Answer(StageAnswer):
    """The pipeline file that was written, what was seen in raw files, and the lines that people fill in or check."""

    columns: Sequence[Column]
    left_out: Sequence[str]
    cannot: Sequence[str]
    recordings: Sequence[Kind]
    fill_in: Sequence[Waiting]
    check: Sequence[int]

    def lines(self, file: str, verbose: bool) -> Iterator[str]:
        """Yield each column with its range and what it is taken for, the kinds of recordings, and what to do."""
        if not self.columns:
            yield from labelled("do", f"describe your rig and recordings in {file}, then pneucli run {file}")
            return
        yield from column_lines(self.recordings, self.columns)
        yield from each("left out", self.left_out)
        yield from each("cannot", self.cannot)
        yield from labelled("wrote", self.pipeline)
        if self.check:
            lines = ", ".join(map(str, self.check))
            yield from labelled("check", f"line {lines}: what the data alone cannot tell")
        look = f"pneucli look {' '.join(dict.fromkeys(quote(one.file) for one in self.recordings))}"
        yield from labelled("do", f"{look} to see the curves; {self._next(file)}")

    def _next(self, file: str) -> str:
        if not self.fill_in:
            return f"pneucli run {file}"
        keys = ", ".join(f"{one.key} (line {one.line})" for one in self.fill_in)
        these = "this one" if len(self.fill_in) == 1 else f"these {len(self.fill_in)}"
        return f"fill in {these}: {keys}; then pneucli run {file}"


def column_lines(kinds: Sequence[Kind], columns: Sequence[Column]) -> Iterator[str]:
    """Yield the columns of each kind of recording with their ranges, and why each is taken as it is."""
    for one in kinds:
        held = f"held out to test: {', '.join(one.held_out)}" if one.held_out else "none held out"
        count = f"{one.files} file" + "s" * (one.files > 1)
        part = f", run {one.run}" if one.run else "" if one.part is None else f", part {one.part}"
        yield from labelled("kind", f"{_short(one.file)}{part}: {count}, {one.experiment}; {held}")
        own = [c for c in columns if (c.file, c.part, c.run) == (one.file, one.part, one.run)]
        head = ("column", "taken for", "unit", "least", "median", "most")
        yield from table(head, [column.row for column in own], texts=3)
        for column in own:
            if column.why and column.signal:
                yield from labelled("", f"{column.signal}: {column.why.replace('CHECK ', '')}")
        yield ""


def _short(file: str) -> str:
    return "/".join(PurePath(file).parts[-2:])
