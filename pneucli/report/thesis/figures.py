"""The figures of the thesis: flow function, friction laws, sectors, valve, and one stick-slip by each model."""

from collections.abc import Iterator, Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import ScalarFormatter
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.messages.design import Answer, SectorAnswer
from pneucli.messages.envelope import envelope_indices
from pneucli.messages.formatting import format_number, format_plain, in_display_unit
from pneucli.physics.gas import CRITICAL_RATIO, PSI_MAX, choked_maximum, choked_ratio, isentropic_flow_function
from pneucli.physics.vectorised import flow_functions, stribeck_friction
from pneucli.report.figure import BLUE, GREEN, GREY, ORANGE, Line, chart, reduced, zero_line
from pneucli.report.page_elements import Figure, Section
from pneucli.report.report_data import ReportData, Table

LAW_SAMPLES = 2000  # of a curve
SPEEDS = 20.0  # Stribeck velocities that the friction figures show to either side
STRIBECK_PARAMETERS = ("coulomb", "viscous", "static", "velocity")
MIN_DIFFERENCE = 0.01  # of a parameter: curves that are closer coincide in the figure
TINY = 1e-300
MARGIN = 1.1  # of the axes beyond the trajectory


def friction_laws(material: ReportData) -> Iterator[Figure]:
    """Yield figures 3.1 to 3.4 from the parameters of model A, and 3.6 from those of model D."""
    parameters = material.table("identify/friction_parameters")
    found = {str(model): _values(rows) for (model,), rows in parameters.groups("model")} if len(parameters) else {}
    if set(STRIBECK_PARAMETERS) <= set(found.get("A", {}).get("", {})):
        yield _steady_laws(found["A"][""])
    branches = found.get("D", {})
    if set(STRIBECK_PARAMETERS) <= set(branches.get("accelerating", {})) and _branches_differ(branches):
        yield _branches(branches)


def _branches_differ(branches: Mapping[str, Mapping[str, float]]) -> bool:
    """Return whether there are two branches, and curves that do not coincide."""
    up, down = branches["accelerating"], branches.get("slowing", {})
    if not {"coulomb", "viscous"} <= set(down):
        return False
    difference = max(abs(up[name] - down[name]) / max(abs(up[name]), TINY) for name in ("coulomb", "viscous"))
    return difference > MIN_DIFFERENCE or up["static"] > (1.0 + MIN_DIFFERENCE) * up["coulomb"]


def _values(rows: Table) -> dict[str, dict[str, float]]:
    """Return the parameters of a model by branch; those of both branches under the empty name."""
    found: dict[str, dict[str, float]] = {}
    for branch, name, value in zip(rows["branch"], rows["name"], rows["value"], strict=True):
        found.setdefault("" if branch == "both" else str(branch), {})[str(name)] = float(value)
    return found


def _speeds(velocity: float) -> Array:
    top = SPEEDS * velocity
    return np.concatenate([np.linspace(-top, -1e-9, LAW_SAMPLES // 2), np.linspace(1e-9, top, LAW_SAMPLES // 2)])


def _steady_laws(c: Mapping[str, float]) -> Figure:
    coulomb, viscous, static, velocity = (c[name] for name in STRIBECK_PARAMETERS)
    v = _speeds(velocity)
    caption = (
        "Figures 3.1 to 3.4: Coulomb friction (3.1), with viscous friction (3.3), with a break-away force (3.4), and "
        "Stribeck friction (3.6), with the parameters of model A."
    )
    return chart(
        caption,
        "velocity in mm/s",
        "friction in N",
        Line(1e3 * v, coulomb * np.sign(v), "3.1: Coulomb", GREY),
        Line(1e3 * v, stribeck_friction(v, coulomb, viscous, coulomb), "3.2: and viscous", GREEN),
        Line([0.0, 0.0], [-static, static], "3.3: break-away force", ORANGE, "o", size=4),
        Line(1e3 * v, stribeck_friction(v, coulomb, viscous, static, velocity), "3.4: Stribeck", BLUE),
        legend="upper left",
    )


def _branches(branches: Mapping[str, Mapping[str, float]]) -> Figure:
    up, down = branches["accelerating"], branches["slowing"]
    v = _speeds(up["velocity"])
    v = v[v > 0.0]
    rising = stribeck_friction(v, up["coulomb"], up["viscous"], up["static"], up["velocity"])
    falling = stribeck_friction(v, down["coulomb"], down["viscous"], down["coulomb"])
    return chart(
        "Figure 3.6: friction on two branches (3.7): Stribeck accelerating, Coulomb and viscous slowing.",
        "velocity in mm/s",
        "friction in N",
        Line(1e3 * v, rising, "accelerating", BLUE),
        Line(1e3 * v, falling, "slowing", ORANGE),
        legend="upper right",
        ylim=(0, None),
    )


def sliding_sectors(material: ReportData) -> Iterator[Figure]:
    """Yield figures 5.1, 6.20 and 8.6: the sector of the law, and the trajectory of its steps in it."""
    sector = material.read(Answer).sector.get("design")
    signals = material.table("design/comparison_signals")
    if sector is None or not len(signals):
        return
    rows = signals.where(controller="sector", scenario="steps")
    if len(rows):
        yield _trajectory(sector, rows)


def _trajectory(sector: SectorAnswer, rows: Table) -> Figure:
    x1 = 1e3 * (rows["x"] - rows["x_shaped"])
    x2 = 1e3 * (rows["v"] - np.gradient(rows["x_shaped"], rows["time"]))
    edge, top = (MARGIN * float(np.max(np.abs(values))) for values in (x1, x2))
    line = np.array([-edge, edge])
    lower, upper = -sector.lambda_1 * line, -sector.lambda_2 * line
    kept = envelope_indices([x1, x2], LAW_SAMPLES)

    def regions(axes: Axes) -> None:
        axes.fill_between(line, lower, upper, color=GREY, alpha=0.2, linewidth=0)
        axes.set(xlim=(-edge, edge), ylim=(-top, top))
        for name, x, y in (("R1", 0.6, 0.8), ("R2", -0.7, -0.85), ("R3", -0.9, 0.6)):
            axes.annotate(name, (x * edge, y * top))

    caption = (
        "Figures 5.1, 6.20 and 8.6: the sliding sector (5.11-5.14) between lines of slope "
        f"{format_plain(sector.lambda_1, 3)} and {format_plain(sector.lambda_2, 3)} 1/s "
        f"(eta {format_plain(sector.eta, 3)} s/m), regions R1 (M acts "
        "against +x), R2 (M acts toward +x) and R3 (the sector), and the trajectory of the law in the scenario steps."
    )
    return chart(
        caption,
        "error x1 of the position in mm",
        "rate x2 of the error in mm/s",
        Line(line, lower, "s1 = 0", GREEN, width=0.9),
        Line(line, upper, "s2 = 0", ORANGE, width=0.9),
        Line(x1[kept], x2[kept], "trajectory", BLUE, width=0.8),
        legend="lower left",
        height=3.4,
        extra=regions,
    )


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
    yield chart(caption, "pressure in bar", title, Line(p, flow, colour=BLUE), ylim=(0, None))


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
        ylim=(0, None),
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
