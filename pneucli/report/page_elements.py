"""The elements of a page: tables, figures, notes, zoomable plots and sections."""

import pkgutil
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray

from pneucli.report.report_data import ReportData

EXPONENTS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")  # of powers of ten on the page


@dataclass(frozen=True)
class SectionTable:
    """A table of the page: its name ``SECTION-NUMBER``, its caption, and columns of numbers or of text by title."""

    name: str
    caption: str
    columns: dict[str, NDArray[np.float64] | list[str]]


MAX_UNFOLDED_ROWS = 40  # rows; a longer table is folded


@dataclass(frozen=True)
class Cell:
    """A text in a grid with a share (0 to 1), drawn as a bar behind it, or a tone (good, bad or none)."""

    text: str
    bar: float | None = None
    tone: str = ""

    def __str__(self) -> str:
        return self.text


Row = Sequence[Cell | str]
_QUANTITY = re.compile(r"[−+–(]*(\d|∞|$)|× |at (most|least) |less than ")


@dataclass(frozen=True)
class Grid:
    """A table for people; ``head`` has a title for each column, ``rows`` texts, and cells where one is marked."""

    kind: ClassVar[str] = "grid"
    caption: str
    head: Sequence[str]
    rows: Sequence[Row]
    folded: bool = False

    @property
    def numeric(self) -> list[bool]:
        """Whether most texts of a column are quantities, which stand on the right."""
        columns = [[text for one in cells if (text := str(one))] for cells in zip(*self.rows, strict=True)]
        return [2 * sum(_QUANTITY.match(text) is not None for text in of) > len(of) for of in columns]


T = TypeVar("T")
Columns = Mapping[str, Callable[[T], Cell | str]]  # what a table shows of each of its objects, by the column's title


def grid(caption: str, of: Iterable[T], columns: Columns[T], *, folded: bool = False) -> Grid:
    """Return a table with a row for each object."""
    return Grid(caption, [*columns], [[shown(one) for shown in columns.values()] for one in of], folded)


@dataclass(frozen=True)
class Figure:
    """A static figure as SVG, and one sentence that says what it shows."""

    kind: ClassVar[str] = "figure"
    svg: str
    caption: str


@dataclass(frozen=True)
class Note:
    """A sentence of its own; ``tone``: good, bad, warning or none."""

    kind: ClassVar[str] = "note"
    text: str
    tone: str = ""


@dataclass(frozen=True)
class Series:
    """One curve of a zoomable panel; ``role`` (measured, model, input, residual) chooses its colour."""

    label: str
    role: str
    values: NDArray[Any]


@dataclass(frozen=True)
class Panel:
    """Curves over one time axis (s), all in ``unit``; ``restarts`` (s) are marked."""

    title: str
    unit: str
    time: NDArray[Any]
    series: Sequence[Series]
    restarts: Sequence[float] = ()


@dataclass(frozen=True)
class PlotRun:
    """The panels of one recording or scenario, one above the other."""

    name: str
    panels: Sequence[Panel]


ZOOM_HINT = (
    "Drag over an interval to zoom in, double-click or press the button to see everything; keys: + and −, arrows, 0."
)


@dataclass(frozen=True)
class ZoomPlot:
    """Zoomable time plots, one run at a time, chosen from a list."""

    kind: ClassVar[str] = "zoom"
    name: str
    caption: str
    runs: Sequence[PlotRun]
    hint: str = ""  # how to use them; not on paper


Part = Grid | Figure | Note | ZoomPlot


@dataclass(frozen=True)
class Section:
    """A chapter of the page: its anchor, title, one introductory sentence, and parts.

    A ``folded`` chapter opens on demand; it is on paper if it is open, or if it is ``printed``.
    """

    anchor: str
    title: str
    lead: str
    parts: Sequence[Part] = field(default_factory=tuple)
    folded: bool = False
    printed: bool = False


def warning_notes(material: ReportData, stage: str) -> list[Part]:
    """Return the warnings of a stage, for its chapter."""
    return [Note(f"{warning}.", "warning") for warning in material.answer(stage).get("warnings", [])]


SectionMaker = Callable[[ReportData], "Section | None"]


def declared_sections(package: str) -> tuple[SectionMaker, ...]:
    """Return the function ``section`` of each module of a package that has a ``PLACE``, in the order of these."""
    names = [one.name for one in pkgutil.iter_modules(import_module(package).__path__, f"{package}.")]
    found = [module for module in map(import_module, names) if hasattr(module, "PLACE")]
    return tuple(module.section for module in sorted(found, key=lambda module: module.PLACE))


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
    texts = [[*map(str, row)] for row in grid.rows]
    return {title: _values([row[i] for row in texts]) for i, title in enumerate(unique)}


def _values(texts: list[str]) -> NDArray[np.float64] | list[str]:
    numbers = [_shown_number(text) for text in texts]
    return texts if None in numbers else np.array(numbers, dtype=np.float64)


def _shown_number(text: str) -> float | None:
    """Return a number as the page shows it; None for other text."""
    special = {"–": np.nan, "": np.nan, "∞": np.inf}
    if text in special:
        return special[text]
    try:
        return float(text.replace("−", "-").replace("·10", "e").translate(EXPONENTS))
    except ValueError:
        return None
