"""``run.plot``: figures of a run, to show in a notebook, to change, or to save."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pneucli.compare.channel_errors import fit_percent
from pneucli.errors import InputError, did_you_mean
from pneucli.messages.formatting import format_number, in_display_unit, unit_symbol
from pneucli.notebook.data_frames import read_frame, select_rows
from pneucli.quantities import SIGNALS
from pneucli.report.figure import GREY, PALETTE, with_gaps
from pneucli.stages import history

if TYPE_CHECKING:
    from pneucli.notebook.run_data import RunData

WIDTH, PANEL_HEIGHT = 8.0, 1.7  # inches
MODEL_LABEL = "model"


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
        figure, (axes,) = _canvas(1, 3.6)
        mesh = axes.pcolormesh(wide.columns, wide.index / 1e5, wide.to_numpy() / 1e5, cmap="viridis", shading="nearest")
        figure.colorbar(mesh, ax=axes, label="dp/dt in bar/s")
        axes.set(xlabel="valve command in V", ylabel=f"pressure of chamber {chamber} in bar")
        return figure

    def ladder(self) -> NotebookFigure:
        """Return a figure of the error over noise after each added effect."""
        table = self._run.ladder
        names = [name or "present model" for name in table["add"]]
        figure, (axes,) = _canvas(1, 0.9 + 0.35 * len(names))
        for i, use in enumerate(("test", "train")):
            axes.barh(np.arange(len(names)) + 0.4 * i, table[f"error_{use}"], 0.36, label=use, color=PALETTE[i])
        axes.axvline(1.0, color=GREY, linestyle="--")
        axes.set_yticks(np.arange(len(names)) + 0.2, [name if i == 0 else f"+ {name}" for i, name in enumerate(names)])
        axes.set(xlabel="error, × noise (1 is the noise floor)", xscale="log")
        axes.invert_yaxis()
        axes.legend(frameon=False)
        return figure

    def correlation(self) -> NotebookFigure:
        """Return a figure of the correlation of the fitted parameters."""
        table = self._run.correlation
        figure, (axes,) = _canvas(1, 1.5 + 0.22 * len(table))
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
        figure, panels = _canvas(len(others))
        for axes, other in zip(panels, others, strict=True):
            one = select_rows(rows, {"against": other})
            axes.plot(one["lag"], one["correlation"], color=PALETTE[0])
            axes.fill_between(one["lag"], -one["bound"], one["bound"], color=GREY, alpha=0.3, linewidth=0)
            axes.set_ylabel("with itself" if other == channel else f"with {other}")
        panels[-1].set_xlabel("lag in s")
        return figure

    def _panels(self, name: str, channels: Sequence[str] | None, models: dict[str, pd.DataFrame]) -> NotebookFigure:
        first = _require_rows(next(iter(models.values())), "recording", name)
        available = list(dict.fromkeys(first["channel"]))
        for channel in channels or ():
            _require_rows(first, "channel", channel)
        wanted = [c for c in available if channels is None or c in channels]
        figure, panels = _canvas(len(wanted))
        for axes, channel in zip(panels, wanted, strict=True):
            _draw(
                axes, channel, {n: select_rows(t, {"recording": name, "channel": channel}) for n, t in models.items()}
            )
        panels[-1].set_xlabel("time in s")
        panels[0].set_title(name, loc="left", fontsize=10)
        return figure


def _model_label(effects: Sequence[str]) -> str:
    return "base + " + " + ".join(effects) if effects else "base"


def _require_rows(table: pd.DataFrame, column: str, name: str) -> pd.DataFrame:
    """Return the rows of a name; raises InputError where there are none."""
    rows = select_rows(table, {column: name})
    if rows.empty:
        raise InputError(f"plot, {column}", f'"{name}" was not compared', mend=did_you_mean(name, set(table[column])))
    return rows


def _canvas(panels: int, height: float = PANEL_HEIGHT) -> tuple[NotebookFigure, list[Axes]]:
    figure = NotebookFigure(figsize=(WIDTH, max(panels * height, height) + 0.3), layout="constrained")
    axes: Any = figure.subplots(panels, 1, sharex=True, squeeze=False)
    found = [one for row in axes for one in row]
    for one in found:
        one.spines[["top", "right"]].set_visible(False)
    return figure, found


def _draw(axes: Axes, channel: str, models: dict[str, pd.DataFrame]) -> None:
    unit = next(iter(models.values()))["unit"].iloc[0]
    measured = next(iter(models.values()))
    axes.plot(
        measured["time"], _shown(measured["measured"], unit), color=GREY, linewidth=3, alpha=0.6, label="measured"
    )
    for i, (label, table) in enumerate(models.items()):
        if table.empty:
            continue
        fit = fit_percent(table["measured"].to_numpy(), table["model"].to_numpy())
        curve = with_gaps(_shown(table["model"], unit), table["segment"].to_numpy())
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
