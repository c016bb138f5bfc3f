"""Where the report is, and whether what was stated holds."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from pneucli.messages import StageAnswer, labelled
from pneucli.messages.formatting import join_names


@dataclass(frozen=True)
class StatedCheck:
    """A check of the pipeline file, by its path into the answers."""

    path: str
    passed: bool


@dataclass(frozen=True)
class DefaultCheck:
    """A check of the selected controller: the value found, and whether it passed; neither where it was skipped."""

    path: str
    passed: bool | None
    value: float | bool | None


@dataclass(frozen=True)
class Answer(StageAnswer):
    """What the stage ``report`` wrote: the page first, its size in bytes, and the checks."""

    files: Sequence[str]
    tables: Sequence[str]
    bytes: int
    checks: Sequence[StatedCheck]
    default_checks: Sequence[DefaultCheck]

    def lines(self, file: str, verbose: bool) -> Iterator[str]:
        """Yield the files, the checks that failed, and how to look at them."""
        page, *others = self.files
        yield from labelled("wrote", f"report/{page} ({self.bytes / 1e6:.1f} MB), {', '.join(others)}")
        if failed := [one.path for one in self.checks if not one.passed]:
            yield from labelled("failed", f"checks: {join_names(failed)}")
        yield from labelled("do", f"pneucli open {file}")
