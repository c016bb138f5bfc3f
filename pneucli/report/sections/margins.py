"""The margins of the loop: a table, and the ratios in the complex plane (Nyquist)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from pneucli.messages import margins as words
from pneucli.report.figure import BLUE, GREEN, GREY, ORANGE, Drawing, drawing, figures
from pneucli.report.page_elements import Cell, Grid, Note, Part
from pneucli.report.report_data import Table

COLOURS = {"command": ORANGE, "command 2": GREEN, "position": BLUE}
PLANE_HALF_WIDTH = 2.5  # of the plane to either side of -1


def margin_parts(answer: Mapping[str, Any], table: Table) -> list[Part]:
    """Return the margins of a design; nothing where none are known."""
    if not answer or not answer["points"]:
        return []
    rows = [
        [Cell(t, numeric=i > 0) for i, t in enumerate(words.table_row(loop, w))] for loop, w in answer["worst"].items()
    ]
    caption = "The least margins along the stroke and both ways, one loop cut, the others closed."
    doubts: list[Part] = [Note(f"{doubt}.", "warning") for doubt in words.stability_warnings(answer)]
    return [
        Grid(caption, words.COLUMN_TITLES, rows),
        *doubts,
        *figures([_nyquist(answer, table)]),
        Note(words.validity_note(answer)),
    ]


def _nyquist(answer: Mapping[str, Any], table: Table) -> Drawing:
    caption = (
        "The return ratios L (Nyquist). At −1 the loop would oscillate; the shaded circle is the least distance from "
        "it, a dot on the unit circle the least phase margin."
    )
    with drawing(caption, "real part of L", "imaginary part of L", height=4.2) as one:
        axes, turn = one.axes, np.linspace(0.0, 2.0 * math.pi, 200)
        axes.plot(np.cos(turn), np.sin(turn), color=GREY, linewidth=0.7, linestyle=":")
        least = min(w["modulus"] for w in answer["worst"].values())
        axes.fill(-1.0 + least * np.cos(turn), least * np.sin(turn), color=GREY, alpha=0.25, linewidth=0)
        axes.plot(-1.0, 0.0, "+", color="#d00000", markersize=9, markeredgewidth=1.6)
        named = set()
        for (loop, _, _), rows in table.groups("loop", "x", "speed"):
            label = None if loop in named else words.LOOP_TITLES[loop]
            axes.plot(rows["real"], rows["imaginary"], color=COLOURS[loop], linewidth=0.9, alpha=0.8, label=label)
            named.add(loop)
        for loop, worst in answer["worst"].items():
            axes.plot(-math.cos(worst["phase"]), -math.sin(worst["phase"]), "o", color=COLOURS[loop], markersize=4)
        axes.set_xlim(-1.0 - PLANE_HALF_WIDTH, -1.0 + PLANE_HALF_WIDTH)
        near = table["imaginary"][np.hypot(table["real"] + 1.0, table["imaginary"]) < PLANE_HALF_WIDTH]
        axes.set_ylim(np.min(near, initial=-1.0) - 0.15, np.max(near, initial=1.0) + 0.15)
        axes.set_aspect("equal")
        one.canvas.legend(loc="outside upper center", ncols=len(named))
    return one
