"""Figures of the thesis on friction laws and sliding sectors: 3.1 to 3.4, 3.6, 5.1, 6.20 and 8.6."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from matplotlib.axes import Axes

from pneucli.arrays import Array
from pneucli.messages.design import Answer, SectorAnswer
from pneucli.messages.envelope import envelope_indices
from pneucli.messages.formatting import format_plain
from pneucli.physics.vectorised import stribeck_friction
from pneucli.report.figure import BLUE, GREEN, GREY, ORANGE, Line, chart
from pneucli.report.page_elements import Figure
from pneucli.report.report_data import ReportData, Table

MAX_SAMPLES = 2000  # of a curve
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
    return np.concatenate([np.linspace(-top, -1e-9, MAX_SAMPLES // 2), np.linspace(1e-9, top, MAX_SAMPLES // 2)])


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
        extra=lambda axes: axes.set_ylim(bottom=0),
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
    kept = envelope_indices([x1, x2], MAX_SAMPLES)

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
