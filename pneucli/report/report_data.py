"""The data of a report: the stages' answers and tables, and the checks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneucli.experiments import EXPERIMENT_KINDS
from pneucli.messages import answer_of, compare, diagnose, ingest
from pneucli.messages.formatting import format_plain
from pneucli.messages.history import Model

T = TypeVar("T")
CHECK_TITLES = ("check", "wanted", "found", "")


@dataclass(frozen=True)
class Table:
    """Columns of equal length and the unit of each; a long table of mixed quantities has a column ``unit``."""

    columns: Mapping[str, ArrayLike]
    units: Mapping[str, str] = field(default_factory=dict)

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self._arrays[name]

    def __contains__(self, name: str) -> bool:
        return name in self.columns

    def __len__(self) -> int:
        return next(iter(self._arrays.values())).size if self.columns else 0

    @cached_property
    def _arrays(self) -> dict[str, NDArray[Any]]:
        return {name: np.asarray(values) for name, values in self.columns.items()}

    def text(self, name: str) -> str:
        """Return the first value of a column of text."""
        return str(self[name][0])

    def rows(self, chosen: NDArray[Any]) -> Table:
        """Return the rows that an index or a mask chooses."""
        return Table({name: values[chosen] for name, values in self._arrays.items()}, self.units)

    def where(self, **equals: object) -> Table:
        """Return the rows whose columns have these values."""
        chosen = np.ones(len(self), dtype=bool)
        for name, value in equals.items():
            chosen &= self[name] == value
        return self.rows(chosen)

    def groups(self, *names: str) -> Iterator[tuple[tuple[Any, ...], Table]]:
        """Yield the rows of each combination of values of the columns ``names``, in the order of appearance."""
        if not len(self):
            return
        keys = [self[name] for name in names]
        cuts = np.flatnonzero(np.logical_or.reduce([key[1:] != key[:-1] for key in keys])) + 1
        blocks: dict[tuple[Any, ...], list[NDArray[np.int64]]] = {}
        for block in np.split(np.arange(len(self)), cuts):
            blocks.setdefault(tuple(key[block[0]] for key in keys), []).append(block)
        for combination, parts in blocks.items():
            yield combination, self.rows(np.concatenate(parts))


@dataclass(frozen=True)
class Check:
    """One check: its path, its limit, the value, why it fails, and why it is skipped (both may be empty)."""

    path: str
    wanted: str
    value: Any
    failure: str = ""
    skipped: str = ""

    @property
    def row(self) -> tuple[str, ...]:
        """The row of a table under ``CHECK_TITLES``."""
        found = format_plain(self.value, 4) if isinstance(self.value, float) else str(self.value)
        verdict = "failed" if self.failure else "passed"
        return self.path, self.wanted, "nothing there" if self.value is None else found, verdict


@dataclass(frozen=True)
class EarlierAnswer(Generic[T]):
    """An earlier answer of a stage about an earlier model on the same data, and a table that was stored with it."""

    answer: T
    table: Table = field(default_factory=lambda: Table({}))


@dataclass(frozen=True)
class ReportData:
    """The pipeline's name, the answers by stage, the tables by ``"stage/file"``, and the checks; any may be absent.

    Attributes:
        history: Every model that was compared, as ``pneucli history`` lists them.
        first_comparison: The comparison of the first of them on the same data, with its residuals.
        diagnoses: The earlier diagnoses, oldest first, each with the shapes of its residuals.
        rig: The kind of rig.
        file: The pipeline file.
        footer: The origin of the report, for its last lines.

    """

    name: str
    answers: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    tables: Mapping[str, Table] = field(default_factory=dict)
    checks: Sequence[Check] = ()
    footer: Mapping[str, str] = field(default_factory=dict)
    rig: str = ""
    file: str = "pipeline.toml"
    history: Sequence[Model] = ()
    first_comparison: EarlierAnswer[compare.Answer] | None = None
    diagnoses: Sequence[EarlierAnswer[diagnose.Answer]] = ()

    def answer(self, stage: str) -> Mapping[str, Any]:
        """Return a stage's answer, empty where there is none."""
        return self.answers.get(stage, {})

    def read(self, kind: type[T]) -> T:
        """Return the answer of a stage as its type in :mod:`pneucli.messages`, empty where there is none."""
        return answer_of(kind, self.answers)

    @property
    def steady_recordings(self) -> set[str]:
        """The recordings of steady benches, whose rows have no clock."""
        return {one.name for one in self.read(ingest.Answer).recordings if EXPERIMENT_KINDS[one.experiment].steady}

    def table(self, name: str) -> Table:
        """Return a table, empty where there is none."""
        return self.tables.get(name, Table({}))
