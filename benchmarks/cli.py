"""How long the program takes to say `--help`, and to find that a run has nothing to do.

`python -m benchmarks.cli [PIPELINE]`: without a pipeline only the help is timed. Prints the median and the best of N
fresh processes; the pipeline is brought up to date first, in its usual artifacts folder.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import time

from benchmarks.measure import environment

TIMES = 9
SMALL = "--small"


def seconds(*words: str) -> float:
    """Wall time of one fresh process of the program."""
    variables, start = environment(), time.perf_counter()
    subprocess.run([sys.executable, "-m", "pneucli", *words], capture_output=True, check=False, env=variables)
    return time.perf_counter() - start


def row(title: str, *words: str, times: int = TIMES) -> str:
    """One line of the result: title, median and best in ms."""
    taken = [1000 * seconds(*words) for _ in range(times)]
    return f"{title:32} {statistics.median(taken):6.0f} ms median {min(taken):6.0f} ms best of {times}"


def main(arguments: list[str]) -> None:
    """Print the table."""
    if SMALL in arguments:
        print(row("pneucli --help", "--help", times=1))
        return
    print(row("pneucli --help", "--help"))
    print(row("pneucli run --help", "run", "--help"))
    for pipeline in arguments:
        seconds("run", pipeline)
        print(row(f"pneucli run {pipeline}", "run", pipeline))
        print(row(f"pneucli status {pipeline}", "status", pipeline))


if __name__ == "__main__":
    main(sys.argv[1:])
