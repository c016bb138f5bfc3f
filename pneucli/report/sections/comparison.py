"""Model against measurement: how far apart, channel by channel, and both over time, to be zoomed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from pneucli.compare.channel_errors import fit_percent
from pneucli.messages.compare import rating, test_first
from pneucli.messages.formatting import format_number, format_quantity, format_setting, in_display_unit, unit_symbol
from pneucli.quantities import CHANNELS, COMMANDS
from pneucli.report.figure import envelope_indices, with_gaps
from pneucli.report.page_elements import Cell, Grid, Note, Panel, Part, PlotRun, Section, Series, ZoomPlot
from pneucli.report.report_data import ReportData, Table

MAX_PLOT_SAMPLES = 80_000  # of all plots together: what keeps the page at a size that can be sent by mail
FEWEST, MOST = 200, 4000  # of one curve
MAX_UNFOLDED_RECORDINGS = 12  # recordings; a longer table is folded


def section(material: ReportData) -> Section | None:
    """Return errors and zoomable plots; absent where nothing was compared."""
    answer = material.answer("compare")
    if not answer:
        return None
    lead = (
        f"The model is started anew from the measured state every {format_setting(answer['horizon_s'])} s and runs freely in "
        "between. An error of 1 × noise is what a correct model would show: sensor noise, also that of the restart "
        "state and of the measured inputs, carried through the model."
    )
    parts: list[Part] = []
    if answer["error"].get("test") is None:
        parts.append(Note('No recording has use = "test": the errors are of those that were fitted.', "warning"))
    residuals = material.table("compare/residuals")
    if len(residuals):
        before = material.first_comparison.table if material.first_comparison else Table({})
        parts.append(_zoom(residuals, before, material.table("ingest/signals"), answer["channels"]))
    earlier = material.first_comparison.answer["channels"] if material.first_comparison else []
    parts += [_overview(answer["channels"], earlier), _errors(answer)]
    return Section("comparison", "Recordings", lead, parts)


def _overview(channels: Iterable[Mapping[str, Any]], earlier: Iterable[Mapping[str, Any]]) -> Grid:
    ratios: dict[tuple[str, str], dict[str, float | None]] = {}
    before = {(c["recording"], c["channel"]): c["ratio_to_noise"] for c in earlier}
    for c in test_first(channels):
        ratios.setdefault((c["recording"], c["use"]), {})[c["channel"]] = c["ratio_to_noise"]
    names = [name for name in (*CHANNELS, *COMMANDS) if any(name in known for known in ratios.values())]
    rows = [
        [
            Cell(recording, numeric=False),
            Cell(use, numeric=False),
            *(_ratio(before.get((recording, name)), known.get(name)) for name in names),
        ]
        for (recording, use), known in ratios.items()
    ]
    how = "first model → model as it is; " if before else ""
    caption = f"Error of each channel, × noise; {how}test recordings, which the fit has not seen, stand first."
    return Grid(caption, ("recording", "use", *names), rows, folded=len(rows) > MAX_UNFOLDED_RECORDINGS)


def _ratio(before: float | None, now: float | None) -> Cell:
    """Return a channel's error, with that of the first model where there was another one."""
    if now is None:
        return Cell("")
    return Cell(
        format_number(now, 3) if before is None else f"{format_number(before, 3)} → {format_number(now, 3)}",
        tone=rating(now),
    )


def _errors(answer: Mapping[str, Any]) -> Grid:
    head = ("recording", "use", "channel", "RMSD", "of range", "fit", "noise floor", "× noise")
    rows = [
        [
            Cell(c["recording"], numeric=False),
            Cell(c["use"], numeric=False),
            Cell(c["channel"], numeric=False),
            Cell(format_quantity(c["rmsd"], c["unit"], 3)),
            Cell(f"{format_number(c['percent'], 2)} %"),
            Cell(f"{format_number(c['fit_percent'], 3)} %"),
            Cell(format_quantity(c["noise"], c["unit"], 3)),
            Cell(format_number(c["ratio_to_noise"], 3), tone=rating(c["ratio_to_noise"])),
        ]
        for c in test_first(answer["channels"])
    ]
    caption = "The same errors in full"
    return Grid(caption, head, rows, folded=True)


def _zoom(residuals: Table, before: Table, signals: Table, judged: Sequence[Mapping[str, Any]]) -> ZoomPlot:
    noise = {(c["recording"], c["channel"]): c["noise"] for c in judged if c["noise"]}
    channels = dict(residuals.groups("recording", "channel"))
    earlier = dict(before.groups("recording", "channel"))
    most = int(np.clip(MAX_PLOT_SAMPLES / (4 * len(channels)), FEWEST, MOST))
    inputs = {recording: rows for (recording,), rows in signals.groups("recording")}
    runs: dict[tuple[bool, str], list[Panel]] = {}
    for (recording, channel), rows in channels.items():
        panels = runs.setdefault((rows.text("use") != "test", recording), [])
        if not panels and recording in inputs:
            panels += _command(inputs[recording], most)
        panels.append(_panel(channel, rows, earlier.get((recording, channel)), most))
    for (_, recording), panels in runs.items():
        panels.extend(_deviation(recording, channels, noise, most))
    named = [
        PlotRun(f"{name} ({'train' if train else 'test'})", panels) for (train, name), panels in sorted(runs.items())
    ]
    caption = (
        "Drag over a stretch to zoom in, double-click or press the button to see all again; keys: + and −, arrows, 0. "
        "On paper each recording is a small picture. Where a recording has more samples than the "
        "plot, the least and the largest of each stretch are shown, so that no peak is lost. Ticks at the top: the "
        "model is restarted from the measurement."
    )
    return ZoomPlot("comparison", caption, named)


def _command(signals: Table, most: int) -> list[Panel]:
    known = [name for name in ("u", "u2") if name in signals and np.isfinite(signals[name]).any()]
    if not known:
        return []
    kept = envelope_indices([signals[name] for name in known], most)
    curves = [Series(name, "input", signals[name][kept]) for name in known]
    return [Panel("valve command", "V", signals["time"][kept], curves)]


def _panel(channel: str, rows: Table, before: Table | None, most: int) -> Panel:
    unit = rows.text("unit")
    models = {"model": rows["model"]}
    if before is not None and len(before) == len(rows):
        models = {"first model": before["model"], "model": rows["model"]}
    kept = envelope_indices([rows["measured"], rows["residual"]], most)
    curves = [Series("measured", "measured", in_display_unit(rows["measured"][kept], unit))]
    for label, values in models.items():
        role = "model" if label == "model" else "before"
        fit = fit_percent(rows["measured"], values)
        told = label if math.isnan(fit) else f"{label}, fit {format_number(fit, 3)} %"
        curves.append(Series(told, role, in_display_unit(with_gaps(values[kept], rows["segment"][kept]), unit)))
    starts = rows["time"][np.flatnonzero(np.diff(rows["segment"])) + 1]
    return Panel(channel, unit_symbol(unit), rows["time"][kept], curves, starts.tolist())


def _deviation(
    recording: str, channels: Mapping[tuple[str, str], Table], noise: Mapping[tuple[str, str], float], most: int
) -> list[Panel]:
    """Return measured minus model of all channels, in units of the noise floor, over one time axis."""
    here = {c: rows for (r, c), rows in channels.items() if r == recording and (r, c) in noise}
    if not here:
        return []
    time = next(iter(here.values()))["time"]
    scaled = {c: rows["residual"] / noise[recording, c] for c, rows in here.items()}
    kept = envelope_indices(list(scaled.values()), most)
    curves = [Series(c, "residual", values[kept]) for c, values in scaled.items()]
    return [Panel("measured − model", "× noise", time[kept], curves)]
