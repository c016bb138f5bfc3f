"""1 GB of CSV to Parquet: time relative to pyarrow, and peak memory: ``python -m benchmarks.ingest [GB]``."""

from __future__ import annotations

import multiprocessing
import resource
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow.csv as pcsv
import pyarrow.parquet as pq

from pneucli.config import load
from pneucli.pipeline.context import Context
from pneucli.stages import ingest

PIPELINE = """
[pipeline]
name = "large"
[signals]
time     = { column = "t [ms]", unit = "ms" }
u        = { column = "U [V]", unit = "V" }
p_supply = { column = "PS [bar]", unit = "bar", reference = "gauge" }
p1       = { column = "P1 [bar]", unit = "bar", reference = "gauge" }
p2       = { column = "P2 [bar]", unit = "bar", reference = "gauge" }
x        = { column = "Pos [mm]", unit = "mm" }
a        = { column = "Acc [m/s2]", unit = "m/s^2" }
[[recordings]]
name = "large"
file = "large.csv"
experiment = "axis"
use = "train"
chamber_2 = "closed"
"""
HEADER = "t [ms],U [V],PS [bar],P1 [bar],P2 [bar],Pos [mm],Acc [m/s2]\n"
ROWS = 200_000
SMALL_BYTES, SMALL_ROWS = 1e6, 20_000  # one block


def make(path: Path, size: float, block: int = ROWS) -> None:
    """Write seeded rows of an axis at 1 kHz, in blocks of so many, until ``path`` holds ``size`` bytes."""
    rng = np.random.default_rng(0)
    with path.open("w") as file:
        file.write(HEADER)
        start = 0
        while file.tell() < size:
            t = np.arange(start, start + block)
            noise = rng.standard_normal((4, block))
            columns = (
                t,
                np.repeat(rng.integers(-10, 11, block // 100), 100),
                6.7 + 0.002 * noise[0],
                3 + np.sin(t / 500) + 0.002 * noise[1],
                2 + np.cos(t / 400) + 0.002 * noise[2],
                100 + 50 * np.sin(t / 700),
                0.05 * noise[3],
            )
            row = "%.1f,%.1f,%.5f,%.5f,%.5f,%.3f,%.4f\n"
            file.writelines(row % values for values in zip(*columns, strict=True))
            start += block


def plain(folder: Path) -> None:
    """Let pyarrow read and write the file and do nothing else."""
    with (
        pcsv.open_csv(folder / "large.csv") as reader,
        pq.ParquetWriter(
            folder / "plain.parquet",
            reader.schema,
            compression="zstd",
            use_dictionary=False,
            use_byte_stream_split=True,
        ) as writer,
    ):
        for batch in reader:
            writer.write_batch(batch)


def ours(folder: Path) -> None:
    """Ingest the file."""
    path = folder / "large.toml"
    ingest.run(Context(path, load(path), folder / "out", folder))


def measure(work: Callable[[Path], None], folder: Path, *, apart: bool = True) -> tuple[float, float]:
    """Return seconds and peak memory in MB of ``work``, in a process of its own unless it is not to be ``apart``."""
    if not apart:
        return _measured(work, folder)
    context = multiprocessing.get_context("spawn")
    queue = context.Queue()
    process = context.Process(target=_tell, args=(work, folder, queue))
    process.start()
    result: tuple[float, float] = queue.get()
    process.join()
    return result


def _tell(work: Callable[[Path], None], folder: Path, queue: multiprocessing.Queue[tuple[float, float]]) -> None:
    queue.put(_measured(work, folder))


def _measured(work: Callable[[Path], None], folder: Path) -> tuple[float, float]:
    start = time.perf_counter()
    work(folder)
    return time.perf_counter() - start, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main(arguments: list[str]) -> None:
    """Print both times (the better of two runs), their ratio, and the peak memory."""
    is_small = "--small" in arguments
    size = SMALL_BYTES if is_small else 1e9 * float(arguments[0] if arguments else 1)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make(folder / "large.csv", size, SMALL_ROWS if is_small else ROWS)
        (folder / "large.toml").write_text(PIPELINE)
        (folder / "out").mkdir()
        works = (plain, ours)
        runs = [[measure(work, folder, apart=not is_small) for work in works] for _ in range(1 if is_small else 2)]
    base, own = (min(run[k][0] for run in runs) for k in (0, 1))
    memory = max(run[1][1] for run in runs)
    print(f"pyarrow {base:.1f} s, ingest {own:.1f} s, ratio {own / base:.2f}, peak memory of ingest {memory:.0f} MB")


if __name__ == "__main__":
    main(sys.argv[1:])
