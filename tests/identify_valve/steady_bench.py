"""A steady flow bench that knows ISO 6358 and nothing of the program: rows of flow, written as a laboratory does."""

import math
from pathlib import Path

import numpy as np

from pneucli.recording import Recording

DENSITY, TEMPERATURE, SUPPLY, AMBIENT = 1.185, 293.15, 7.013e5, 1.013e5


def mass_flow(c: float, b: float, m: float, p_up: float, p_down: float, opens: float = 0.0) -> float:
    """kg/s by ISO 6358-1, point by point."""
    ratio = p_down / p_up
    if p_up - p_down <= opens:
        return 0.0
    shape = 1.0 if ratio <= b else (1.0 - ((ratio - b) / (1.0 - opens / p_up - b)) ** 2) ** m
    return c * p_up * DENSITY * math.sqrt(TEMPERATURE / 293.15) * shape


def bench_rows(
    seed: int,
    conductances: dict[float, float],
    b: float = 0.3,
    m: float = 0.5,
    opens: float = 0.0,
    rows: int = 16,
    upstream_varied: bool = False,
) -> dict[str, np.ndarray]:
    """Rows at each command: 0.5 % of the reading, 0.1 % of full scale, 2 mbar."""
    rng = np.random.default_rng(seed)
    found: dict[str, list[float]] = {"u": [], "p_supply": [], "p1": [], "flow": []}
    for u, c in conductances.items():
        ups = np.linspace(1.05e5, SUPPLY, rows) if upstream_varied else np.full(rows, SUPPLY)
        downs = np.full(rows, AMBIENT) if upstream_varied else np.linspace(1.1e5, 6.98e5, rows)
        for p_up, p_down in zip(ups, downs, strict=True):
            q = mass_flow(c, b, m, p_up, p_down, opens)
            noise = 0.005 * q * rng.standard_normal() + 0.001 * c * SUPPLY * DENSITY * rng.standard_normal()
            found["u"].append(u)
            found["p_supply"].append(p_up + 200.0 * rng.standard_normal())
            found["p1"].append(p_down + 200.0 * rng.standard_normal())
            found["flow"].append(q + noise)
    return {name: np.array(values) for name, values in found.items()}


def as_recording(rows: dict[str, np.ndarray], name: str = "rows", use: str = "train") -> Recording:
    return Recording(name, "flow", use, np.arange(rows["flow"].size, dtype=float), rows)


def write_csv(path: Path, rows: dict[str, np.ndarray]) -> None:
    """Gauge pressures in bar, flow in l/min ANR, no clock."""
    lines = ["U [V];pu [bar];pd [bar];Q [l/min ANR]"]
    for u, p_up, p_down, q in zip(*(rows[n] for n in ("u", "p_supply", "p1", "flow")), strict=True):
        gauge = [(p - AMBIENT) / 1e5 for p in (p_up, p_down)]
        lines.append(f"{u:g};{gauge[0]:.5f};{gauge[1]:.5f};{q / DENSITY * 6e4:.4f}")
    path.write_text("\n".join(lines) + "\n")


PIPELINE = """
[pipeline]
name = "bench"
[rig]
ambient_pressure = "1.013 bar"
gas_temperature = "293.15 K"
[rig.vessel]
volume = "1 l"
[signals]
time = { column = "t", unit = "ms" }
u = { column = "U [V]", unit = "V" }
p_supply = { column = "pu [bar]", unit = "bar", reference = "gauge" }
p1 = { column = "pd [bar]", unit = "bar", reference = "gauge" }
flow = { column = "Q [l/min ANR]", unit = "l/min ANR" }
[[recordings]]
name = "rows"
file = "rows.csv"
experiment = "flow"
use = "train"
"""
