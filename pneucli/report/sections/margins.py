"""The margins of the loop: a table, and the return ratios in the complex plane (Nyquist)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from pneucli.messages import margins
from pneucli.report.figure import BLUE, GREEN, GREY, ORANGE, Drawing, drawing, figures
from pneucli.report.page_elements import Cell, Grid, Note, Part
from pneucli.report.report_data import Table

COLOURS = {"command": ORANGE, "command 2": GREEN, "position": BLUE}
PLANE_HALF_WIDTH = 2.5  # of the plane to either side of -1


def margin_parts(answer: Mapping[str, Any], table: Table) -> list[Part]:
    """Return the margins of a design; nothing where there are none."""
    if not answer or not answer["points"]:
        return []
    rows = [
        [Cell(t, numeric=i > 0) for i, t in enumerate(margins.table_row(loop, w))]
        for loop, w in answer["worst"].items()
    ]
    caption = "The smallest margins over the stroke and both directions, one loop cut, the others closed."
    doubts: list[Part] = [Note(f"{doubt}.", "warning") for doubt in margins.stability_warnings(answer)]
    return [
        Grid(caption, margins.COLUMN_TITLES, rows),
        *doubts,
        *figures([_nyquist(answer, table)]),
        Note(margins.validity_note(answer)),
    ]


def _nyquist(answer: Mapping[str, Any], table: Table) -> Drawing:
    caption = (
        "The return ratios L (Nyquist). At −1 the loop would oscillate; the shaded circle has the smallest distance "
        "from it as radius, a dot on the unit circle is the smallest phase margin."
    )
    with drawing(caption, "real part of L", "imaginary part of L", height=4.2) as one:
        axes, turn = one.axes, np.linspace(0.0, 2.0 * math.pi, 200)
        axes.plot(np.cos(turn), np.sin(turn), color=GREY, linewidth=0.7, linestyle=":")
        radius = min(w["modulus"] for w in answer["worst"].values())
        axes.fill(-1.0 + radius * np.cos(turn), radius * np.sin(turn), color=GREY, alpha=0.25, linewidth=0)
        axes.plot(-1.0, 0.0, "+", color="#d00000", markersize=9, markeredgewidth=1.6)
        named = set()
        for (loop, _, _), rows in table.groups("loop", "x", "speed"):
            label = None if loop in named else margins.LOOP_TITLES[loop]
            axes.plot(rows["real"], rows["imaginary"], color=COLOURS[loop], linewidth=0.9, alpha=0.8, label=label)
            named.add(loop)
        for loop, worst in answer["worst"].items():
            axes.plot(-math.cos(worst["phase"]), -math.sin(worst["phase"]), "o", color=COLOURS[loop], markersize=4)
        axes.set_xlim(-1.0 - PLANE_HALF_WIDTH, -1.0 + PLANE_HALF_WIDTH)
        shown = table["imaginary"][np.hypot(table["real"] + 1.0, table["imaginary"]) < PLANE_HALF_WIDTH]
        axes.set_ylim(np.min(shown, initial=-1.0) - 0.15, np.max(shown, initial=1.0) + 0.15)
        axes.set_aspect("equal")
        one.canvas.legend(loc="outside upper center", ncols=len(named))
    return one
