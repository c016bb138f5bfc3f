"""What the rig's logger writes: CSV in laboratory units, rounded as its display is."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pneucli.exam.rig.kernel import Array

# column, factor from SI, decimals
LAYOUT = {
    "u": ("U_valve [V]", 1.0, 4),
    "p_supply": ("P_supply [bar]", 1e-5, 5),
    "p1": ("P1 [bar]", 1e-5, 5),
    "p2": ("P2 [bar]", 1e-5, 5),
    "x": ("Pos [mm]", 1e3, 3),
    "a": ("Acc [m/s2]", 1.0, 4),
}


def write_csv(path: Path, rig: str, seen: dict[str, Array], signals: tuple[str, ...]) -> None:
    """Write the chosen signals (SI) at 1 kHz below a header of one line and two comments."""
    columns = [[f"{k}.0" for k in range(seen[signals[0]].size)]]
    for name in signals:
        _, factor, decimals = LAYOUT[name]
        columns.append([repr(value) for value in (np.round(seen[name] * factor, decimals) + 0.0).tolist()])
    header = ",".join(["t [ms]", *(LAYOUT[name][0] for name in signals)])
    lines = [f"# rig {rig}", f"# run {path.stem}", header, *map(",".join, zip(*columns, strict=True))]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
