"""What a fleet's run found: how many rigs, who changed, what failed, and where the page is."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from pneucli.messages import labelled, table
from pneucli.messages.changes import Change
from pneucli.messages.formatting import format_number, join_names

MAX_LISTED_RIGS = 10  # rigs that are listed without -v


@dataclass(frozen=True)
class RigChanges:
    """What changed in a rig between two dates."""

    rig: str
    date: str
    since: str
    changes: Sequence[Change]

    @property
    def sentence(self) -> str:
        """Rig, dates, and what changed."""
        return f"{self.rig} at {self.date}, since {self.since}: {'; '.join(one.text for one in self.changes)}"


@dataclass(frozen=True)
class Failures:
    """How many rows failed by one cause."""

    cause: str
    rows: int


@dataclass(frozen=True)
class HealthySpread:
    """The relative spread of parameters by name between healthy ``dates`` of a rig, the median over ``rigs``."""

    rigs: int
    dates: int
    parameters: Mapping[str, float]


@dataclass(frozen=True)
class Answer:
    """What the run of a fleet found: rows of the table, rigs that changed, failures by cause; ``out`` is the store."""

    schema: str
    fleet: str
    rigs: int
    rows: int
    done: int
    unchanged: int
    failed: int
    changed: int
    alarm_rate: float
    repeatability: HealthySpread | None
    verdicts: Mapping[str, int]
    missing: Mapping[str, int]
    changes: Sequence[RigChanges]
    failures: Sequence[Failures]
    breaks: int
    out: str
    seconds: float

    def lines(self, file: str, verbose: bool) -> Iterator[str]:
        """Yield counts, the rigs that changed, the failures, what to do; behind ``-v`` all that changed."""
        yield from labelled("found", self.summary)
        yield from labelled("repeats", self.repeats)
        listed = self.changes if verbose else self.changes[:MAX_LISTED_RIGS]
        for one in listed:
            yield from labelled("changed", one.sentence)
        if rest := len(self.changes) - len(listed):
            yield from labelled("", f"and {rest} more (-v lists them)")
        for cause in self.failures:
            yield from labelled("failed", f"{cause.rows} rows: {cause.cause}")
        yield from labelled("done", f"{self.done} rows in {self.seconds:.0f} s, {self.unchanged} unchanged")
        yield from labelled("page", f"{self.out}/report.html")
        if verbose:
            yield ""
            yield from table(("verdict", "rows"), [(name, str(n)) for name, n in self.verdicts.items()], texts=1)

    @property
    def summary(self) -> str:
        """The counts in one sentence."""
        text = f"{self.changed} of {self.rigs} rigs changed, {self.failed} of {self.rows} rows failed"
        missing = [f"{name} ({n})" for name, n in list(self.missing.items())[:5]]
        return f"{text}; missing from the model: {join_names(missing)}" if missing else text

    @property
    def repeats(self) -> str:
        """How well the rigs repeat from one healthy date to another, or that nobody knows."""
        if (spread := self.repeatability) is None:
            return "the variation of a healthy rig from date to date is unknown: state [fleet] healthy"
        sizes = [f"{name} {format_number(100 * size, 2)} %" for name, size in spread.parameters.items() if size > 0.0]
        differs = f"from date to date a healthy rig differs by {join_names(sizes)}"
        within = differs if sizes else "healthy dates differ by noise"
        return f"{within} ({spread.rigs} rigs, {spread.dates} dates each)"


def progress_text(done: int, rows: int, failed: int) -> str:
    """Return how many rows are done, and how many of these failed."""
    return f"{done} of {rows} rows, {failed} failed"
