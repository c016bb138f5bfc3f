"""Tables of a stage, row by row."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from pneucli.io.artifacts import Tables


def write_table_rows(
    tables: Tables, name: str, columns: str, rows: Iterable[Sequence[Any]], units: Mapping[str, str]
) -> None:
    """Write a table, also one without rows; ``columns`` names what each row holds, in its order.

    What has no unit, and texts, are written as they are; a number that is None is NaN.
    """
    names, listed = columns.split(), list(rows)
    cells = zip(*listed, strict=True) if listed else [()] * len(names)
    tables.write(name, {n: _column(of, n in units) for n, of in zip(names, cells, strict=True)}, units)


def _column(cells: Sequence[Any], has_unit: bool) -> Any:
    if not has_unit or any(isinstance(one, str) for one in cells):
        return list(cells)
    return np.array([np.nan if one is None else one for one in cells])
