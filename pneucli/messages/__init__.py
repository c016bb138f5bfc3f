"""What the program says of an answer to a person: the verdict first, in bar, mm and mm/s.

One module a stage or command, each with its ``Answer``, whose fields are the keys of the JSON and whose ``lines`` say
what was found, how certain it is, what it changes, what to do, and the tables behind ``-v``. Terminal and report say
the same sentences. Nothing heavy is imported here.
"""

import importlib
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from pneucli.figure import read
from pneucli.paths import from_here

T = TypeVar("T")
LINE_WIDTH = 110  # of a line on a terminal
LABEL_WIDTH = 9  # of the word that a line starts with


@dataclass(frozen=True)
class StageAnswer:
    """What every answer about a pipeline says first: its schema, and the name of the pipeline."""

    schema: str
    pipeline: str


def render(stage: str, answer: Mapping[str, Any], file: str, *, verbose: bool = False) -> str:
    """Return a stage's answer as text; ``file`` is the pipeline file as the user typed it, for the commands."""
    kind = importlib.import_module(f"{__name__}.{stage}").Answer
    return "\n".join(read(kind, answer).lines(file, verbose))


def answer_of(kind: type[T], answers: Mapping[str, Mapping[str, Any]]) -> T:
    """Return the answer of a stage as its type in this package, from those of all stages; empty where there is none."""
    return read(kind, answers.get(kind.__module__.rpartition(".")[2], {}))


def labelled(label: str, text: str) -> Iterator[str]:
    """Yield ``text`` behind its label, wrapped under itself; its paths start from where the user stands."""
    yield from textwrap.wrap(
        f"{label:<{LABEL_WIDTH}}{from_here(text)}",
        LINE_WIDTH,
        subsequent_indent=" " * LABEL_WIDTH,
        break_long_words=False,
        break_on_hyphens=False,
        drop_whitespace=True,
    )


def table(head: Sequence[str], rows: Sequence[Sequence[str]], texts: int) -> Iterator[str]:
    """Yield a table of which the first ``texts`` columns are text, the others numbers."""
    widths = [max(len(row[i]) for row in [head, *rows]) for i in range(len(head))]
    for row in [head, *rows]:
        cells = [c.ljust(w) if i < texts else c.rjust(w) for i, (c, w) in enumerate(zip(row, widths, strict=True))]
        yield "  ".join(cells).rstrip()


def each(label: str, texts: Iterable[str]) -> Iterator[str]:
    """Yield each text behind the same label."""
    for text in texts:
        yield from labelled(label, text)
