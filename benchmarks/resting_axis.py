"""A million rows of an axis whose encoder rests: ingest against pyarrow and polars.

``python -m benchmarks.resting_axis``. Each is timed in a process of its own, the better of two runs, with its peak
memory. pyarrow and polars read the text and write Parquet, and do nothing else.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
import polars

from benchmarks.ingest import measure, plain
from pneucli.config import load
from pneucli.pipeline.context import Context
from pneucli.stages import ingest

ROWS = 1_000_000
SMALL_ROWS = 20_000
COUNT_MM = 0.005  # of the encoder
PIPELINE = """
[pipeline]
name = "large"
[rig]
supply_pressure = "8 bar"
[rig.valve]
arrangement = "5/3"
[rig.cylinder]
piston_area_1 = "8 cm^2"
stroke = "200 mm"
[signals]
time = { column = "t [s]", unit = "s" }
u = { column = "U [V]", unit = "V" }
p1 = { column = "P1 [bar]", unit = "bar", reference = "gauge" }
p2 = { column = "P2 [bar]", unit = "bar", reference = "gauge" }
x = { column = "Pos [mm]", unit = "mm" }
[[recordings]]
name = "large"
file = "large.csv"
experiment = "axis"
use = "train"
chamber_2 = "valve"
"""


def make(path: Path, count: int) -> None:
    """Write an axis that travels to and fro at 0.2 Hz and rests a third of the time, 1 kHz."""
    rng = np.random.default_rng(0)
    t = np.arange(count) * 1e-3
    move = np.clip(1.6 * np.sin(2 * np.pi * t / 5), -1, 1)
    x = np.round((100 + 80 * move) / COUNT_MM) * COUNT_MM
    pressures = [4 + sign * move + 4e-3 * rng.standard_normal(count) for sign in (1, -1)]
    u = 3 * np.cos(2 * np.pi * t / 5)
    with path.open("w") as file:
        file.write("t [s],U [V],P1 [bar],P2 [bar],Pos [mm]\n")
        rows = zip(t, u, *pressures, x, strict=True)
        file.writelines(f"{a:.3f},{b:.2f},{c:.4f},{d:.4f},{e:.3f}\n" for a, b, c, d, e in rows)


def with_polars(folder: Path) -> None:
    """Let polars read and write the file and do nothing else."""
    polars.read_csv(folder / "large.csv").write_parquet(folder / "polars.parquet", compression="zstd")


def ours(folder: Path) -> None:
    """Ingest the file."""
    path = folder / "large.toml"
    ingest.run(Context(path, load(path), folder / "out", folder))


def main(arguments: list[str]) -> None:
    """Print times, ratios and peak memory."""
    is_small = "--small" in arguments
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make(folder / "large.csv", SMALL_ROWS if is_small else ROWS)
        (folder / "large.toml").write_text(PIPELINE)
        (folder / "out").mkdir()
        works = {"pyarrow": plain, "polars": with_polars, "ingest": ours}
        runs = [
            {label: measure(work, folder, apart=not is_small) for label, work in works.items()}
            for _ in range(1 if is_small else 2)
        ]
    for label in works:
        seconds, memory = (min(run[label][part] for run in runs) for part in (0, 1))
        ratio = seconds / min(run["pyarrow"][0] for run in runs)
        print(f"{label:8} {seconds:6.2f} s, {ratio:5.2f} x pyarrow, {memory:6.0f} MB")


if __name__ == "__main__":
    main(sys.argv[1:])
