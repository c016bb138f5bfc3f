"""``run.plot``: figures of a run, to show in a notebook, to change, or to save."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from pneucli.errors import InputError, did_you_mean
from pneucli.notebook.data_frames import read_frame, select_rows
from pneucli.notebook.ladder import ladder_steps
from pneucli.notebook.panels import (
    MODEL_LABEL,
    PANEL_HEIGHT,
    NotebookFigure,
    canvas,
    draw_models,
    draw_residual,
    thinned,
    title,
)
from pneucli.report.figure import GREY, PALETTE
from pneucli.stages import history

if TYPE_CHECKING:
    from pneucli.notebook.run_data import RunData


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
        axes.set_yticks(np.arange(len(steps)) + 0.2, [step.label for step in steps])
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
