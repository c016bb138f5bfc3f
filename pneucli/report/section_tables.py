"""The tables of the report as data: one Parquet file a table, with the titles of the page as columns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneucli.report.page_elements import Cell, Grid, Section

EXPONENTS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")  # of powers of ten on the page


@dataclass(frozen=True)
class SectionTable:
    """A table of the page: its name ``SECTION-NUMBER``, its caption, and columns of numbers or of text by title."""

    name: str
    caption: str
    columns: dict[str, NDArray[np.float64] | list[str]]


def section_tables(sections: Sequence[Section]) -> Iterator[SectionTable]:
    """Yield the tables of the sections in the order of the page; a table without rows is left out.

    A column is numeric if each of its cells is a number as the page shows it (``–`` becomes NaN, ``∞`` infinity).
    """
    for section in sections:
        grids = [part for part in section.parts if isinstance(part, Grid) and part.rows]
        for i, grid in enumerate(grids, start=1):
            yield SectionTable(f"{section.anchor}-{i}", grid.caption, _columns(grid))


def _columns(grid: Grid) -> dict[str, NDArray[np.float64] | list[str]]:
    titles = [title or f"column {i}" for i, title in enumerate(grid.head, start=1)]
    unique = [f"{t} ({i})" if titles.count(t) > 1 else t for i, t in enumerate(titles, start=1)]
    texts = [[cell.text if isinstance(cell, Cell) else cell for cell in row] for row in grid.rows]
    return {title: _column([row[i] for row in texts]) for i, title in enumerate(unique)}


def _column(texts: list[str]) -> NDArray[np.float64] | list[str]:
    numbers = [_number(text) for text in texts]
    return texts if None in numbers else np.array(numbers, dtype=np.float64)


def _number(text: str) -> float | None:
    """Return a number as the page shows it; None for other text."""
    special = {"–": np.nan, "": np.nan, "∞": np.inf}
    if text in special:
        return special[text]
    try:
        return float(text.replace("−", "-").replace("·10", "e").translate(EXPONENTS))
    except ValueError:
        return None
