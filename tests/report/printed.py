"""A page as lines of text: its words, tables, captions, and of each curve the smallest and the largest value."""

import html
import re
from collections.abc import Iterator

import numpy as np

from pneucli.report.overview import Overview
from pneucli.report.page_elements import Cell, Figure, Grid, Note, Part, Section, ZoomPlot


def overview_lines(first: Overview) -> Iterator[str]:
    """Yield the first screen."""
    yield f"first screen: {first.line}"
    for tile in first.tiles:
        yield f"  tile {tile.title}{_tone(tile.tone)}: {tile.large}"
        yield f"    {tile.text}"
    for name, svg in first.pictures.items():
        yield f"  picture {name}: {_labels(svg)}"
    yield f"  caption: {first.caption}"
    for bar in first.ladder:
        marks = " only if" * bar.step.suggested + " present" * bar.step.present
        yield f"  step {bar.step.label}: {bar.error}, length {bar.length:.3f}{marks}"
    for name in ("failed", "following", "checks", "doubt"):
        yield f"  {name}: {getattr(first, name)}"


def section_lines(section: Section) -> Iterator[str]:
    """Yield a chapter."""
    marks = " folded" * section.folded + " printed" * section.printed
    yield f"chapter {section.anchor}{marks}: {section.title}"
    yield f"  {section.lead}"
    for part in section.parts:
        yield from (f"  {line}" for line in _part_lines(part))


def _part_lines(part: Part) -> Iterator[str]:
    if isinstance(part, Note):
        yield f"note{_tone(part.tone)}: {part.text}"
    elif isinstance(part, Grid):
        yield f"table{' folded' * part.folded}: {part.caption}"
        yield "  " + " | ".join(part.head)
        yield from ("  " + " | ".join(map(_cell, row)) for row in part.rows)
    elif isinstance(part, Figure):
        yield f"figure: {part.caption}"
        yield f"  {_labels(part.svg)}"
    else:
        yield from _zoom_lines(part)


def _zoom_lines(plot: ZoomPlot) -> Iterator[str]:
    yield f"plots {plot.name}: {plot.caption}"
    for run in plot.runs:
        yield f"  of {run.name}"
        for panel in run.panels:
            yield f"    {panel.title} in {panel.unit}; restarts: {len(panel.restarts)}"
            for one in panel.series:
                yield f"      {one.role}, {one.label}: {np.nanmin(one.values):.3g} to {np.nanmax(one.values):.3g}"


def _cell(cell: Cell | str) -> str:
    return cell if isinstance(cell, str) else cell.text + _tone(cell.tone)


def _tone(tone: str) -> str:
    return f" ({tone})" if tone else ""


def _labels(svg: str) -> str:
    """Words of a figure, each once, in alphabetical order."""
    texts = {html.unescape(text).strip() for text in re.findall(r"<text[^>]*>([^<]*)</text>", svg)}
    return "; ".join(sorted(text for text in texts if re.search(r"[^\W\d_]{2}", text)))
