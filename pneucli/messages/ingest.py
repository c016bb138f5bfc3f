"""The answer of ``ingest``: what was read, what had to be repaired, and what cannot be true of it."""

import statistics
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from pneucli.figure import flat
from pneucli.messages import StageAnswer, each, labelled, table
from pneucli.messages.compare import LeftOut
from pneucli.messages.formatting import format_plain, in_display_unit, unit_symbol

Weight = Literal["contradiction", "doubt"]
LOSSES = "no_stamp duplicate backward truncated outside other_channel joined no_overlap"


@dataclass(frozen=True)
class NoiseAnswer:
    """The noise of a signal."""

    rms: float
    unit: str


@dataclass(frozen=True)
class Recording:
    """A recording as it was read; ``losses`` are rows that did not become samples, by the reason in ``LOSSES``.

    ``period`` and the ends of its time are in s, ``added_mass`` in kg.
    """

    name: str
    experiment: str
    use: str
    chamber_2: str
    imposed: str
    valve_shut: bool
    chamber: int
    added_mass: float
    file: str
    sha256: str
    rows_read: int
    samples: int
    losses: Mapping[str, int] = field(metadata=flat(LOSSES))
    period: float
    signals: Sequence[str]
    from_: float
    to: float
    noise: Mapping[str, NoiseAnswer]


@dataclass(frozen=True)
class Repair:
    """What was mended or noticed in a recording: in which signal, what kind, how often, and in words."""

    recording: str
    signal: str
    kind: str
    count: int
    message: str

    @property
    def text(self) -> str:
        """The recording, the signal where it is one, and what was repaired."""
        return f"{', '.join(filter(None, (self.recording, self.signal)))}: {self.message}"


@dataclass(frozen=True)
class SignalSummary:
    """One signal in its SI ``unit``: ``rate`` in samples per second, ``missing`` as share of the recording's time.

    ``speed`` is the change per second that 1 % of the steps exceed, so that one spike does not stand for all. What too
    few samples cannot tell is None.
    """

    unit: str
    least: float
    median: float
    most: float
    noise: float | None
    rate: float | None
    speed: float | None
    missing: float


@dataclass(frozen=True)
class Implausible:
    """What is odd, or cannot be true, in one signal of one recording.

    Attributes:
        check: Name of the check.
        signal: Name of the signal.
        recording: Name of the recording.
        found: The evidence with its numbers.
        mend: The edit of the pipeline file that would mend it.
        excess: How far outside it is, in units of its own standard uncertainty; of what is counted, the count.
        share: Share of the data over which it is.
        weight: ``contradiction`` where what is recorded and what is stated cannot both hold by physics, else ``doubt``.
    """

    check: str
    signal: str
    recording: str
    found: str
    mend: str
    excess: float
    share: float = 1.0
    weight: Weight = "doubt"


@dataclass(frozen=True)
class Answer(StageAnswer):
    """What was read: recordings, what was left out and repaired, signals at a glance, and what is odd in them."""

    recordings: Sequence[Recording]
    left_out: Sequence[str]
    repairs: Sequence[Repair]
    warnings: Sequence[str]
    looks: Mapping[str, Mapping[str, SignalSummary]]
    plausibility: Sequence[Implausible]
    findings: Mapping[str, int]

    def lines(self, file: str, verbose: bool) -> Iterator[str]:
        """Yield the number of recordings, each of them, and all repairs."""
        uses = [sum(one.use == use for one in self.recordings) for use in ("train", "test")]
        yield from labelled("read", f"{len(self.recordings)} recordings, {uses[0]} to fit and {uses[1]} to test")
        rows = [(one.name, one.experiment, one.use, f"{one.samples}", " ".join(one.signals)) for one in self.recordings]
        yield from table(("recording", "experiment", "use", "samples", "signals"), rows, texts=5)
        if self.looks:
            yield ""
            yield from signal_summary_table(self.looks, {one.name: one.experiment for one in self.recordings})
            yield ""
        yield from each("left out", self.left_out)
        # the weightier repairs are warnings, too
        yield from each("repair", (one.text for one in self.repairs if one.text not in self.warnings))
        yield from each("warning", self.warnings)
        yield from labelled("do", next_step(self.plausibility, file))

    def plausibility_lines(self, left_out: Sequence[LeftOut] = ()) -> Iterator[str]:
        """Yield the findings: conflicts first; nothing where there are none.

        ``left_out`` has the recordings, or their signals, that a stage does not use for theirs.
        """
        groups: dict[str, list[Implausible]] = {"left out": [], "conflict": [], "doubt": []}
        for one in self.plausibility:
            is_left_out = any(one.recording == p.recording and p.signal in (None, one.signal) for p in left_out)
            groups["doubt" if one.weight == "doubt" else "left out" if is_left_out else "conflict"].append(one)
        for label, group in groups.items():
            yield from each(label, implausibility_sentences(group))


HOW_READ = ("unit", "reference")  # checks that doubt how the numbers of a signal are read


def next_step(findings: Sequence[Implausible], file: str) -> str:
    """Return what to do next: mend what cannot be true, say how a doubtful signal is read, else compare.

    >>> next_step([Implausible("unit", "p1", "run", "p1 reaches 700 bar", "check unit in [signals] p1", 3.0)], "a.toml")
    'check unit in [signals] p1, then pneucli ingest a.toml'
    >>> next_step([], "a.toml")
    'pneucli compare a.toml'
    """
    first = next((one for one in findings if one.weight == "contradiction" or one.check in HOW_READ), None)
    return f"pneucli compare {file}" if first is None else f"{first.mend}, then pneucli ingest {file}"


def implausibility_sentences(findings: Sequence[Implausible]) -> list[str]:
    """Return one sentence for each check, signal and weight, with the recordings that it was found in.

    The first recording speaks for all of them: its numbers are shown.
    """
    groups: dict[tuple[str, ...], list[Implausible]] = {}
    for one in findings:
        groups.setdefault((one.check, one.signal, one.weight), []).append(one)
    return [_sentence(group) for group in groups.values()]


def _sentence(group: Sequence[Implausible]) -> str:
    first, names = group[0], list(dict.fromkeys(one.recording for one in group))
    others = f" and {len(names) - 1} more" if len(names) > 1 else ""
    return f"{names[0]}{others}, {first.found}; {first.mend}"


def signal_summary_table(
    summaries: Mapping[str, Mapping[str, SignalSummary]], experiments: Mapping[str, str]
) -> Iterator[str]:
    """Yield a table: a row a signal of an experiment, over all its recordings.

    ``summaries`` maps recordings and signals to what ``ingest`` saw, ``experiments`` recordings to their experiment.
    """
    rows: dict[tuple[str, str], list[SignalSummary]] = {}
    for recording, signals in summaries.items():
        for signal, one in signals.items():
            rows.setdefault((experiments[recording], signal), []).append(one)
    head = ("experiment", "signal", "least", "median", "most", "noise", "unit", "rate")
    return table(head, [_row(*key, seen) for key, seen in rows.items()], texts=2)


def _row(experiment: str, signal: str, seen: Sequence[SignalSummary]) -> tuple[str, ...]:
    values = (min(s.least for s in seen), statistics.median(s.median for s in seen), max(s.most for s in seen))
    noise, rate = [s.noise for s in seen if s.noise is not None], [s.rate for s in seen if s.rate is not None]
    unit = seen[0].unit
    return (
        *(experiment, signal),
        *(format_plain(in_display_unit(value, unit), 4) for value in values),
        format_plain(in_display_unit(statistics.median(noise), unit), 2) if noise else "?",
        unit_symbol(unit),
        f"{format_plain(statistics.median(rate), 4)} Hz" if rate else "?",
    )
