"""The valve: curves, pressure gradient over command and pressure, inverse map, effective area of each command."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from pneucli.arrays import Array
from pneucli.figure import Figure as Interval
from pneucli.messages.envelope import envelope_indices
from pneucli.messages.formatting import (
    format_noise_ratio,
    format_number,
    format_percent,
    format_plain,
    format_quantity,
    in_display_unit,
    unit_symbol,
)
from pneucli.messages.identify import Answer, MapResidual, Valve, ValveDeviation
from pneucli.report.figure import (
    BLUE,
    HEAT_MAP_LINE_COLOUR,
    ORANGE,
    Drawing,
    Line,
    chart,
    drawing,
    evenly_chosen,
    figures,
    heat_map,
    rank_colour,
    zero_line,
)
from pneucli.report.page_elements import Figure, Grid, Part, Row, Section
from pneucli.report.report_data import ReportData, Table
from pneucli.report.sections.uncertainty import budget_tables

PLACE = 70  # on the page
MAX_CURVE_SAMPLES = 100  # samples of a curve
MAX_SWITCHING_COMMANDS = 3  # commands of a switching valve, between which there are no contours
MAX_LABELS = 7  # sizes of the command in a figure
MEASUREMENT_FIGURES = (
    "Pressure gradients of the vessel behind the valve: those of the model's valve (area × flow function × effects), "
    "fitted to charging and discharging with each command, and the deviation of the measured ones."
)
BENCH_FIGURES = (
    "Pressure gradients of the stated vessel behind the valve, dp/dt = n R T q / V, from the flow of the steady bench."
)
MODEL_FIGURES = (
    "Pressure gradients of the model's valve (area × flow function × effects), fitted to the driven piston because "
    "there is no test with a vessel, and the deviation of the measured gradients."
)


def section(material: ReportData) -> Section | None:
    """Return the valve's figures and tables; absent where no valve was identified."""
    if not len(material.table("identify/valve_map")):
        return None
    answer = material.read(Answer)
    valves = {2 if label == "valve_2" else 1: valve for label, valve in answer.valves.items()}
    parts: list[Part] = []
    for chamber in valves or (1,):
        of_chamber = partial(_table, material, chamber)
        drawn = _figures(of_chamber) if not parts else _maps(of_chamber)
        mine: list[Figure | Grid] = [*drawn]
        if chamber in valves:
            mine += [
                *_tables(valves[chamber]),
                *budget_tables(answer.budgets, "valve." if chamber == 1 else "valve_2."),
            ]
        parts += (
            [replace(one, caption=f"Chamber {chamber}. {one.caption}") for one in mine] if len(valves) > 1 else mine
        )
    measured = any(valve.map != "model" for valve in valves.values())
    lead = MEASUREMENT_FIGURES if measured else MODEL_FIGURES if valves else BENCH_FIGURES
    return Section("valve", "Valve: map and inverse", lead, parts, folded=True)


def _table(material: ReportData, chamber: int, name: str) -> Table:
    """Return a table's rows of one chamber; where the valve drives one chamber only, all rows."""
    table = material.table(f"identify/valve_{name}")
    return table.where(chamber=chamber) if "chamber" in table else table


def _figures(table: Callable[[str], Table]) -> Iterator[Figure]:
    curves = table("curves")
    if len(curves):
        yield from (_inflation(curves), _gradients(curves))
    yield _over_command(table("map"))
    if len(lack := table("lack_of_fit")):
        yield _lack_of_fit(lack)
    if len(areas := table("areas")):
        yield _areas(areas)
    yield from _maps(table)


def _maps(table: Callable[[str], Table]) -> Iterator[Figure]:
    drawings = [_map(table("map"))]
    if len(inverse := table("inverse")):
        drawings.append(_inverse(inverse))
    yield from figures(drawings)


def _steps(curves: Table) -> list[tuple[float, Table]]:
    """Return the longest curve of each command, for commands chosen evenly among those with long curves."""
    longest: dict[float, Table] = {}
    for (_, u), rows in curves.groups("recording", "u"):
        if _duration(rows) > (_duration(longest[u]) if u in longest else 0.0):
            longest[float(u)] = rows
    long = 0.5 * max(map(_duration, longest.values()))
    sizes = sorted({abs(u) for u, rows in longest.items() if _duration(rows) >= long})
    chosen = evenly_chosen(np.array(sizes), MAX_LABELS)
    return [(u, rows) for u, rows in sorted(longest.items()) if abs(u) in chosen]


def _duration(rows: Table) -> float:
    return float(np.ptp(rows["time"]))


def _colour(u: float, steps: list[tuple[float, Table]]) -> Any:
    sizes = sorted({abs(command) for command, _ in steps})
    return rank_colour(sizes.index(abs(u)), len(sizes))


def _legend(steps: list[tuple[float, Table]], axes: Axes) -> None:
    sizes = sorted({abs(u) for u, _ in steps})
    handles = [Line2D([], [], color=_colour(u, steps), label=f"{format_plain(u)} V") for u in sizes]
    axes.legend(handles=handles, title="|command|", loc="upper left", bbox_to_anchor=(1, 1))


def _inflation(curves: Table) -> Figure:
    steps, lines = _steps(curves), []
    for u, rows in steps:
        indices = envelope_indices([rows["measured"]], MAX_CURVE_SAMPLES)
        dots = indices[:: max(1, indices.size // 40)]
        time, colour = rows["time"] - rows["time"][0], _colour(u, steps)
        measured, fitted = (in_display_unit(rows[name], "Pa") for name in ("measured", "fitted"))
        lines.append(Line(time[dots], measured[dots], colour=colour, style=".", size=2.5))
        lines.append(Line(time[indices], fitted[indices], colour=colour, width=1.0))
    caption = "Charging and discharging: measured (dots) and fitted (lines), one pair of curves for each command."
    return chart(caption, "time from the step in s", "pressure in bar", *lines, extra=partial(_legend, steps))


def _gradients(curves: Table) -> Figure:
    steps, lines = _steps(curves), []
    for u, rows in steps:
        order = np.argsort(rows["fitted"])
        order = order[:: max(1, order.size // MAX_CURVE_SAMPLES)]
        p = in_display_unit(rows["fitted"][order], "Pa")
        low, high, middle = (in_display_unit(rows[n][order], "Pa/s") for n in ("ci_low", "ci_high", "gradient"))
        lines.append(Line(p, middle, colour=_colour(u, steps), band=(low, high)))
    caption = (
        "The gradient over the pressure in the vessel, with its 95 % band. While the flow is choked, discharging is a "
        "straight line through zero absolute pressure, and charging a constant."
    )

    def extra(axes: Axes) -> None:
        zero_line(axes)
        _legend(steps, axes)

    return chart(caption, "pressure in bar", "pressure gradient in bar/s", *lines, extra=extra)


def _square(table: Table, x: str, y: str, z: str) -> tuple[Array, Array, Array]:
    """Return the axes and the values (y, x) of a table with a full grid."""
    xs, ys = np.unique(table[x]), np.unique(table[y])
    values = np.full((ys.size, xs.size), np.nan)
    values[np.searchsorted(ys, table[y]), np.searchsorted(xs, table[x])] = table[z]
    return xs, ys, values


def _map(grid: Table) -> Drawing:
    u, p, gradient = _square(grid, "u", "p", "p_gradient")
    p, gradient = in_display_unit(p, "Pa"), in_display_unit(gradient, "Pa/s")
    most = float(np.nanmax(np.abs(gradient)))
    caption = "The valve map: pressure gradient over command and pressure."
    with drawing(caption, "valve command in V", "pressure in bar") as one:
        heat_map(
            one, u, p, gradient, "pressure gradient in bar/s", cmap="PuOr", vmin=-most, vmax=most, shading="nearest"
        )
        if u.size > MAX_SWITCHING_COMMANDS:
            lines = one.axes.contour(u, p, gradient, 10, colors=HEAT_MAP_LINE_COLOUR, linewidths=0.5)
            one.axes.clabel(lines, fontsize=7, colors=HEAT_MAP_LINE_COLOUR, fmt=lambda value: format_number(value, 3))
        if "covered" in grid and not grid["covered"].all():
            covered = _square(grid, "u", "p", "covered")[2]
            one.axes.contourf(u, p, covered, [-0.5, 0.5], colors="none", hatches=["///"])
            one.caption += " Hatched: extrapolated by the model, without measurements."
    return one


def _levels(table: Table) -> list[tuple[str, Any, Table]]:
    """Return the label, the colour and the rows of five pressures between the ends of a table."""
    chosen = evenly_chosen(np.unique(table["p"]), 7)[1:-1]
    return [
        (format_quantity(level, "Pa", 2), rank_colour(i, chosen.size), table.where(p=level))
        for i, level in enumerate(chosen)
    ]


def _over_command(grid: Table) -> Figure:
    lines = []
    for label, colour, rows in _levels(grid):
        low, middle, high = (in_display_unit(rows[f"p_gradient{end}"], "Pa/s") for end in ("_ci_low", "", "_ci_high"))
        lines.append(Line(rows["u"], middle, label, colour, band=(low, high)))
    caption = (
        "Sections of the map at constant pressure, with the 95 % band; the flat part at zero is the spool's overlap."
    )
    titles = ("valve command in V", "pressure gradient in bar/s")
    return chart(caption, *titles, *lines, legend="best", extra=zero_line)


def _lack_of_fit(lack: Table) -> Figure:
    lines = []
    for label, colour, rows in _levels(lack):
        off, *ends = (
            in_display_unit(rows[name], "Pa/s")
            for name in ("difference", "model", "model_ci_high", "measured", "measured_ci_high")
        )
        allowed = np.maximum(ends[1] - ends[0], ends[3] - ends[2])
        outside = rows["outside"].astype(bool)
        lines.append(Line(rows["u"], off, label, colour, width=1.0, band=(-allowed, allowed)))
        lines.append(Line(rows["u"][outside], off[outside], colour=colour, style=".", size=4))
    caption = (
        "Lack of fit: measured gradients minus the model's at constant pressure. Bands: the wider of both 95 % "
        "intervals; dots: outside of both."
    )
    titles = ("valve command in V", "measured − model in bar/s")
    return chart(caption, *titles, *lines, legend="best", extra=zero_line)


def _inverse(inverse: Table) -> Drawing:
    gradient, p, u = _square(inverse, "p_gradient", "p", "u")
    reachable = _square(inverse, "p_gradient", "p", "reachable")[2]
    gradient, p = in_display_unit(gradient, "Pa/s"), in_display_unit(p, "Pa")
    most = float(np.nanmax(np.abs(u)))
    caption = "The inverse map: the command for a required gradient at a pressure. Hatched: not reachable, clipped."
    with drawing(caption, "required pressure gradient in bar/s", "pressure in bar") as one:
        heat_map(one, gradient, p, u, "valve command in V", cmap="PuOr", vmin=-most, vmax=most, shading="nearest")
        if not reachable.all():
            one.axes.contourf(gradient, p, reachable, [-0.5, 0.5], colors="none", hatches=["///"])
    return one


def _areas(areas: Table) -> Figure:
    unit, opening = areas.units.get("area", "m^2"), areas["opening" if "opening" in areas else "u"]
    caption = "Effective area of the model's valve over command, charging and discharging, with 95 % intervals."
    lines = []
    for label, chosen, colour in (("supply → chamber", opening > 0, BLUE), ("chamber → ambient", opening < 0, ORANGE)):
        rows = areas.rows(np.flatnonzero(chosen)[np.argsort(areas["u"][chosen])])
        area, *bars = (in_display_unit(rows[name], unit) for name in ("area", "ci_low", "ci_high"))
        lines.append(Line(rows["u"], area, label, colour, "o-", size=3, bars=(bars[0], bars[1])))
    titles = ("valve command in V", f"effective area in {unit_symbol(unit)}")
    return chart(caption, *titles, *lines, legend="best", ylim=(0, None))


def _tables(valve: Valve) -> Iterator[Grid]:
    yield _fit(valve.lack_of_fit, valve.residual)
    if valve.overlap:
        rows = [[name, *_value(one)] for name, one in valve.overlap.items()]
        yield Grid("Overlap of the spool.", ("", "value", "95 % from", "to"), rows)
    if valve.iso:
        rows = [[name.removeprefix("valve."), *_value(one)] for name, one in valve.iso.items()]
        caption = "Characteristics by ISO 6358-1: sonic conductance, critical ratio and subsonic index of each command."
        yield Grid(caption, ("characteristic", "value", "95 % from", "to"), rows, folded=True)


def _fit(lack: ValveDeviation, residual: MapResidual) -> Grid:
    """Return the deviation of measured gradients, and the residual of the curves."""
    shares = (
        ("deviation of measured gradients from the model, median", lack.median),
        ("deviation of measured gradients from the model, 95th percentile", lack.p95),
        ("points outside both 95 % intervals", lack.share_outside),
    )
    noise = (("model on the valve's curves", residual.train), ("model on held-out curves", residual.test))
    rows: list[Row] = [[name, format_percent(n)] for name, n in shares]
    rows += [[name, ("–" if n is None else f"{format_noise_ratio(n)} × noise")] for name, n in noise]
    caption = "Lack of fit of the model's valve, relative to the measured gradient, and residuals of curves over noise."
    return Grid(caption, ("", "value"), rows)


def _value(one: Interval) -> Row:
    return [format_quantity(value, one.unit) for value in (one.value, one.low, one.high)]
