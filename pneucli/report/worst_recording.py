"""Draw the picture of the first screen: the held-out recording in which the model is worst, before and after."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.ticker import FuncFormatter, NullLocator
from numpy.typing import NDArray

from pneucli.compare.error_regions import error_concentration
from pneucli.messages.compare import evaluation_error
from pneucli.messages.envelope import envelope_indices, with_gap_indices
from pneucli.messages.formatting import axis_title, format_noise_ratio, format_plain, in_display_unit
from pneucli.quantities import SIGNALS
from pneucli.report.figure import BLUE, GREY, ORANGE, render, with_gaps
from pneucli.report.report_data import ReportData, Table

Array = NDArray[np.float64]
FIGURE_SIZES = {"wide": (8.6, 4.3), "narrow": (4.3, 4.6)}  # inches, on a desk and on a telephone
MAX_SAMPLES = 1500  # samples of a curve
CONTEXT_RESTARTS = 2.0  # restart intervals on each side of the marked interval; at least the interval's own length
BAND_SIGMA = 2.0  # standard deviations


@dataclass(frozen=True)
class WorstRecording:
    """One channel of one recording, SI: the models before (None where there is only one) and after, each (n,).

    ``noise`` is the rms error of a correct model, ``stretch`` the interval (s) in which the error is worst.
    """

    recording: str
    kind: str
    channel: str
    unit: str
    noise: float
    time: Array
    measured: Array
    before: Array | None
    after: Array
    segment: Array
    stretch: tuple[float, float] | None
    horizon: float
    error_ratios: tuple[float | None, float]


def worst_recording_figure(found: WorstRecording) -> tuple[dict[str, str], str]:
    """Return the picture as SVG in each of ``FIGURE_SIZES``, and its caption."""
    pictures = {name: render(partial(_draw, found), *size) for name, size in FIGURE_SIZES.items()}
    before, now = found.error_ratios
    ratio = format_noise_ratio(now)
    if before is not None:
        ratio = f"{format_noise_ratio(before)} → {ratio}"
    shaded = "Shaded: the interval with the largest error. " if found.stretch else ""
    return pictures, (
        f"{found.channel} in {found.recording}, the worst {found.kind}recording: {ratio} × noise. {shaded}Below: "
        f"measured − model, with the band of ± {format_plain(BAND_SIGMA)} σ of a correct model. The model restarts "
        f"from the measurement every {format_plain(found.horizon)} s (ticks)."
    )


def find_worst_recording(material: ReportData) -> WorstRecording | None:
    """Return the channel with the largest error over noise, that of the first model where there was one."""
    answer, residuals = material.answer("compare"), material.table("compare/residuals")
    first = material.first_comparison
    judge = first.answer if first else answer
    use, _ = evaluation_error(answer.get("error", {}))
    channels = {(c["recording"], c["channel"]): c for c in answer.get("channels", []) if c["noise"]}
    ratios = [
        c
        for c in judge.get("channels", [])
        if c["use"] == use
        and c["ratio_to_noise"]
        and _channel_key(c) in channels
        and c["recording"] not in material.steady_recordings  # they have a chapter of their own, over pressures
    ]
    if not ratios or not len(residuals):
        return None
    worst = max(ratios, key=lambda c: c["ratio_to_noise"])
    rows = _rows(residuals, worst)
    earlier = _rows(first.table, worst) if first else None
    if earlier is not None and len(earlier) != len(rows):
        earlier = None
    error = rows["residual"] if earlier is None else earlier["residual"]
    stretch = error_concentration(rows["time"], np.nan_to_num(error) ** 2)
    now = channels[_channel_key(worst)]
    return WorstRecording(
        *(worst["recording"], "held-out " if use == "test" else "", worst["channel"], worst["unit"], now["noise"]),
        *(rows["time"], rows["measured"]),
        None if earlier is None else earlier["model"],
        *(rows["model"], rows["segment"]),
        stretch[:2] if stretch else None,
        answer["horizon_s"],
        (None if earlier is None else worst["ratio_to_noise"], now["ratio_to_noise"]),
    )


def _rows(residuals: Table, channel: Mapping[str, Any]) -> Table:
    return residuals.where(recording=channel["recording"], channel=channel["channel"])


def _channel_key(channel: Mapping[str, Any]) -> tuple[str, str]:
    return channel["recording"], channel["channel"]


def _draw(found: WorstRecording, canvas: Canvas) -> None:
    upper, lower = canvas.subplots(2, 1, sharex=True, height_ratios=[2.4, 1])
    indices = _shown_samples(found)
    time = found.time[indices]
    curves = [("measured", found.measured, GREY, "-", 3.0)]
    if found.before is not None:
        curves.append(("before", found.before, BLUE, "--", 1.3))
    curves.append(("model" if found.before is None else "after", found.after, ORANGE, "-", 1.3))
    for label, values, colour, style, width in curves:
        drawn = values[indices] if label == "measured" else with_gaps(values[indices], found.segment[indices])
        upper.plot(time, in_display_unit(drawn, found.unit), style, color=colour, linewidth=width, label=label)
        if label != "measured":
            residual = with_gaps((found.measured - values)[indices], found.segment[indices]) / found.noise
            lower.plot(time, residual, style, color=colour, linewidth=1.0)
    _frame(found, upper, lower, time)
    upper.set_ylabel(axis_title(found.channel).replace(SIGNALS[found.channel].title, found.channel))
    canvas.legend(loc="outside upper left", ncols=3)


def _frame(found: WorstRecording, upper: Axes, lower: Axes, time: Array) -> None:
    """Mark the interval with the largest error, the restarts and the band of the noise."""
    starts = found.time[np.flatnonzero(np.diff(found.segment)) + 1]
    for axes in (upper, lower):
        if found.stretch:
            axes.axvspan(*found.stretch, color=ORANGE, alpha=0.12, linewidth=0)
    upper.plot(starts, np.zeros(starts.size), "|", color=GREY, markersize=7, transform=upper.get_xaxis_transform())
    lower.axhspan(-BAND_SIGMA, BAND_SIGMA, color=GREY, alpha=0.3, linewidth=0)
    lower.set_yscale("symlog", linthresh=BAND_SIGMA, linscale=0.6)
    most = max(abs(end) for end in lower.get_ylim())
    powers = [10.0**k for k in range(1, 7) if 10.0**k < most]
    lower.set_yticks([*(-p for p in powers), -BAND_SIGMA, BAND_SIGMA, *powers], minor=False)
    lower.yaxis.set_major_formatter(FuncFormatter(lambda value, _: format_plain(value)))
    lower.yaxis.set_minor_locator(NullLocator())
    lower.set(xlabel="time in s", ylabel="× noise", xlim=(time[0], time[-1]))


def _shown_samples(found: WorstRecording) -> NDArray[np.int64]:
    """Return the samples to draw: the marked interval and as much on each side, with every peak."""
    low, high = found.stretch or (found.time[0], found.time[-1])
    margin = max(high - low, CONTEXT_RESTARTS * found.horizon)
    window = np.flatnonzero((found.time >= low - margin) & (found.time <= high + margin))
    curves = [c[window] for c in (found.measured, found.before, found.after) if c is not None]
    error = (found.measured - found.after)[window]
    return window[with_gap_indices(envelope_indices(curves, MAX_SAMPLES), error)]
