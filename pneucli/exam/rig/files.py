"""What the rig's logger writes: CSV in laboratory units, rounded as its display is."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from pneucli.exam.rig.kernel import Array

# column, factor from SI, decimals
LAYOUT = {
    "u": ("U_valve [V]", 1.0, 4),
    "u2": ("U_valve_2 [V]", 1.0, 4),
    "p_supply": ("P_supply [bar]", 1e-5, 5),
    "p1": ("P1 [bar]", 1e-5, 5),
    "p2": ("P2 [bar]", 1e-5, 5),
    "x": ("Pos [mm]", 1e3, 3),
    "a": ("Acc [m/s2]", 1.0, 4),
    "force": ("F [N]", 1.0, 4),
}


def write_csv(path: Path, rig: str, seen: dict[str, Array], signals: tuple[str, ...], position_step: float) -> None:
    """Write the chosen signals (SI) below a header of one line and two comments; positions to ``position_step`` (m)."""
    columns = [[repr(value) for value in np.round(seen["time"] * 1e3, 6).tolist()]]
    for name in signals:
        _, factor, decimals = LAYOUT[name]
        if name == "x":
            decimals = max(decimals, math.ceil(-math.log10(position_step * factor)))
        columns.append([repr(value) for value in (np.round(seen[name] * factor, decimals) + 0.0).tolist()])
    header = ",".join(["t [ms]", *(LAYOUT[name][0] for name in signals)])
    lines = [f"# rig {rig}", f"# run {path.stem}", header, *map(",".join, zip(*columns, strict=True))]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
