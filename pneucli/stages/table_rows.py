"""Tables of a stage, row by row or block by block."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.io.artifacts import Tables
from pneucli.quantities import SIGNALS


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


def write_blocks(
    tables: Tables, name: str, columns: str, blocks: Iterable[Sequence[Any]], units: Mapping[str, str]
) -> None:
    """Write a table of blocks of rows, also one without; ``columns`` names what each block holds, in its order.

    A number or a text of a block stands in each of its rows.
    """
    names, listed = columns.split(), [_of_one_size(block) for block in blocks]
    empty = [np.zeros(0, dtype=None if n in units or n in SIGNALS else object) for n in names]
    stacked = [np.concatenate(parts) for parts in zip(*(listed or [empty]), strict=True)]
    tables.write(name, {n: v.tolist() if v.dtype == object else v for n, v in zip(names, stacked, strict=True)}, units)


def _of_one_size(block: Sequence[Any]) -> list[NDArray[Any]]:
    size = max(np.size(one) for one in block if np.ndim(one))
    return [
        np.asarray(one) if np.ndim(one) else np.full(size, one, dtype=object if isinstance(one, str) else None)
        for one in block
    ]
