"""The page of ``leak``: verdict, rates and the course of the pressure with its model, one section a test."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pneucli.messages.formatting import axis_title, format_quantity, in_display_unit
from pneucli.messages.leak import LAWS, VERDICTS, course, doubts, kinds, sentence, with_interval
from pneucli.report.figure import drawing, figures
from pneucli.report.overview import Overview, Tile
from pneucli.report.page import render_page
from pneucli.report.page_elements import Cell, Grid, Note, Section
from pneucli.version import __version__

Answer = Mapping[str, Any]
TONES = {"pass": "good", "fail": "bad", "undecided": "warning", None: ""}


def leak_page(answer: Answer) -> str:
    """Return the page of an answer of ``leak``: HTML that needs no network."""
    verdict, limit = answer["verdict"], answer["limit"]
    large = "no limit stated" if limit is None else VERDICTS[verdict].partition(":")[0]
    text = "" if limit is None else f"limit {limit['text']}"
    volume = format_quantity(answer["volume"], "m^3")
    tiles = [Tile("Verdict", large, text, TONES[verdict]), Tile("Volume", volume, "as stated")]
    sections = [_test(one, answer, number) for number, one in enumerate(answer["tests"])]
    head = "; ".join(f"{one['recording']}: {sentence(one, answer)}" for one in answer["tests"][:1])
    made_by = {"made by": f"pneucli {__version__}"}
    return render_page("leak test", Overview(head, tiles, {}, "", [], "", "", ""), sections, made_by)


def _test(one: Answer, answer: Answer, number: int) -> Section:
    model = np.array(one["model"])
    caption = f"{one['recording']} {course(one)}; {LAWS[one['law']]}"
    with drawing(caption, "time, s", axis_title(one["signal"]), height=2.6) as own:
        own.axes.plot(one["time"], in_display_unit(np.array(one["values"]), "Pa"), label="measured")
        own.axes.plot(model[:, 0], in_display_unit(model[:, 1], "Pa"), "--", label="model")
        own.axes.legend()
    rows = [(kind, Cell(with_interval(one[kind]))) for kind in kinds(one)]
    grid = Grid("Leak at the first pressure", ("quantity", "value with 95 % interval"), rows)
    notes = [Note(text, "warning") for text in doubts(one, answer)]
    return Section(f"test-{number}", one["recording"], sentence(one, answer), [*figures([own]), grid, *notes])
