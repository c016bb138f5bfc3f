"""Kill a run at every one of its operations on files, one after the other, and hold what it leaves against the rules.

A script, since it forks, and a test process has threads: ``python -m tests.pipeline.killed FOLDER``.
"""

import os
import signal
import sys
from pathlib import Path

from tests.pipeline import toys
from tests.pipeline.toys import generations, is_whole, new, toy

EVENTS = {"open", "os.rename", "os.mkdir", "os.rmdir", "os.remove", "os.truncate", "shutil.rmtree"}


def kill_at(operation: int, artifacts: Path) -> None:
    """From now on this process is killed (-9) just before its ``operation``-th operation below ``artifacts``."""
    left = operation

    def hook(event: str, arguments: tuple[object, ...]) -> None:
        nonlocal left
        if event in EVENTS and str(artifacts) in str(arguments[0]):
            left -= 1
            if left == 0:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(hook)


def survives(file: Path, operation: int) -> bool:
    """Run the pipeline in a child that is killed at that operation; return whether it came to its end."""
    child = os.fork()
    if child == 0:
        pipeline = toy(file)
        kill_at(operation, pipeline.artifacts)
        pipeline.update(["model"])
        os._exit(0)
    return os.waitpid(child, 0)[1] == 0


def main(folder: Path) -> int:
    """Return at how many operations the run was killed; asserts the rules after each."""
    toys.PACE = 0.0
    file = new(folder)
    toy(file).update(["model"])
    artifacts, raw = toy(file).artifacts, file.parent / "raw" / "a.csv"
    operation = 0
    while True:
        operation += 1
        raw.write_text(f"{operation:03}")  # both stages are stale, of a new generation
        survived = survives(file, operation)
        for name in ("raw", "model"):
            there = artifacts / name if (artifacts / name).exists() else artifacts / f".{name}.old"
            assert is_whole(there), f"{there} is half-written after a kill at operation {operation}"
        assert generations({n: d for n, d in toy(file).update(["model"]).items() if n != "plan"}) == {
            f"{operation:03}0"
        }, "the next run did not continue"
        assert not list(artifacts.glob(".*.new")) + list(artifacts.glob(".*.old")), "leftovers"
        if survived:
            return operation - 1


if __name__ == "__main__":
    print(main(Path(sys.argv[1]).resolve()))
