"""Panels of the figures of a run: a channel's curves, its residual, and the canvas they are drawn on."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pneucli.compare.channel_errors import fit_percent
from pneucli.messages.envelope import envelope_indices
from pneucli.messages.formatting import format_noise_ratio, format_number, in_display_unit, unit_symbol
from pneucli.quantities import SIGNALS
from pneucli.report.figure import GREY, PALETTE, with_gaps

WIDTH, PANEL_HEIGHT = 8.0, 1.7  # inches
MAX_SAMPLES = 4000  # of a curve: more than the pixels of a screen
MODEL_LABEL = "model"
GAP_NOTE = "gaps: nothing to compare (at an end of the stroke, or no reading)"
BAND_SIGMA = 2.0  # standard deviations of what a correct model would show


class NotebookFigure(Figure):
    """A matplotlib figure that a notebook shows without pyplot; ``savefig`` writes it to a file."""

    def _repr_png_(self) -> bytes:
        into = io.BytesIO()
        self.savefig(into, format="png", dpi=110)
        return into.getvalue()


def canvas(panels: int, height: float = PANEL_HEIGHT) -> tuple[NotebookFigure, list[Axes]]:
    """Return a figure with panels below each other, on one axis of time."""
    figure = NotebookFigure(figsize=(WIDTH, max(panels * height, height) + 0.3), layout="constrained")
    axes: Any = figure.subplots(panels, 1, sharex=True, squeeze=False)
    found = [one for row in axes for one in row]
    for one in found:
        one.spines[["top", "right"]].set_visible(False)
    return figure, found


def draw_models(
    axes: Axes, channel: str, models: Mapping[str, pd.DataFrame], fits: Mapping[str, float | None] | None = None
) -> None:
    """Draw a channel: measured, and each model with its fit in the legend.

    ``fits`` are the fits of models whose tables are thinned; those of others are computed.
    """
    unit = next(iter(models.values()))["unit"].iloc[0]
    measured = next(iter(models.values()))
    axes.plot(
        measured["time"], _shown(measured["measured"], unit), color=GREY, linewidth=3, alpha=0.6, label="measured"
    )
    for i, (label, table) in enumerate(models.items()):
        if table.empty:
            continue
        fit = fits[label] if fits else fit_percent(table["measured"].to_numpy(), table["model"].to_numpy())
        compared = np.where(np.isnan(table["residual"]), np.nan, _shown(table["model"], unit))
        curve = with_gaps(compared, table["segment"].to_numpy())
        axes.plot(
            table["time"],
            curve,
            color=PALETTE[(1 - i) % len(PALETTE)],
            linewidth=1.1,
            label=f"{label}: fit {format_number(fit, 3)} %",
        )
    axes.set_ylabel(f"{SIGNALS[channel].symbol} in {unit_symbol(unit)}")
    axes.legend(frameon=False, fontsize=8)


def _shown(values: pd.Series[Any], unit: str) -> NDArray[Any]:
    return np.asarray(in_display_unit(values.to_numpy(), unit))


def draw_residual(axes: Axes, table: pd.DataFrame, noise: float | None, ratio: float | None) -> None:
    """Draw the residual of a channel over the band that a correct model would stay in."""
    unit = table["unit"].iloc[0]
    curve = with_gaps(_shown(table["residual"], unit), table["segment"].to_numpy())
    shown = "residual" if ratio is None else f"residual: {format_noise_ratio(ratio)} × noise"
    if noise is not None:
        band = BAND_SIGMA * float(in_display_unit(noise, unit))
        axes.axhspan(-band, band, color=GREY, alpha=0.25, linewidth=0, label="95 % of a correct model")
    axes.plot(table["time"], curve, color=PALETTE[0], linewidth=0.9, label=shown)
    axes.set_ylabel(f"in {unit_symbol(unit)}")
    axes.legend(frameon=False, fontsize=8, ncols=2)


def title(axes: Axes, name: str, tables: Sequence[pd.DataFrame]) -> None:
    """Write a recording's name over a figure, and what a gap in a model means where there is one."""
    axes.set_title(name, loc="left", fontsize=10)
    if any(table["residual"].isna().any() for table in tables):
        axes.set_title(GAP_NOTE, loc="right", fontsize=8, color=GREY)


def thinned(table: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of a channel that a figure needs: minima, maxima and gaps of its curves."""
    curves = [table[name].to_numpy() for name in ("measured", "model", "residual")]
    kept = envelope_indices(curves, MAX_SAMPLES)
    ends = np.flatnonzero(np.diff(table["segment"].to_numpy()))
    return table.iloc[np.union1d(kept, ends)]
