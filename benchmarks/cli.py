"""How long the program takes to say `--help`, and to find that a run has nothing to do.

`python -m benchmarks.cli [PIPELINE]`: without a pipeline only the help is timed. Prints the median and the best of N
fresh processes; the pipeline is brought up to date first, in its usual artifacts folder.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import time

TIMES = 9


def seconds(*words: str) -> float:
    """Wall time of one fresh process of the program."""
    start = time.perf_counter()
    subprocess.run([sys.executable, "-m", "pneucli", *words], capture_output=True, check=False)
    return time.perf_counter() - start


def row(title: str, *words: str) -> str:
    """One line of the result: title, median and best in ms."""
    times = [1000 * seconds(*words) for _ in range(TIMES)]
    return f"{title:32} {statistics.median(times):6.0f} ms median {min(times):6.0f} ms best of {TIMES}"


def main(pipelines: list[str]) -> None:
    """Print the table."""
    print(row("pneucli --help", "--help"))
    print(row("pneucli run --help", "run", "--help"))
    for pipeline in pipelines:
        seconds("run", pipeline)
        print(row(f"pneucli run {pipeline}", "run", pipeline))


if __name__ == "__main__":
    main(sys.argv[1:])
