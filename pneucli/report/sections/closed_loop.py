"""The closed loop: the design of the controller, and its performance on the identified model."""

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from pneucli.messages import design, simulate
from pneucli.messages.envelope import envelope_indices
from pneucli.messages.formatting import format_bounded, format_number, in_display_unit
from pneucli.messages.simulate import METRIC_TITLES
from pneucli.report.figure import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    Drawing,
    Line,
    chart,
    drawing,
    figures,
    logarithmic_beyond,
    reduced,
)
from pneucli.report.page_elements import (
    ZOOM_HINT,
    Figure,
    Grid,
    Note,
    Panel,
    Part,
    PlotRun,
    Row,
    Section,
    Series,
    ZoomPlot,
    warning_notes,
)
from pneucli.report.report_data import ReportData, Table
from pneucli.report.sections.checks import grid as checks_grid

PLACE = 90  # on the page
COLOURS = {"command": ORANGE, "command 2": GREEN, "position": BLUE}
PLANE_HALF_WIDTH = 2.5  # of the plane to either side of -1
MAX_SAMPLES = 800  # samples of a curve
MICROMETRES_PER_METRE = 1e6
LINEAR_RANGE = 10.0  # um; smaller errors have a linear scale, larger ones a logarithmic one
COMPENSATED, UNCOMPENSATED = "with compensation", "PIDs only"
# an unbounded figure is null, like one that the scenario does not have; these companions exist only for the former
COMPANION_FIGURES = {"rise_s": "overshoot_um", "settling_s": "overshoot_um", "recovery_s": "peak_um"}


def margin_parts(answer: design.Margins | None, table: Table) -> list[Part]:
    """Return the margins of a design; nothing where there are none."""
    if answer is None or not answer.points:
        return []
    rows = [design.margin_row(loop, worst) for loop, worst in answer.worst.items()]
    caption = "The smallest margins over the stroke and both directions, one loop cut, the others closed."
    doubts: list[Part] = [Note(f"{doubt}.", "warning") for doubt in answer.doubts]
    return [
        Grid(caption, design.MARGIN_TITLES, rows),
        *doubts,
        *figures([_nyquist(answer, table)]),
        Note(answer.validity),
    ]


def _nyquist(answer: design.Margins, table: Table) -> Drawing:
    caption = (
        "The return ratios L (Nyquist). At −1 the loop would oscillate; the shaded circle has the smallest distance "
        "from it as radius, a dot on the unit circle is the smallest phase margin."
    )
    with drawing(caption, "real part of L", "imaginary part of L", height=4.2) as one:
        axes, turn = one.axes, np.linspace(0.0, 2.0 * math.pi, 200)
        axes.plot(np.cos(turn), np.sin(turn), color=GREY, linewidth=0.7, linestyle=":")
        radius = min(w.modulus for w in answer.worst.values())
        axes.fill(-1.0 + radius * np.cos(turn), radius * np.sin(turn), color=GREY, alpha=0.25, linewidth=0)
        axes.plot(-1.0, 0.0, "+", color="#d00000", markersize=9, markeredgewidth=1.6)
        named = set()
        for (loop, _, _), rows in table.groups("loop", "x", "speed"):
            label = None if loop in named else design.LOOP_TITLES[loop]
            axes.plot(rows["real"], rows["imaginary"], color=COLOURS[loop], linewidth=0.9, alpha=0.8, label=label)
            named.add(loop)
        for loop, worst in answer.worst.items():
            axes.plot(-math.cos(worst.phase), -math.sin(worst.phase), "o", color=COLOURS[loop], markersize=4)
        axes.set_xlim(-1.0 - PLANE_HALF_WIDTH, -1.0 + PLANE_HALF_WIDTH)
        shown = table["imaginary"][np.hypot(table["real"] + 1.0, table["imaginary"]) < PLANE_HALF_WIDTH]
        axes.set_ylim(np.min(shown, initial=-1.0) - 0.15, np.max(shown, initial=1.0) + 0.15)
        axes.set_aspect("equal")
        one.canvas.legend(loc="outside upper center", ncols=len(named))
    return one


def section(material: ReportData) -> Section | None:
    """Return design and closed-loop scenarios; absent where no controller was designed."""
    if not material.answer("design"):
        return None
    designed, simulated = material.read(design.Answer), material.read(simulate.Answer)
    parts = warning_notes(material, "design")
    if own := [check for check in material.checks if check.path.split(".")[0] in ("design", "simulate")]:
        parts.append(checks_grid(own, "The checks of the pipeline file on design and simulation."))
    tolerance = designed.tolerance_um / MICROMETRES_PER_METRE
    parts.append(_design(designed, tolerance))
    parts += margin_parts(designed.margins, material.table("design/margins"))
    if simulated.closed_loop and simulated.pid_alone:
        parts.append(_figures(simulated.closed_loop, simulated.pid_alone))
    parts += _scenarios(material.table("simulate/closed_loop"), tolerance)
    lead = (
        "The designed controller moves the identified model, whose sensors have the identified noise and resolution. "
        "It is compared with its PIDs only, without estimates and without friction feedforward."
    )
    return Section("closed-loop", "Controller", lead, parts, folded=True, printed=True)


def _design(answer: design.Answer, tolerance: float) -> Grid:
    period = answer.requirements["period"]
    rows = [("sample time", f"{format_number(1e3 * period, 3)} ms"), ("tolerance at rest", _um(tolerance))]
    rows += [
        (f"corner: {name.replace('_', ' ')}", f"{format_number(c.value, 3)} rad/s")
        for name, c in answer.corners.items()
    ]
    rows += [("sliding sector", f"{name}: {one.text}") for name, one in answer.sector.items()]
    rows += [(f"{name} system", one.text) for name, one in answer.matching.items()]
    rows += [(f"PDC, weights {one.weight_type}", one.text) for one in answer.lmi.types]
    return Grid("Design", ("quantity", "value"), rows, folded=True)


def _figures(compensated: design.Scenarios, pid_only: design.Scenarios) -> Grid:
    names = [n for n in next(iter(compensated.values()), {}) if any(_shows(f, n) for f in compensated.values())]
    rows: list[Row] = [
        [METRIC_TITLES.get(n, n), *(_both(f, pid_only[s], n) for s, f in compensated.items())] for n in names
    ]
    caption = (
        f"Results of each scenario: {COMPENSATED} / {UNCOMPENSATED}; ∞: not reached before the reference moves on."
    )
    return Grid(caption, ("figure", *compensated), rows)


def _shows(found: simulate.Figures, name: str) -> bool:
    """Return whether a run has a figure, bounded or not."""
    return found[name] is not None or found.get(COMPANION_FIGURES.get(name, "")) is not None


def _both(compensated: simulate.Figures, pid_only: simulate.Figures, name: str) -> str:
    texts = [format_bounded(found[name]) if _shows(found, name) else "–" for found in (compensated, pid_only)]
    return "–" if texts == ["–", "–"] else " / ".join(texts)


def _um(metres: float) -> str:
    return f"{format_number(MICROMETRES_PER_METRE * metres, 3)} µm"


def _scenarios(table: Table, tolerance: float) -> list[Part]:
    """Return the errors of all scenarios, the loads and their estimates, and zoomable plots of all signals."""
    pairs = {
        str(name): (rows.where(controller="compensated"), rows.where(controller="pid_alone"))
        for (name,), rows in table.groups("scenario")
    }
    if not pairs:
        return []
    drawn = [_error(name, *pair, tolerance) for name, pair in pairs.items()]
    drawn += [_load(name, rows) for name, (rows, _) in pairs.items() if np.any(rows["load"] != 0.0)]
    caption = "Load estimate and pressure are those with compensation."
    runs = [PlotRun(name, _panels(*pair)) for name, pair in pairs.items()]
    return [*drawn, ZoomPlot("closed-loop", caption, runs, ZOOM_HINT)]


def _deviation(rows: Table) -> NDArray[Any]:
    """Return reference minus position in um."""
    return np.asarray(MICROMETRES_PER_METRE * (rows["x_ref"] - rows["x"]))


def _error(name: str, compensated: Table, pid_only: Table, tolerance: float) -> Figure:
    linear = f"linear up to {format_number(LINEAR_RANGE, 2)} µm"
    caption = f"{name}: position error, {linear}, logarithmic beyond; shaded: ± {_um(tolerance)}."
    half = MICROMETRES_PER_METRE * tolerance

    def scale(axes: Axes) -> None:
        axes.axhspan(-half, half, color=GREY, alpha=0.25, linewidth=0)
        logarithmic_beyond(axes, LINEAR_RANGE)

    lines = [
        reduced(Line(rows["time"], _deviation(rows), label, colour, width=1.0), MAX_SAMPLES)
        for rows, label, colour in ((pid_only, UNCOMPENSATED, BLUE), (compensated, COMPENSATED, ORANGE))
    ]
    titles = ("time in s", "reference − position in µm")
    return chart(caption, *titles, *lines, legend="outside upper right", ncols=2, extra=scale)


def _load(name: str, rows: Table) -> Figure:
    caption = f"{name}: the load on the piston, and the controller's estimate from position and pressures."
    few = rows.rows(envelope_indices([rows["load"], rows["load_estimate"]], MAX_SAMPLES))
    load = Line(few["time"], few["load"], "load", GREY, width=2.5)
    estimate = Line(few["time"], few["load_estimate"], "estimate", ORANGE)
    return chart(caption, "time in s", "load in N", load, estimate, legend="outside upper right", ncols=2)


def _panels(compensated: Table, pid_only: Table) -> list[Panel]:
    both = {UNCOMPENSATED: pid_only, COMPENSATED: compensated}  # the compensated curve lies on top
    mm = {label: in_display_unit(rows["x"], "m") for label, rows in both.items()}
    bar = {
        name: in_display_unit(compensated[column], "Pa")
        for name, column in (("reference", "p1_ref"), (COMPENSATED, "p1"))
    }
    panels = [
        ("position", "mm", {"reference": in_display_unit(compensated["x_ref"], "m"), **mm}),
        ("reference − position", "µm", {label: _deviation(rows) for label, rows in both.items()}),
        ("valve command", "V", {label: rows["u"] for label, rows in both.items()}),
        ("command of the second valve", "V", {label: rows["u2"] for label, rows in both.items()}),
        ("pressure of chamber 1", "bar", bar),
        ("load", "N", {"reference": compensated["load"], "estimate": compensated["load_estimate"]}),
    ]
    return [_panel(title, unit, compensated["time"], c) for title, unit, c in panels if _moves(title, c.values())]


def _moves(title: str, curves: Iterable[NDArray[Any]]) -> bool:
    """Return whether a panel has something to show: the second valve is absent on most rigs."""
    return "second" not in title or any(np.any(curve != 0.0) for curve in curves)


def _panel(title: str, unit: str, time: NDArray[Any], curves: Mapping[str, NDArray[Any]]) -> Panel:
    roles = {"reference": "measured", UNCOMPENSATED: "input"}
    indices = envelope_indices(list(curves.values()), MAX_SAMPLES)
    drawn = [Series(label, roles.get(label, "model"), values[indices]) for label, values in curves.items()]
    return Panel(title, unit, time[indices], drawn)
