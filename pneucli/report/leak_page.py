"""The page of ``leak``: verdict, rates and the course of the pressure with its model, one section a test."""

from __future__ import annotations

import numpy as np

from pneucli.messages.formatting import axis_title, format_quantity, in_display_unit
from pneucli.messages.leak import LAWS, VERDICTS, Answer, LeakTest, with_interval
from pneucli.report.figure import Line, chart
from pneucli.report.overview import Overview, Tile
from pneucli.report.page import render_page
from pneucli.report.page_elements import Cell, Grid, Note, Section
from pneucli.version import __version__

TONES = {"pass": "good", "fail": "bad", "undecided": "warning", None: ""}


def leak_page(answer: Answer) -> str:
    """Return the page of an answer of ``leak``: HTML that needs no network."""
    verdict, limit = answer.verdict, answer.limit
    large = "no limit stated" if verdict is None else VERDICTS[verdict].partition(":")[0]
    text = "" if limit is None else f"limit {limit.text}"
    volume = format_quantity(answer.volume, "m^3")
    tiles = [Tile("Verdict", large, text, TONES[verdict]), Tile("Volume", volume, "as stated")]
    sections = [_test(one, answer, number) for number, one in enumerate(answer.tests)]
    head = "; ".join(f"{one.recording}: {one.sentence(limit)}" for one in answer.tests[:1])
    made_by = {"made by": f"pneucli {__version__}"}
    return render_page("leak test", Overview(head, tiles, {}, "", [], "", "", ""), sections, made_by)


def _test(one: LeakTest, answer: Answer, number: int) -> Section:
    model = np.array(one.model)
    caption = f"{one.recording} {one.course}; {LAWS[one.law]}"
    curves = (
        Line(one.time, in_display_unit(np.array(one.values), "Pa"), "measured"),
        Line(model[:, 0], in_display_unit(model[:, 1], "Pa"), "model", style="--"),
    )
    drawn = chart(caption, "time, s", axis_title(one.signal), *curves, legend="best", height=2.6)
    grid = Grid(
        "Leak at the first pressure",
        ("quantity", "value with 95 % interval"),
        [(name, Cell(with_interval(rate))) for name, rate in one.known.items()],
    )
    notes = [Note(text, "warning") for text in one.doubts(answer.drift)]
    return Section(f"test-{number}", one.recording, one.sentence(answer.limit), [drawn, grid, *notes])
