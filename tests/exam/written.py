"""What the recordings of a case hold."""

from pathlib import Path

import numpy as np
import pandas as pd

HEADER = 2  # lines before that of the names


def columns(path: Path) -> dict[str, np.ndarray]:
    """Each column by its name, with low lines in place of spaces; where a column ends early, NaN."""
    table = pd.read_csv(path, skiprows=HEADER)
    return {name.replace(" ", "_"): table[name].to_numpy() for name in table}


def rows(path: Path) -> np.ndarray:
    """All columns."""
    return np.loadtxt(path, delimiter=",", skiprows=HEADER + 1)
