"""What a user of a toolbox for identification looks for: parameters together, the fit's way, what residuals follow."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from matplotlib.ticker import FuncFormatter, NullFormatter
from scipy.stats import norm

from pneucli.messages.formatting import format_number, format_setting, join_names
from pneucli.quantities import CHANNELS, SIGNALS
from pneucli.report.figure import BLUE, GREY, PALETTE, Drawing, drawing, figures, heat_map
from pneucli.report.page_elements import Cell, Grid, Note, Part, Section
from pneucli.report.report_data import ReportData, Table

STRONG_CORRELATION = 0.9  # of a correlation: one of the two may stand for the other
MAX_PAIRS = 5  # that are named
MAX_RESIDUALS = 6  # residuals that are drawn


def section(material: ReportData) -> Section | None:
    """Return the chapter; absent where neither fit nor residuals were kept."""
    parts: list[Part] = [
        *_parameter_correlation(material.table("identify/correlation")),
        *_sensitivity(material.table("identify/sensitivity")),
        *figures([*_iterations(material.table("identify/iterations"))]),
        *figures([*_residuals(material)]),
    ]
    if not parts:
        return None
    lead = (
        "What the recordings know of the parameters only together, what each parameter does, how the fit went, and "
        "what is left over has to do with itself and with the inputs."
    )
    return Section("relations", "Parameters and residuals in relation", lead, parts, folded=True)


def _parameter_correlation(table: Table) -> Iterator[Part]:
    """Yield the matrix of correlations, and its strongest pairs in words."""
    names = list(dict.fromkeys(table["name"])) if len(table) else []
    if len(names) < 2:
        return
    matrix = table["correlation"].reshape(len(names), len(names))
    first, second = np.triu_indices(len(names), 1)
    order = np.argsort(-np.abs(matrix[first, second]))[:MAX_PAIRS]
    strong = [(names[first[i]], names[second[i]], matrix[first[i], second[i]]) for i in order]
    told = [f"{a} and {b} ({format_number(float(r), 2)})" for a, b, r in strong if abs(r) >= STRONG_CORRELATION]
    if told:
        yield Note(f"These recordings know only together: {join_names(told)}. One that moves but one of them helps.")
    caption = "Correlation of the fitted parameters: near 1 or −1 one of two stands for the other."
    with drawing(caption, "", "", height=1.1 + 0.1 * len(names)) as one:
        heat_map(
            one, np.arange(len(names)), np.arange(len(names)), matrix, "correlation", cmap="RdBu_r", vmin=-1, vmax=1
        )
        places = range(1, len(names) + 1)
        one.axes.set_xticks(range(len(names)), [str(i) for i in places], rotation=90, fontsize=5.5)
        labels = [f"{name}  {i}" for i, name in zip(places, names, strict=True)]
        one.axes.set_yticks(range(len(names)), labels, fontsize=5.5)
        one.axes.invert_yaxis()
    yield from figures([one])


def _sensitivity(table: Table) -> Iterator[Part]:
    """Yield what 1 % of each parameter does to each channel."""
    if not len(table):
        return
    felt = {
        (str(n), str(c)): float(v)
        for n, c, v in zip(table["name"], table["channel"], table["times_noise"], strict=True)
    }
    channels = [c for c in CHANNELS if any(c == channel for _, channel in felt)]
    names = list(dict.fromkeys(name for name, _ in felt))
    rows = [[Cell(name, numeric=False), *(_sensitivity_cell(felt.get((name, c))) for c in channels)] for name in names]
    caption = "What a change by 1 % does to each channel of the fit, rms over all samples, × noise."
    yield Grid(caption, ("parameter", *channels), rows, folded=len(rows) > 12)


def _sensitivity_cell(value: float | None) -> Cell:
    return Cell("–" if value is None else format_number(value, 2))


def _iterations(table: Table) -> Iterator[Drawing]:
    """Yield the residual over the rounds of the searches, those of each set of effects in one colour."""
    if not len(table):
        return
    caption = "The fit at work: rms residual after each round; a line a search, a colour a set of effects."
    with drawing(caption, "round, all searches one after the other", "rms residual, × noise") as one:
        colours = {effects: PALETTE[i % len(PALETTE)] for i, effects in enumerate(dict.fromkeys(table["effects"]))}
        begin = 0
        for (effects, _), rows in table.groups("effects", "search"):
            place = begin + np.arange(len(rows))
            begin += len(rows)
            first = f"base with {effects}" if effects else "base model"
            label = first if colours.get(f"done {effects}") is None else None
            one.axes.plot(place, rows["residual"], ".-", color=colours[effects], markersize=3, label=label)
            colours[f"done {effects}"] = GREY
        one.axes.set_yscale("log")
        one.axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: format_setting(value)))
        one.axes.yaxis.set_minor_formatter(NullFormatter())
        one.axes.legend()
    yield one


def _residuals(material: ReportData) -> Iterator[Drawing]:
    """Yield the correlations of the residuals that are furthest above their noise, test recordings first."""
    table = material.table("compare/correlation")
    if not len(table):
        return
    judged = [c for c in material.answer("compare").get("channels", []) if c["ratio_to_noise"] is not None]
    worst = sorted(judged, key=lambda c: (c["use"] != "test", -c["ratio_to_noise"]))[:MAX_RESIDUALS]
    for channel in worst:
        rows = table.where(recording=channel["recording"], channel=channel["channel"])
        if len(rows):
            yield _correlation(rows, channel)


def _of_many(lags: int) -> float:
    """Return by how much the bound grows where the largest of many lags is looked at (Bonferroni)."""
    return float(norm.ppf(1.0 - 0.025 / max(lags, 1)) / norm.ppf(0.975))


def _correlation(rows: Table, channel: Mapping[str, Any]) -> Drawing:
    name = channel["channel"]
    beyond = []
    caption = f"Residual of {name} in {channel['recording']} ({format_number(channel['ratio_to_noise'], 3)} × noise)"
    with drawing(caption, "lag in s; above 0 the input came first", "correlation") as one:
        for i, ((against,), part) in enumerate(rows.groups("against")):
            own = str(against) == name
            label = "with itself" if own else f"with {SIGNALS[str(against)].symbol}"
            one.axes.plot(part["lag"], part["correlation"], color=GREY if own else PALETTE[(i - 1) % 6], label=label)
            if not own:
                edge = float(part["bound"][0])
                one.axes.plot(part["lag"][[0, -1]], [edge, edge], ":", color=PALETTE[(i - 1) % 6], linewidth=0.8)
                one.axes.plot(part["lag"][[0, -1]], [-edge, -edge], ":", color=PALETTE[(i - 1) % 6], linewidth=0.8)
                if np.abs(part["correlation"]).max() > edge * _of_many(len(part)):
                    most = int(np.argmax(np.abs(part["correlation"])))
                    beyond.append(f"{against} at {format_setting(float(part['lag'][most]))} s")
        one.axes.axhline(0.0, color=BLUE, linewidth=0.4)
        one.axes.legend()
    told = f"beyond chance with {join_names(beyond)}" if beyond else "nothing to do with the inputs beyond chance"
    one.caption = f"{caption}: {told} (dotted: 95 % at one lag, by Bartlett's formula)."
    if one.figure is not None:
        one.figure = type(one.figure)(one.figure.svg, one.caption)
    return one
