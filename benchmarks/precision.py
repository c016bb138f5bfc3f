"""What single precision costs in the loop: ``python -m benchmarks.precision [demo | CONDITION ...]``. Needs gcc.

Each rig is recorded, identified and designed for; its controller is exported in double and in float, and both drive the
rig. In um: the largest error at rest after steps, rms on a sine, the largest at rest under a load.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

from benchmarks import small
from benchmarks.exam_loop import designed, figures
from benchmarks.laws import ASKED, laboratory_of

PRECISIONS = ("float64", "float32")


def main(arguments: list[str]) -> None:
    """Print a row for each rig."""
    print("| rig | at rest: double / float | sine, rms | at rest under a load |\n| --- | --- | --- | --- |")
    is_small = small.SMALL in arguments
    for name in ("usual",) if is_small else arguments or ASKED:
        with tempfile.TemporaryDirectory() as place:
            folder, found = Path(place), []
            laboratory = small.laboratory() if is_small else laboratory_of(name, folder, 1)
            for precision in PRECISIONS:
                if is_small:
                    control = small.exported(folder / "out", laboratory, precision)
                else:
                    control = designed(folder, ["export", "--to", "c", "--precision", precision])
                control = Path(shutil.copytree(control, folder / precision))
                found.append(figures(laboratory.parameters, laboratory.sensors, control, False))
        shown = [" / ".join(f"{value:.3g}" for value in pair) for pair in zip(*found, strict=True)]
        print(f"| {name} | {' | '.join(shown)} |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
