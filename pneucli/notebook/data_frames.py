"""Read artifacts as pandas DataFrames with the metadata of the file in ``attrs``; interpolate the valve map."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import RegularGridInterpolator

from pneucli.arrays import Array
from pneucli.io.artifacts import read_metadata, read_table
from pneucli.messages.formatting import format_plain, format_quantity

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd


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
