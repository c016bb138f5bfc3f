"""Diagnostics of the identification: correlated parameters, sensitivity, convergence, correlation of residuals."""

import math
from collections.abc import Iterator

import numpy as np
from matplotlib.ticker import FuncFormatter, NullFormatter

from pneucli.distributions import normal_quantile
from pneucli.messages.compare import Answer, ChannelResult
from pneucli.messages.formatting import format_number, format_plain, join_names
from pneucli.quantities import CHANNELS, SIGNALS, Z95
from pneucli.report.figure import BLUE, GREY, PALETTE, Drawing, drawing, figures, heat_map
from pneucli.report.page_elements import Grid, Note, Part, Row, Section
from pneucli.report.report_data import ReportData, Table

PLACE = 60  # on the page
STRONG_CORRELATION = 0.9  # from here on, one parameter can compensate the other
MAX_PAIRS = 5  # pairs of parameters in the note
MAX_RESIDUALS = 6  # residuals in figures


def section(material: ReportData) -> Section | None:
    """Return the chapter; absent where neither fit nor residuals were stored."""
    parts: list[Part] = [
        *_parameter_correlation(material.table("identify/correlation")),
        *_sensitivity(material.table("identify/sensitivity")),
        *figures([*_iterations(material.table("identify/iterations"))]),
        *figures([*_residuals(material)]),
    ]
    if not parts:
        return None
    lead = (
        "Parameters that the recordings identify only in combination, the sensitivity to each parameter, the "
        "convergence of the fit, and the correlation of the residuals with themselves and with the inputs."
    )
    return Section("relations", "Correlation of parameters and residuals", lead, parts, folded=True)


def _parameter_correlation(table: Table) -> Iterator[Part]:
    """Yield the correlation matrix, and a note about its strongest pairs."""
    names = list(dict.fromkeys(table["name"])) if len(table) else []
    if len(names) < 2:
        return
    matrix = table["correlation"].reshape(len(names), len(names))
    first, second = np.triu_indices(len(names), 1)
    order = np.argsort(-np.abs(matrix[first, second]))[:MAX_PAIRS]
    strong = [(names[first[i]], names[second[i]], matrix[first[i], second[i]]) for i in order]
    pairs = [f"{a} and {b} ({format_number(float(r), 2)})" for a, b, r in strong if abs(r) >= STRONG_CORRELATION]
    if pairs:
        combined = f"These recordings identify only in combination: {join_names(pairs)}."
        yield Note(f"{combined} Record an experiment in which only one of them acts.")
    caption = "Correlation of the fitted parameters: near 1 or −1, one parameter can compensate the other."
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
    """Yield the effect of 1 % of each parameter on each channel."""
    if not len(table):
        return
    sensitivities = {
        (str(n), str(c)): float(v)
        for n, c, v in zip(table["name"], table["channel"], table["times_noise"], strict=True)
    }
    channels = [c for c in CHANNELS if any(c == channel for _, channel in sensitivities)]
    names = list(dict.fromkeys(name for name, _ in sensitivities))
    rows: list[Row] = [[name, *(format_number(sensitivities.get((name, c)), 2) for c in channels)] for name in names]
    caption = "Change of each channel for a change of 1 % of a parameter: rms over all samples, × noise."
    yield Grid(caption, ("parameter", *channels), rows, folded=len(rows) > 12)


def _iterations(table: Table) -> Iterator[Drawing]:
    """Yield the residual over the iterations of the searches, one colour for each set of effects."""
    if not len(table):
        return
    caption = (
        "Convergence of the fit: rms residual after each iteration; a line for each search, a colour for each model."
    )
    with drawing(caption, "iteration, all searches in sequence", "rms residual, × noise") as one:
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
        one.axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: format_plain(value)))
        one.axes.yaxis.set_minor_formatter(NullFormatter())
        one.axes.legend()
    yield one


def _residuals(material: ReportData) -> Iterator[Drawing]:
    """Yield the correlations of the residuals with the largest errors over noise, test recordings first."""
    table = material.table("compare/correlation")
    if not len(table):
        return
    errors = [c for c in material.read(Answer).channels if not math.isnan(c.ratio_to_noise)]
    worst = sorted(errors, key=lambda c: (c.use != "test", -c.ratio_to_noise))[:MAX_RESIDUALS]
    for channel in worst:
        rows = table.where(recording=channel.recording, channel=channel.channel)
        if len(rows):
            yield _correlation(rows, channel)


def _of_many(lags: int) -> float:
    """Return the factor of the bound for the largest of many lags (Bonferroni)."""
    return float(normal_quantile(1.0 - 0.025 / max(lags, 1)) / Z95)


def _correlation(rows: Table, channel: ChannelResult) -> Drawing:
    name = channel.channel
    beyond = []
    caption = f"Residual of {name} in {channel.recording} ({format_number(channel.ratio_to_noise, 3)} × noise)"
    with drawing(caption, "lag in s; positive: the input leads", "correlation") as one:
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
                    beyond.append(f"{against} at {format_plain(float(part['lag'][most]))} s")
        one.axes.axhline(0.0, color=BLUE, linewidth=0.4)
        one.axes.legend()
    result = f"significant with {join_names(beyond)}" if beyond else "no significant correlation with the inputs"
    one.caption = f"{caption}: {result} (dotted: 95 % at one lag, by Bartlett's formula)."
    if one.figure is not None:
        one.figure = type(one.figure)(one.figure.svg, one.caption)
    return one
