"""``run.plot``: figures of a run, to show in a notebook, to change, or to save."""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pneucli.compare.channel_errors import fit_percent
from pneucli.errors import InputError, did_you_mean
from pneucli.figure import read
from pneucli.messages import diagnose
from pneucli.messages.envelope import envelope_indices
from pneucli.messages.formatting import format_noise_ratio, format_number, in_display_unit, unit_symbol
from pneucli.messages.history import PathStep, models_on_current_data, path_steps
from pneucli.notebook.data_frames import read_frame, select_rows
from pneucli.quantities import SIGNALS
from pneucli.report.figure import GREY, PALETTE, with_gaps
from pneucli.stages import history
from pneucli.stages.history import compared_models

if TYPE_CHECKING:
    from pneucli.notebook.run_data import RunData


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


class Plots:
    """Figures of one run; each method returns a matplotlib figure."""

    def __init__(self, run: RunData) -> None:
        self._run = run

    def __repr__(self) -> str:
        names = [name for name in vars(Plots) if not name.startswith("_")]
        return f"figures of {self._run.artifacts.name}: {', '.join(f'.{name}()' for name in names)}"

    def recording(
        self, name: str, channels: Sequence[str] | None = None, compare_with: Iterable[RunData] = ()
    ) -> NotebookFigure:
        """Return a figure of a recording, a panel for each channel: measured, the model, and models of other runs.

        The legend has the fit of each model: 100 (1 - |y - model| / |y - mean y|) per cent.

        Args:
            name: The recording.
            channels: The channels; all by default.
            compare_with: Other runs.

        """
        models = {MODEL_LABEL: self._run.residuals} | {
            f"{MODEL_LABEL} of {one.artifacts.name}": one.residuals for one in compare_with
        }
        return self._panels(name, channels, models)

    def residuals(self, name: str, channels: Sequence[str] | None = None) -> NotebookFigure:
        """Return a figure of a recording: for each channel measured and model, and below the residual.

        The grey band is that of a correct model: twice the noise that ``compare`` states for the channel.

        Args:
            name: The recording.
            channels: The channels; all by default.

        """
        answer = self._run.answer("compare")
        table = self._run.residuals
        wanted = _wanted_channels(table, name, channels)
        figure, panels = canvas(2 * len(wanted), PANEL_HEIGHT * 0.9)
        tables = [thinned(select_rows(table, {"recording": name, "channel": channel})) for channel in wanted]
        for i, (channel, rows) in enumerate(zip(wanted, tables, strict=True)):
            stated = next(c for c in answer["channels"] if (c["recording"], c["channel"]) == (name, channel))
            draw_models(panels[2 * i], channel, {MODEL_LABEL: rows}, {MODEL_LABEL: stated["fit_percent"]})
            draw_residual(panels[2 * i + 1], rows, stated["noise"], stated["ratio_to_noise"])
        panels[-1].set_xlabel("time in s")
        title(panels[0], name, tables)
        return figure

    def models(self, name: str, channels: Sequence[str] | None = None) -> NotebookFigure:
        """Return a figure of a recording with every model that was compared on the same data, oldest first."""
        self._run.bring_up("compare")
        compared = history.recorded_models(self._run.artifacts / "compare")
        data = next((one.answer["data"] for one in compared if one.current), None)
        models = {
            _model_label(one.answer["model"]["effects"]) + (" (present)" if one.current else ""): read_frame(
                one.folder / "residuals.parquet"
            )
            for one in compared
            if one.answer["data"] == data
        }
        return self._panels(name, channels, models)

    def valve_map(self, chamber: int = 1) -> NotebookFigure:
        """Return a figure of dp/dt of the valve in bar/s over command in V and pressure in bar."""
        valve = self._run.valve if chamber == 1 else self._run.valve_2
        wide = valve.map.pivot_table(index="p", columns="u", values="p_gradient")
        figure, (axes,) = canvas(1, 3.6)
        mesh = axes.pcolormesh(wide.columns, wide.index / 1e5, wide.to_numpy() / 1e5, cmap="viridis", shading="nearest")
        figure.colorbar(mesh, ax=axes, label="dp/dt in bar/s")
        axes.set(xlabel="valve command in V", ylabel=f"pressure of chamber {chamber} in bar")
        return figure

    def ladder(self) -> NotebookFigure:
        """Return a figure of the error over noise of every model on the way, and of what the diagnosis would add.

        The models that were compared on the same data come first, oldest first, as ``pneucli history`` lists them;
        then, paler, the effects that the last diagnosis names.
        """
        steps = ladder_steps(self._run)
        figure, (axes,) = canvas(1, 0.9 + 0.35 * len(steps))
        for i, use in enumerate(("test", "train")):
            for at, step in enumerate(steps):
                axes.barh(
                    at + 0.4 * i,
                    step.error[use] or np.nan,
                    0.36,
                    label=use if at == 0 else None,
                    color=PALETTE[i],
                    alpha=0.45 if step.suggested else 1.0,
                )
        axes.axvline(1.0, color=GREY, linestyle="--")
        axes.set_yticks(np.arange(len(steps)) + 0.2, [step.label + " (present)" * step.present for step in steps])
        axes.set(xlabel="error, × noise (1 is the noise floor)", xscale="log")
        axes.invert_yaxis()
        axes.legend(frameon=False)
        return figure

    def correlation(self) -> NotebookFigure:
        """Return a figure of the correlation of the fitted parameters."""
        table = self._run.correlation
        figure, (axes,) = canvas(1, 1.5 + 0.22 * len(table))
        mesh = axes.imshow(table.to_numpy(), cmap="RdBu_r", vmin=-1, vmax=1)
        axes.set_xticks(range(len(table)), list(table.columns), rotation=90, fontsize=7)
        axes.set_yticks(range(len(table)), list(table.index), fontsize=7)
        figure.colorbar(mesh, ax=axes, label="correlation")
        return figure

    def residual_correlation(self, name: str, channel: str) -> NotebookFigure:
        """Return a figure of a residual's correlation with itself and each input over the lag (s), with 95 % bounds."""
        table = self._run.table("compare/correlation")
        rows = _require_rows(select_rows(table, {"channel": channel}), "recording", name)
        others = list(dict.fromkeys(rows["against"]))
        figure, panels = canvas(len(others))
        for axes, other in zip(panels, others, strict=True):
            one = select_rows(rows, {"against": other})
            axes.plot(one["lag"], one["correlation"], color=PALETTE[0])
            axes.fill_between(one["lag"], -one["bound"], one["bound"], color=GREY, alpha=0.3, linewidth=0)
            axes.set_ylabel("with itself" if other == channel else f"with {other}")
        panels[-1].set_xlabel("lag in s")
        return figure

    def _panels(self, name: str, channels: Sequence[str] | None, models: dict[str, pd.DataFrame]) -> NotebookFigure:
        wanted = _wanted_channels(next(iter(models.values())), name, channels)
        figure, panels = canvas(len(wanted))
        drawn: list[pd.DataFrame] = []
        for axes, channel in zip(panels, wanted, strict=True):
            rows = {n: select_rows(one, {"recording": name, "channel": channel}) for n, one in models.items()}
            draw_models(axes, channel, rows)
            drawn.extend(rows.values())
        panels[-1].set_xlabel("time in s")
        title(panels[0], name, drawn)
        return figure


def _model_label(effects: Sequence[str]) -> str:
    return "base + " + " + ".join(effects) if effects else "base"


def _wanted_channels(table: pd.DataFrame, name: str, channels: Sequence[str] | None) -> list[str]:
    """Return the channels of a recording, or those asked for; raises InputError where there is no such one."""
    rows = _require_rows(table, "recording", name)
    for channel in channels or ():
        _require_rows(rows, "channel", channel)
    return [c for c in dict.fromkeys(rows["channel"]) if not channels or c in channels]


def _require_rows(table: pd.DataFrame, column: str, name: str) -> pd.DataFrame:
    """Return the rows of a name; raises InputError where there are none."""
    rows = select_rows(table, {column: name})
    if rows.empty:
        raise InputError(
            f"plot, {column}", f'"{name}" was not compared', mend=did_you_mean(name, set(table[column])), code="E091"
        )
    return rows


def ladder_steps(run: RunData) -> list[PathStep]:
    """Return the models on the present data and the suggested ones; without comparison those of the diagnosis alone."""
    models = compared_models(run.artifacts / "compare")
    diagnosis = read(diagnose.Answer, run.answer("diagnose"))
    return path_steps(models_on_current_data(models) if models else [], diagnosis)


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
