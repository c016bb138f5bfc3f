"""Flow function, valve and one stick-slip by each model: figures 2.4, 2.5, 6.14 to 6.19, 6.34 to 6.39, 7.16 to 7.26."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import ScalarFormatter
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.messages.formatting import format_number, format_plain, in_display_unit
from pneucli.physics.gas import CRITICAL_RATIO, PSI_MAX, choked_maximum, choked_ratio, isentropic_flow_function
from pneucli.physics.vectorised import flow_functions
from pneucli.report.figure import BLUE, GREY, ORANGE, Line, chart, reduced, zero_line
from pneucli.report.page_elements import Figure, Section
from pneucli.report.report_data import ReportData, Table
from pneucli.report.thesis.friction import friction_laws, sliding_sectors

PLACE = 10  # on the page
KAPPA = 1.4  # of the thesis' own figures
TYPICAL_PRESSURE_RATIOS = (0.2, 0.8)  # pressure ratios of the claim
MAX_SAMPLES = 600  # samples of a curve
FIRST_FIGURE = {"A": 14, "B": 16, "C": 18, "D": 34, "E": 36, "F": 38}  # 6.14 and on: acceleration, then velocity
REFERENCE_PRESSURE = 5e5  # Pa, of figure 7.24
COMMANDS_PER_SIDE = 3  # commands on each side of the null in figure 7.25


def section(material: ReportData) -> Section | None:
    """Return the figures; absent where nothing was identified that they could show."""
    drawn = [
        *friction_laws(material),
        *_valve(material),
        *sliding_sectors(material),
        *_slip(material.table("identify/friction_replays")),
    ]
    lead = (
        "The figures of the source thesis with this rig's data and the numbers of the thesis. Tables 6.2 and 6.3 and "
        "figures 6.8 to 6.12 and 6.21 to 6.33 are in the report's chapter on friction and below, with the weights."
    )
    return Section("thesis", "Figures of the thesis", lead, [*_flow_function(), *drawn]) if drawn else None


def _flow_function() -> Iterator[Figure]:
    """Yield figures 2.4 and 2.5, with the claimed and the found error of the approximation."""
    ratio = np.linspace(0.0, 1.0, 20001)
    exact = np.array([isentropic_flow_function(float(r), KAPPA) for r in ratio])
    critical, largest = choked_ratio(KAPPA), choked_maximum(KAPPA)
    above = np.maximum((ratio - critical) / (1.0 - critical), 0.0)
    approximation = largest * np.sqrt(np.maximum(1.0 - above**2, 0.0))
    caption = "Figure 2.4: the flow function of isentropic outflow (2.34)."
    yield chart(caption, "pressure ratio", "Ψ", Line(ratio, exact, colour=BLUE))
    open_ = exact > 0.0
    error = np.abs(approximation[open_] / exact[open_] - 1.0)
    rounded = np.abs(flow_functions(ratio[open_], CRITICAL_RATIO) / exact[open_] - 1.0)

    def error_axis(axes: Axes) -> None:
        second = axes.twinx()
        second.plot(ratio[open_], 100.0 * error, color=GREY, linewidth=0.9)
        second.set_ylabel("error in % of the value")

    yield chart(
        "Figure 2.5: the flow function and its approximation (2.42, 2.43). "
        f"{_claim(ratio[open_], error, 'With the constants unrounded the approximation')} "
        f"{_claim(ratio[open_], rounded, 'With 0.528 and 0.484, as the program has them, it')}",
        "pressure ratio",
        "Ψ",
        Line(ratio, exact, "exact", BLUE),
        Line(ratio, approximation, "approximation", ORANGE, "--"),
        legend="lower left",
        extra=error_axis,
    )


def _claim(ratio: Array, error: Array, subject: str) -> str:
    """Return the largest relative error over all ratios and over the usual ones, with the claims of the thesis."""
    usual = (ratio >= TYPICAL_PRESSURE_RATIOS[0]) & (ratio <= TYPICAL_PRESSURE_RATIOS[1])
    return (
        f"{subject} is off by at most {_percent(error.max())} of the value (claimed: 0.3 %), and by "
        f"{_percent(error[usual].max())} for ratios of 0.2 to 0.8 (claimed: less than 0.2 %)."
    )


def _percent(share: float) -> str:
    return f"{format_number(100.0 * float(share), 3)} %"


def _valve(material: ReportData) -> Iterator[Figure]:
    """Yield figures 7.16 to 7.26 of the valve at chamber 1."""
    curves, grid, areas = (
        _first_chamber(material.table(f"identify/valve_{name}")) for name in ("curves", "map", "areas")
    )
    if len(curves):
        fill, vent = (_strongest(curves, sign) for sign in (1.0, -1.0))
        if fill is not None:
            yield from _inflation(fill, *_supply(material, fill, curves))
        if vent is not None:
            yield from _deflation(vent)
    if len(areas):
        caption = "Figure 7.23: characteristic of the servo valve, as effective area over command, both directions."
        yield _areas(caption, areas, np.full(len(areas), True))
    if len(grid):
        yield _over_voltage(grid)
    if len(areas):
        opening = areas["opening" if "opening" in areas else "u"]
        yield _areas(
            "Figure 7.25: overlap of the spool: the area near the null command.",
            areas,
            _nearest_commands(areas, opening),
        )
        yield _areas("Figure 7.26: area of the inlet over the command.", areas, opening > 0)


def _first_chamber(table: Table) -> Table:
    return table.where(chamber=1) if "chamber" in table else table


def _strongest(curves: Table, sign: float) -> Table | None:
    """Return the curve with the most samples among those that rise (or fall) at least 0.9 times the largest change."""
    pairs = [rows for _, rows in curves.groups("recording", "u")]
    moved = [(sign * float(rows["fitted"][-1] - rows["fitted"][0]), rows) for rows in pairs]
    most = max(change for change, _ in moved)
    return max((rows for change, rows in moved if change >= 0.9 * most), key=len) if most > 0.0 else None


def _curve(caption: str, rows: Table, scale: str = "linear") -> Figure:
    def plain_numbers(axes: Axes) -> None:
        for axis in (axes.yaxis.set_major_formatter, axes.yaxis.set_minor_formatter) if scale == "log" else ():
            axis(ScalarFormatter())

    looks = (("measured", ".", GREY), ("fitted", "-", BLUE))
    time = rows["time"] - rows["time"][0]
    curves = (
        Line(time, in_display_unit(rows[name], "Pa"), name, colour, style, size=2) for name, style, colour in looks
    )
    return chart(
        f"{caption} Command {format_plain(float(rows['u'][0]))} V.",
        "time in s",
        "pressure in bar",
        *(reduced(curve, MAX_SAMPLES) for curve in curves),
        legend="upper right",
        extra=plain_numbers,
        yscale=scale,
    )


def _supply(material: ReportData, rows: Table, curves: Table) -> tuple[float, str]:
    """Return the supply pressure in bar of a curve and its origin: the recording, or the highest pressure reached."""
    signals = material.table("ingest/signals")
    if "p_supply" in signals:
        recorded = signals.where(recording=rows.text("recording"))["p_supply"]
        if len(recorded) and np.isfinite(recorded).any():
            return float(in_display_unit(np.nanmedian(recorded), "Pa")), "recorded supply pressure"
    return float(in_display_unit(curves["fitted"].max(), "Pa")), "highest pressure reached"


def _inflation(rows: Table, supply: float, origin: str) -> Iterator[Figure]:
    """Yield the figures of one inflation; ``supply`` (bar) is the ``origin`` of its pressure ratio."""
    yield _curve("Figures 7.16 and 7.19: inflation pressure curve.", rows)
    p, gradient = in_display_unit(rows["fitted"], "Pa"), in_display_unit(rows["gradient"], "Pa/s")
    ratio = p / supply
    yield chart(
        "Figure 7.18: flow coefficient from the inflation curve, over its largest value, and (2.42).",
        f"pressure over the {origin}",
        "Ψ / Ψ max",
        Line(ratio, gradient / float(np.nanmax(gradient)), "measured", BLUE),
        Line(ratio, flow_functions(ratio, CRITICAL_RATIO) / PSI_MAX, "(2.42)", ORANGE, "--"),
        legend="upper right",
    )
    has_flow = "mass_flow" in rows and bool(np.isfinite(rows["mass_flow"]).any())
    flow, title = (
        (1e3 * rows["mass_flow"], "mass flow in g/s") if has_flow else (gradient, "pressure gradient in bar/s")
    )
    instead = "" if has_flow else ", as pressure gradient (2.22), because the volume of the vessel is not stated"
    caption = f"Figure 7.20: mass flow of the inflation{instead}: constant while choked."
    from_zero = lambda axes: axes.set_ylim(bottom=0)  # noqa: E731
    yield chart(caption, "pressure in bar", title, Line(p, flow, colour=BLUE), extra=from_zero)


def _deflation(rows: Table) -> Iterator[Figure]:
    yield _curve("Figure 7.17: deflation pressure curve.", rows)
    caption = "Figure 7.21: deflation on a logarithmic scale: while choked it is exponential, a straight line."
    yield _curve(caption, rows, "log")
    p, gradient = in_display_unit(rows["fitted"], "Pa"), in_display_unit(rows["gradient"], "Pa/s")
    choked = p > 1.05 * float(p.min()) / CRITICAL_RATIO
    lines = [Line(p, gradient, "identified", BLUE)]
    if choked.any():
        slope = float(np.sum(p[choked] * gradient[choked]) / np.sum(p[choked] ** 2))
        through_zero = np.array([0.0, float(p.max())])
        lines.append(
            Line(through_zero, slope * through_zero, f"{format_number(slope, 3)} 1/s × pressure", ORANGE, "--")
        )
    caption = "Figure 7.22: pressure and gradient of the deflation: a straight line through zero while choked."
    yield chart(caption, "pressure in bar", "pressure gradient in bar/s", *lines, legend="upper right")


def _over_voltage(grid: Table) -> Figure:
    levels = np.unique(grid["p"])
    level = float(levels[np.argmin(np.abs(levels - REFERENCE_PRESSURE))])
    rows = grid.where(p=level)
    caption = f"Figure 7.24: pressure gradient over voltage at {format_number(1e-5 * level, 2)} bar."
    line = Line(rows["u"], in_display_unit(rows["p_gradient"], "Pa/s"), colour=BLUE)
    return chart(caption, "valve command in V", "pressure gradient in bar/s", line, extra=zero_line)


def _nearest_commands(areas: Table, opening: Array) -> NDArray[np.bool_]:
    """Return the mask of the commands that are nearest to the null on each side."""
    chosen = np.zeros(len(areas), dtype=bool)
    for side in (opening > 0, opening < 0):
        mine = np.flatnonzero(side)
        chosen[mine[np.argsort(np.abs(opening[mine]))[:COMMANDS_PER_SIDE]]] = True
    return chosen


def _areas(caption: str, areas: Table, chosen: NDArray[np.bool_]) -> Figure:
    opening = areas["opening" if "opening" in areas else "u"]
    lines = []
    for side, colour, label in ((1.0, BLUE, "supply → chamber"), (-1.0, ORANGE, "chamber → ambient")):
        mine = np.flatnonzero(chosen & (np.sign(opening) == side))
        if mine.size:
            mine = mine[np.argsort(areas["u"][mine])]
            lines.append(Line(areas["u"][mine], 1e6 * areas["area"][mine], label, colour, "o-", size=3))
    return chart(
        caption,
        "valve command in V",
        "effective area in mm²",
        *lines,
        legend="upper right",
        extra=lambda axes: axes.set_ylim(bottom=0),
    )


def _slip(replays: Table) -> Iterator[Figure]:
    """Yield figures 6.14 to 6.19 and 6.34 to 6.39: one stick-slip, measured and by each model."""
    for (model,), rows in replays.groups("model"):
        for i, (name, title) in enumerate((("a", "acceleration in m/s²"), ("v", "velocity in m/s"))):
            yield chart(
                f"Figure 6.{FIRST_FIGURE[str(model)] + i}: {title.split()[0]} of model {model} in one stick-slip, "
                "driven by the measured force.",
                "time from break-away in s",
                title,
                Line(rows["time"], rows[name], "measured", GREY, width=1.0),
                Line(rows["time"], rows[f"{name}_model"], f"model {model}", BLUE),
                legend="upper right",
                height=2.3,
            )
