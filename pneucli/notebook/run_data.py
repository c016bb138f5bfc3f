"""The data of one run: its tables, its answers, its valve maps and its model."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import RegularGridInterpolator

from pneucli.arrays import Array
from pneucli.errors import InputError
from pneucli.io.artifacts import read_metadata, read_table
from pneucli.messages.formatting import format_plain, format_quantity
from pneucli.notebook.progress import ignore_message, print_message, progress
from pneucli.pipeline.manifest import read_manifest
from pneucli.pipeline.runner import Pipeline

if TYPE_CHECKING:
    from pneucli.simulate.model import Model
    from pneucli.stages.pipeline_data import PipelineData


@dataclass(frozen=True)
class RunData:
    """Artifacts as DataFrames, answers as dictionaries, and the identified model.

    ``artifacts`` is the folder; ``pipeline`` the opened pipeline file, None where only the folder is available.
    """

    artifacts: Path
    pipeline: Pipeline | None = None
    quiet: bool = False

    def bring_up(self, *stages: str, options: Mapping[str, Mapping[str, Any]] | None = None) -> None:
        """Bring stages (``"compare"``, ``"diagnose"``) up to date; without a pipeline file do nothing.

        ``options`` are command line options by stage. Raises InputError as the stages do.
        """
        if self.pipeline is not None:
            notify: Callable[[str], None] = ignore_message if self.quiet else print_message
            with progress(self.quiet) as show_progress:
                self.pipeline.update(stages, options, show_progress, notify)

    def answer(self, stage: str) -> dict[str, Any]:
        """Return what ``pneucli STAGE --json`` prints."""
        self.bring_up(stage)
        manifest = read_manifest(self.artifacts / stage)
        if manifest is None or manifest.answer is None:
            mend = f"run pneucli {stage} on its pipeline file"
            raise InputError(str(self.artifacts / stage), "this stage has not run", "", mend, code="E007")
        return dict(manifest.answer)

    def table(self, name: str) -> pd.DataFrame:
        """Return an artifact by its path without ending, such as ``"identify/friction_curves"``."""
        self.bring_up(name.partition("/")[0])
        return read_frame(self.artifacts / f"{name}.parquet")

    @property
    def signals(self) -> pd.DataFrame:
        """Every recording in SI: recording, time, then a column for each signal."""
        return self.table("ingest/signals")

    @property
    def residuals(self) -> pd.DataFrame:
        """Measured, model and residual: recording, use, time, channel, unit, measured, model, residual, segment."""
        return self.table("compare/residuals")

    @property
    def ladder(self) -> pd.DataFrame:
        """The error over noise after each added effect: add, error_train, error_test."""
        return self.table("diagnose/ladder")

    @property
    def candidates(self) -> pd.DataFrame:
        """Every tested effect, a row for each of its parameters: effect, error_before, error_after, ..."""
        return self.table("diagnose/candidates")

    @property
    def parameters(self) -> pd.DataFrame:
        """The model's parameters: name, value, unit, ci_low, ci_high."""
        return self.table("identify/parameters")

    @property
    def correlation(self) -> pd.DataFrame:
        """Correlation of the fitted parameters: a square table by name (1 on the diagonal)."""
        long = self.table("identify/correlation")
        wide = long.pivot_table(index="name", columns="other", values="correlation", sort=False)
        return wide.loc[:, wide.index]

    @property
    def recordings(self) -> list[str]:
        """The names of the recordings, in the pipeline file's order."""
        return list(self.table("ingest/recordings")["name"])

    @property
    def valve(self) -> ValveMap:
        """The valve map of chamber 1."""
        return self._valve_map(1)

    @property
    def valve_2(self) -> ValveMap:
        """The valve map of chamber 2; raises InputError where the valve drives only chamber 1."""
        return self._valve_map(2)

    def _valve_map(self, chamber: Literal[1, 2]) -> ValveMap:

        maps = [self.table(f"identify/valve_{name}") for name in ("map", "inverse")]
        chambers = set(maps[0]["chamber"]) if "chamber" in maps[0] else {1}
        if chamber not in chambers:
            raise InputError(
                str(self.artifacts / "identify"),
                f"there is no map of chamber {chamber}",
                f"one of {sorted(chambers)}",
                code="E091",
            )
        return ValveMap(*(select_rows(one, {"chamber": chamber} if "chamber" in one else {}) for one in maps))

    @cached_property
    def model(self) -> Model:
        """The identified model, as the simulator takes it."""
        from pneucli.notebook.model import load_run_model  # noqa: PLC0415 - it imports the kernel

        return load_run_model(self.artifacts, self.pipeline, self._model_answers())

    def pipeline_data(self) -> PipelineData:
        """Return the rig, the recordings and the effects as the stages see them."""
        from pneucli.notebook.model import load_run_data  # noqa: PLC0415 - it imports the kernel

        return load_run_data(self.artifacts, self.pipeline, self._model_answers())

    def _model_answers(self) -> dict[str, dict[str, Any]]:
        return {stage: self.answer(stage) for stage in ("ingest", "identify")}


@dataclass(frozen=True, repr=False)
class ValveMap:
    """The valve map of one chamber: ``map`` and ``inverse`` are the artifacts, each a full grid.

    Gradients are those of the fixed vessel of the valve test at the stated supply pressure; for a chamber of volume V,
    multiply by (vessel's volume) / V. Interpolation is linear.
    """

    map: pd.DataFrame
    inverse: pd.DataFrame

    def __repr__(self) -> str:
        u, p, gradient = (self.map[name] for name in ("u", "p", "p_gradient"))
        return (
            f"ValveMap: {format_plain(u.min())} to {format_plain(u.max())} V ({u.nunique()} commands), "
            f"{format_quantity(p.min(), 'Pa', 3)} to {format_quantity(p.max(), 'Pa', 3)} ({p.nunique()} pressures), "
            f"dp/dt {format_quantity(gradient.min(), 'Pa/s', 3)} to {format_quantity(gradient.max(), 'Pa/s', 3)}; "
            "ask .dp_dt(u, p), .command(dp_dt, p), .reachable(dp_dt, p)"
        )

    def dp_dt(self, u: ArrayLike, p: ArrayLike) -> Array:
        """Return dp/dt in Pa/s at commands ``u`` (V, as they go to the valve) and pressures ``p`` (Pa, absolute).

        Both may be arrays of shapes that broadcast. Outside the map the result is NaN.
        """
        return _at(self._gradient, u, p)

    def command(self, dp_dt: ArrayLike, p: ArrayLike) -> Array:
        """Return the command in V for a gradient ``dp_dt`` (Pa/s) at pressures ``p`` (Pa, absolute).

        A gradient that the valve cannot reach gives the limit of the command, as in a controller. Outside the pressures
        of the map the result is NaN.
        """
        low, high = (float(self._command.grid[0][end]) for end in (0, -1))
        return _at(self._command, np.clip(np.asarray(dp_dt, dtype=np.float64), low, high), p)

    def reachable(self, dp_dt: ArrayLike, p: ArrayLike) -> NDArray[np.bool_]:
        """Return whether a recorded command reaches ``dp_dt`` (Pa/s) at ``p`` (Pa, absolute)."""
        return np.nan_to_num(_at(self._reached, dp_dt, p)) > 0.5

    @cached_property
    def _gradient(self) -> RegularGridInterpolator:
        return _grid(self.map, ("u", "p"), "p_gradient")

    @cached_property
    def _command(self) -> RegularGridInterpolator:
        return _grid(self.inverse, ("p_gradient", "p"), "u")

    @cached_property
    def _reached(self) -> RegularGridInterpolator:
        return _grid(self.inverse, ("p_gradient", "p"), "reachable")


def _grid(table: pd.DataFrame, over: tuple[str, str], name: str) -> RegularGridInterpolator:
    wide = table.pivot_table(index=over[0], columns=over[1], values=name)
    axes = (wide.index.to_numpy(dtype=np.float64), wide.columns.to_numpy(dtype=np.float64))
    return RegularGridInterpolator(axes, wide.to_numpy(dtype=np.float64), bounds_error=False)


def _at(grid: RegularGridInterpolator, first: ArrayLike, second: ArrayLike) -> Array:
    places = np.broadcast_arrays(np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64))
    return np.asarray(grid(np.stack(places, axis=-1)), dtype=np.float64).reshape(places[0].shape)


def read_frame(path: Path) -> pd.DataFrame:
    """Return an artifact; ``attrs`` holds ``units`` by column, ``schema``, ``version``, ``inputs``, ``parameters``.

    A column whose unit is ``"see column unit"`` has it row by row in the column ``unit``. Numbers are SI, pressures
    absolute, and NaN where nothing was measured. Raises InputError where there is no such artifact.
    """
    found = pd.DataFrame(read_table(path))
    found.attrs.update(read_metadata(path))
    return found


def select_rows(found: pd.DataFrame, equals: Mapping[str, object]) -> pd.DataFrame:
    """Return the rows in which columns have these values, numbered from 0, with the same ``attrs``."""
    mask = pd.Series(True, index=found.index)
    for column, value in equals.items():
        mask &= found[column] == value
    return found[mask].reset_index(drop=True)
