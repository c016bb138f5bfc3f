"""Diagnostics of the identification: correlated parameters, sensitivity, convergence, correlation of residuals."""

import math
from collections.abc import Iterator

import numpy as np

from pneucli.distributions import normal_quantile
from pneucli.messages.compare import Answer, ChannelResult
from pneucli.messages.formatting import format_number, format_plain, join_names
from pneucli.quantities import CHANNELS, SIGNALS, Z95
from pneucli.report.figure import BLUE, GREY, PALETTE, Line, chart, drawing, figures, heat_map, plain_numbers
from pneucli.report.page_elements import Figure, Grid, Note, Part, Row, Section
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
        *_iterations(material.table("identify/iterations")),
        *_residuals(material),
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


def _iterations(table: Table) -> Iterator[Figure]:
    """Yield the residual over the iterations of the searches, one colour for each set of effects."""
    if not len(table):
        return
    caption = (
        "Convergence of the fit: rms residual after each iteration; a line for each search, a colour for each model."
    )
    colours = {effects: PALETTE[i % len(PALETTE)] for i, effects in enumerate(dict.fromkeys(table["effects"]))}
    labels = {effects: f"base with {effects}" if effects else "base model" for effects in colours}
    lines: list[Line] = []
    begin = 0
    for (effects, _), rows in table.groups("effects", "search"):
        place = begin + np.arange(len(rows))
        begin += len(rows)
        lines.append(Line(place, rows["residual"], labels.pop(effects, None), colours[effects], ".-", size=3))
    titles = ("iteration, all searches in sequence", "rms residual, × noise")
    yield chart(caption, *titles, *lines, legend="best", extra=plain_numbers, yscale="log")


def _residuals(material: ReportData) -> Iterator[Figure]:
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


def _correlation(rows: Table, channel: ChannelResult) -> Figure:
    name = channel.channel
    beyond, lines = [], []
    for i, ((against,), part) in enumerate(rows.groups("against")):
        own = str(against) == name
        colour = GREY if own else PALETTE[(i - 1) % 6]
        label = "with itself" if own else f"with {SIGNALS[str(against)].symbol}"
        lines.append(Line(part["lag"], part["correlation"], label, colour))
        if not own:
            edge = float(part["bound"][0])
            lines += [Line(part["lag"][[0, -1]], [at, at], None, colour, ":", 0.8) for at in (edge, -edge)]
            if np.abs(part["correlation"]).max() > edge * _of_many(len(part)):
                most = int(np.argmax(np.abs(part["correlation"])))
                beyond.append(f"{against} at {format_plain(float(part['lag'][most]))} s")
    result = f"significant with {join_names(beyond)}" if beyond else "no significant correlation with the inputs"
    caption = (
        f"Residual of {name} in {channel.recording} ({format_number(channel.ratio_to_noise, 3)} × noise): {result} "
        "(dotted: 95 % at one lag, by Bartlett's formula)."
    )
    zero = lambda axes: axes.axhline(0.0, color=BLUE, linewidth=0.4)  # noqa: E731
    return chart(caption, "lag in s; positive: the input leads", "correlation", *lines, legend="best", extra=zero)
