"""Read artifacts as pandas DataFrames with the metadata of the file in ``attrs``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from pneucli.io.artifacts import read_metadata, read_table

if TYPE_CHECKING:
    from collections.abc import Mapping


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
