"""MATLAB structs as columns: Simulink's scopes and logs, dSPACE's experiments, and structs of vectors.

A struct that holds one signal has its numbers under ``values`` or ``Data`` and its name under ``label`` or ``Name``;
the column is then called by that name. Where it has stamps of its own, they are the column's clock.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pneucli.io.column_reader import split_columns
from pneucli.io.raw_file import ColumnValues

NUMBERS = ("values", "data", "value", "signal", "ydata")
LABELS = ("label", "name", "signalname", "title", "blockname")
_STAMPS = ("time", "t", "tout", "timestamps", "xdata")
_UNITS = ("unit", "units")
_CLOCK_NUMBER = "xindex"  # of dSPACE: which of the X belongs to a Y, from 1


@dataclass
class StructColumns:
    """Columns by name, the unit of each, and the clock of those that have one of their own, both by name."""

    columns: dict[str, ColumnValues] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    clocks: dict[str, str] = field(default_factory=dict)
    _numbered: dict[str, int] = field(default_factory=dict)  # of dSPACE

    def add(self, node: Any, name: str) -> None:
        """Add what a variable holds, at any depth."""
        if isinstance(node, Mapping):
            self._add_struct(node, name)
            return
        array = np.atleast_1d(node)
        if array.dtype.names:
            self._add_elements([_fields(one) for one in array.ravel()], name)
        elif array.dtype.kind in "fiub":
            self._add_array(array, name)

    def link_numbered_clocks(self) -> None:
        """Give each column that says the number of its clock that clock."""
        for name, number in self._numbered.items():
            before, slash, _ = name.rpartition("/Y/")
            stamps = [one for one in self.columns if slash and one.startswith(f"{before}/X/")]
            if 1 <= number <= len(stamps):
                self.clocks[name] = stamps[number - 1]

    def _add_elements(self, elements: Sequence[Mapping[str, Any]], name: str) -> None:
        if len(elements) == 1:
            self._add_struct(elements[0], name)
            return
        for number, one in enumerate(elements, 1):
            self._add_struct(one, f"{name}/{_text(one, LABELS) or number}", labelled=True)

    def _add_struct(self, fields: Mapping[str, Any], name: str, *, labelled: bool = False) -> None:
        by_word = {key.lower(): key for key in fields}
        flat = dict(_leaves(fields, ""))
        numbers = [key for key, leaf in flat.items() if _last(key) in NUMBERS and _is_numeric(leaf)]
        label = _text(fields, LABELS)
        if len(numbers) != 1 or not (label or labelled):
            for key, value in fields.items():
                self.add(value, f"{name}/{key}" if name else key)
            return
        own = name if labelled else f"{name}/{label}"
        own = f"{own}/{sum(one.startswith(own) for one in self.columns) + 1}" if own in self.columns else own
        added = self._add_array(np.asarray(flat[numbers[0]]), own)
        unit = next((_text(holder, _UNITS) for holder in (fields, *_inner(fields)) if _text(holder, _UNITS)), "")
        self.units |= dict.fromkeys(added, unit) if unit else {}
        stamps = [key for key, leaf in flat.items() if _last(key) in _STAMPS and _is_numeric(leaf)]
        if stamps and np.size(flat[stamps[0]]) > 1:
            clock = f"{own}/time"
            self.columns[clock] = np.ravel(flat[stamps[0]])
            self.clocks |= dict.fromkeys(added, clock)
        elif _CLOCK_NUMBER in by_word:
            number = np.ravel(fields[by_word[_CLOCK_NUMBER]])
            self._numbered |= dict.fromkeys(added, int(number[0]) if number.size else 0)

    def _add_array(self, array: ColumnValues, name: str) -> list[str]:
        found = split_columns(name, array)
        self.columns |= found
        return list(found)


def _fields(element: Any) -> dict[str, Any]:
    return {key: element[key] for key in element.dtype.names}


def _inner(fields: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    for value in fields.values():
        array = np.atleast_1d(value)
        if array.dtype.names and array.size == 1:
            yield _fields(array.ravel()[0])


def _leaves(fields: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    """Yield the fields of a struct, and of structs of one element within it, by their paths."""
    for key, value in fields.items():
        array = np.atleast_1d(value)
        if array.dtype.names and array.size == 1:
            yield from _leaves(_fields(array.ravel()[0]), f"{prefix}{key}/")
        else:
            yield f"{prefix}{key}", value


def _last(path: str) -> str:
    return path.rpartition("/")[2].lower()


def _is_numeric(value: Any) -> bool:
    return np.atleast_1d(value).dtype.kind in "fiub" and np.size(value) > 0


def _text(fields: Mapping[str, Any], words: Sequence[str]) -> str:
    """Return the first text that stands under one of the words."""
    by_word = {key.lower(): value for key, value in fields.items()}
    for word in words:
        value = by_word.get(word)
        array = np.atleast_1d(value) if value is not None else np.empty(0)
        if array.dtype.kind in "US" and array.size == 1 and str(array.ravel()[0]).strip():
            return str(array.ravel()[0]).strip()
    return ""
