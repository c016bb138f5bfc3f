"""Part of ``init``: a raw file as it was looked at, its columns, and what each column is taken for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pneucli.arrays import Array
from pneucli.io.raw_file import ColumnKey, RawFile
from pneucli.units import ReferenceState


@dataclass(frozen=True, eq=False)
class Column:
    """One column of numbers: its ``key`` in the pipeline file, its ``name``, the unit that the file says, its values.

    ``where`` is the label column and the label, of the channel of a long table. ``thousands`` is its own mark. The
    unit is empty where the file says none that is known; what it writes then stands in ``written``, which also holds
    a unit whose factor may be meant either way. One of the column's numbers is ``scale`` units. ``clock`` is the
    column of its own stamps. ``computed``: the key is an expression over columns; ``is_clock``: the file itself says
    that these are stamps.
    """

    key: ColumnKey
    name: str
    unit: str
    values: Array = field(repr=False)
    where: tuple[ColumnKey, str] | None = None
    thousands: str | None = None
    scale: float = 1.0
    written: str = ""
    clock: ColumnKey | None = None
    computed: bool = False
    is_clock: bool = False

    @property
    def finite_values(self) -> Array:
        """The values that are numbers."""
        return self.values[np.isfinite(self.values)]


@dataclass(frozen=True, eq=False)
class Survey:
    """A raw file: how it has to be read, its columns, and what it has one value of only.

    ``unused`` says of each further column why it is left out; ``parts`` is in how many tables the header stands again
    and the clock starts anew, 0 where it is one table; ``runs`` has the columns of each run that one table holds, and
    ``run`` is the one that the columns are of. ``state``: of volumes of air, as a line above the table tells it.
    """

    raw: RawFile
    is_text: bool
    columns: Sequence[Column]
    scalars: dict[str, float]
    unused: Sequence[str] = ()
    parts: int = 0
    runs: Sequence[tuple[str, Sequence[Column]]] = ()
    run: str = ""
    state: ReferenceState | None = None

    @property
    def path(self) -> Path:
        """The file."""
        return self.raw.path


class UnitGuess(NamedTuple):
    """The unit that numbers are most likely in, and why; ``asked``: people have to say it.

    ``at_ambient`` says how a pressure is at ambient pressure in that unit, ``"rests"`` or ``"is lowest"``; else empty.
    """

    unit: str
    why: str
    asked: bool = False
    at_ambient: str = ""


@dataclass(frozen=True, eq=False)
class Guess:
    """One column and the signal it is taken for, read in ``unit``; ``signal`` is empty where nothing fits.

    ``unit_stated``: whether the file says the unit; ``reference``: gauge or absolute, where the name says it; ``note``:
    what speaks for it. One of the column's numbers is ``scale`` units; NaN: people have to say it. ``missing`` are the
    numbers that mark no value. ``ask_unit``: people have to say the unit; ``unit`` is what the numbers look like, and
    ``at_ambient`` as :class:`UnitGuess` has it. ``rival``: which other column fits the signal as well, in words;
    ``only_pressure``: taken for p1 as no other pressure is recorded, whatever it is called.
    """

    column: Column
    signal: str
    unit: str = ""
    unit_stated: bool = False
    reference: str = ""
    note: str = ""
    scale: float = 1.0
    missing: tuple[float, ...] = ()
    ask_unit: bool = False
    at_ambient: str = ""
    rival: str = ""
    only_pressure: bool = False

    @property
    def why(self) -> str:
        """What speaks for it and against it, in words."""
        return "; ".join(filter(None, (self.rival, self.note)))
