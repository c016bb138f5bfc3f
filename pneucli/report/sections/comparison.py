"""Model and measurement: the error of each channel, and zoomable plots of both over time."""

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from pneucli.compare.channel_errors import fit_percent
from pneucli.messages.compare import CHANNEL_TITLES, Answer, ChannelResult, rating, test_first
from pneucli.messages.envelope import envelope_indices, with_gap_indices
from pneucli.messages.formatting import format_fit, format_number, format_plain, in_display_unit, unit_symbol
from pneucli.quantities import CHANNELS, COMMANDS
from pneucli.report.figure import with_gaps
from pneucli.report.page_elements import (
    ZOOM_HINT,
    Cell,
    Grid,
    Note,
    Panel,
    Part,
    PlotRun,
    Row,
    Section,
    Series,
    ZoomPlot,
)
from pneucli.report.report_data import ReportData, Table

PLACE = 30  # on the page
MAX_PLOT_SAMPLES = 80_000  # of all plots together: the page stays small enough for a mail
MIN_CURVE_SAMPLES, MAX_CURVE_SAMPLES = 200, 4000
MIN_VISIBLE_SHARE = 2e-3  # of a channel's range: half a pixel of a plot; curves that are closer coincide
MIN_SEGMENT_SAMPLES = 10  # drawn ones between two restarts, each of which leaves one out: else most of a curve is gaps
MAX_UNFOLDED_RECORDINGS = 12  # recordings; a longer table is folded

CAPTION = (
    "Where a recording has more samples than the plot, the plot shows minimum and maximum of each block of samples, so "
    "no peak is lost. Ticks at the top mark where the model restarts from the measurement."
)
GAPS = (
    "Wider gaps: nothing is compared there, because the piston touches an end of the stroke (the model does not "
    "contain the stiffness of an end) or a reading is missing."
)


def section(material: ReportData) -> Section | None:
    """Return errors and zoomable plots; absent where nothing was compared."""
    if not material.answer("compare"):
        return None
    answer = material.read(Answer)
    lead = (
        f"The model restarts from the measured state every {format_plain(answer.horizon_s)} s and runs freely in "
        "between. A correct model has an error of 1 × noise: sensor noise, including that of the restart state and of "
        "the measured inputs, propagated through the model."
    )
    steady = material.steady_recordings
    over_time = [c for c in answer.channels if c.recording not in steady]
    if not over_time:
        lead = (
            "Flow of each row against C, b and m of its opening. A correct model has an error of 1 × noise: the "
            "scatter of neighbouring rows, or the noise that the pipeline states."
        )
    parts: list[Part] = []
    if answer.error.get("test") is None:
        parts.append(Note('No recording has use = "test": these are the errors of the fitted recordings.', "warning"))
    residuals = material.table("compare/residuals")
    if len(residuals) and over_time:
        before = material.first_comparison.table if material.first_comparison else Table({})
        parts.append(_zoom(residuals, before, material.table("ingest/signals"), over_time))
    earlier = material.first_comparison.answer.channels if material.first_comparison else []
    parts += [_overview(answer.channels, earlier), _errors(answer)]
    return Section("comparison", "Recordings", lead, parts)


def _overview(channels: Iterable[ChannelResult], earlier: Iterable[ChannelResult]) -> Grid:
    ratios: dict[tuple[str, str], dict[str, float]] = {}
    before = {c.key: c.ratio_to_noise for c in earlier}
    for c in test_first(channels):
        ratios.setdefault((c.recording, c.use), {})[c.channel] = c.ratio_to_noise
    names = [name for name in (*CHANNELS, *COMMANDS) if any(name in channels for channels in ratios.values())]
    rows: list[Row] = [
        [*key, *(_ratio(before.get((key[0], name)), errors.get(name)) for name in names)]
        for key, errors in ratios.items()
    ]
    models = "before → after, the first and the present model; " if before else ""
    caption = f"Error of each channel, × noise; {models}held-out test recordings first."
    return Grid(caption, ("recording", "use", *names), rows, folded=len(rows) > MAX_UNFOLDED_RECORDINGS)


def _ratio(before: float | None, now: float | None) -> Cell | str:
    """Return a channel's error, with that of the first model where there was another one."""
    if now is None:
        return ""
    return Cell(
        format_number(now, 3) if before is None else f"{format_number(before, 3)} → {format_number(now, 3)}",
        tone=rating(now),
    )


def _errors(answer: Answer) -> Grid:
    rows: list[Row] = []
    for c in test_first(answer.channels):
        *before, ratio, limit = c.row
        rows.append([*before, Cell(ratio, tone=rating(c.ratio_to_noise, c.ratio_limit)), limit])
    return Grid("These errors in detail", CHANNEL_TITLES, rows, folded=True)


def _zoom(residuals: Table, before: Table, signals: Table, errors: Sequence[ChannelResult]) -> ZoomPlot:
    noise = {c.key: c.noise for c in errors if c.noise > 0.0}
    shown = {c.recording for c in errors}
    channels = {key: rows for key, rows in residuals.groups("recording", "channel") if key[0] in shown}
    earlier = dict(before.groups("recording", "channel"))
    max_samples = int(np.clip(MAX_PLOT_SAMPLES / (4 * len(channels)), MIN_CURVE_SAMPLES, MAX_CURVE_SAMPLES))
    inputs = {recording: rows for (recording,), rows in signals.groups("recording")}
    runs: dict[tuple[bool, str], list[Panel]] = {}
    for (recording, channel), rows in channels.items():
        panels = runs.setdefault((rows.text("use") != "test", recording), [])
        if not panels and recording in inputs:
            panels += command_panels(inputs[recording], max_samples)
        panels.append(channel_panel(channel, rows, earlier.get((recording, channel)), max_samples))
    for (_, recording), panels in runs.items():
        panels.extend(deviation_panels(recording, channels, noise, max_samples))
    named = [
        PlotRun(f"{name} ({'train' if train else 'test'})", panels) for (train, name), panels in sorted(runs.items())
    ]
    gaps = any(np.isnan(rows["residual"]).any() for rows in channels.values())
    return ZoomPlot("comparison", f"{CAPTION}{f' {GAPS}' if gaps else ''}", named, ZOOM_HINT)


def command_panels(signals: Table, max_samples: int) -> list[Panel]:
    """Return the valve's commands over time; nothing where there are none."""
    commands = [name for name in ("u", "u2") if name in signals and np.isfinite(signals[name]).any()]
    if not commands:
        return []
    indices = envelope_indices([signals[name] for name in commands], max_samples)
    curves = [Series(name, "input", signals[name][indices]) for name in commands]
    return [Panel("valve command", "V", signals["time"][indices], curves)]


def channel_panel(channel: str, rows: Table, before: Table | None, max_samples: int) -> Panel:
    """Return a channel as measured and by the model, and by an earlier model where that differs visibly."""
    unit = rows.text("unit")
    models = {"model": rows["model"]}
    if before is not None and len(before) == len(rows) and _differ(before, rows):
        models = {"before": before["model"], "after": rows["model"]}
    indices = with_gap_indices(envelope_indices([rows["measured"], rows["residual"]], max_samples), rows["residual"])
    segment = rows["segment"][indices]
    if MIN_SEGMENT_SAMPLES * np.count_nonzero(np.diff(segment)) > segment.size:
        segment = np.zeros_like(segment)
    curves = [Series("measured", "measured", in_display_unit(rows["measured"][indices], unit))]
    for label, values in models.items():
        role = "before" if label == "before" else "model"
        compared = np.where(np.isnan(rows["residual"]), np.nan, values)
        fit = fit_percent(rows["measured"], compared)
        title = label if math.isnan(fit) else f"{label}, fit {format_fit(fit)}"
        curves.append(Series(title, role, in_display_unit(with_gaps(compared[indices], segment), unit)))
    starts = rows["time"][np.flatnonzero(np.diff(rows["segment"])) + 1]
    return Panel(channel, unit_symbol(unit), rows["time"][indices], curves, starts.tolist())


def _differ(before: Table, now: Table) -> bool:
    """Return whether the curves of two models differ visibly in a plot."""
    distance, span = np.abs(before["model"] - now["model"]), np.ptp(now["measured"][np.isfinite(now["measured"])])
    return bool(np.nanmax(distance, initial=0.0) > MIN_VISIBLE_SHARE * span)


def deviation_panels(
    recording: str, channels: Mapping[tuple[str, str], Table], noise: Mapping[tuple[str, str], float], max_samples: int
) -> list[Panel]:
    """Return measured minus model of all channels, in units of the noise floor."""
    here = {c: rows for (r, c), rows in channels.items() if r == recording and (r, c) in noise}
    if not here:
        return []
    time = next(iter(here.values()))["time"]
    scaled = {c: rows["residual"] / noise[recording, c] for c, rows in here.items()}
    indices = envelope_indices(list(scaled.values()), max_samples)
    for values in scaled.values():
        indices = with_gap_indices(indices, values)
    curves = [Series(c, "residual", values[indices]) for c, values in scaled.items()]
    return [Panel("measured − model", "× noise", time[indices], curves)]
