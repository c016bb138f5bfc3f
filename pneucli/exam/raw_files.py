"""Raw files as a laboratory's loggers write them: text with a line of names, units in brackets."""

from __future__ import annotations

import math
from itertools import zip_longest
from pathlib import Path

import numpy as np

from pneucli.exam.rig.kernel import Array

# column, factor from SI, decimals
CSV_COLUMNS = {
    "u": ("U_valve [V]", 1.0, 4),
    "u2": ("U_valve_2 [V]", 1.0, 4),
    "p_supply": ("P_supply [bar]", 1e-5, 5),
    "p1": ("P1 [bar]", 1e-5, 5),
    "p2": ("P2 [bar]", 1e-5, 5),
    "x": ("Pos [mm]", 1e3, 3),
    "a": ("Acc [m/s2]", 1.0, 4),
    "force": ("F [N]", 1.0, 4),
    "flow": ("Q [l/min ANR]", 60e3 / 1.185, 3),  # ISO 8778: 1.185 kg/m^3
}
TIME, COMMAND_TIME = "t [ms]", "t_cmd [ms]"


def write_csv(
    path: Path,
    rig: str,
    measured: dict[str, Array],
    signals: tuple[str, ...],
    position_step: float,
    commands: dict[str, Array] | None = None,
) -> None:
    """Write these signals (SI) with two comment lines and a header; positions are rounded to ``position_step`` (m).

    ``commands`` have a ``time`` (s) of their own and stand in columns of their own, which end early. Without a
    ``time`` in ``measured`` the rows have no clock.
    """
    columns: dict[str, list[str]] = {}
    if "time" in measured:
        columns[TIME] = _stamps(measured["time"])
    for name in signals:
        source = measured if commands is None or name not in commands else commands
        columns[CSV_COLUMNS[name][0]] = _values(name, source[name], position_step)
    if commands is not None:
        columns[COMMAND_TIME] = _stamps(commands["time"])
    rows = map(",".join, zip_longest(*columns.values(), fillvalue=""))
    lines = [f"# rig {rig}", f"# run {path.stem}", ",".join(columns), *rows]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _stamps(time: Array) -> list[str]:
    return [repr(value) for value in np.round(time * 1e3, 6).tolist()]


def _values(name: str, values: Array, position_step: float) -> list[str]:
    _, factor, decimals = CSV_COLUMNS[name]
    if name == "x":
        decimals = max(decimals, math.ceil(-math.log10(position_step * factor)))
    return [repr(value) for value in (np.round(values * factor, decimals) + 0.0).tolist()]
