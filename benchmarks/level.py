"""The pressure level on the exam's rig with two valves: ``python -m benchmarks.level [SEED ...]``. Needs gcc.

A healthy rig is recorded and identified, its controller exported once. The C then holds the piston at three levels, set
while it runs, against a load of a tenth of the supply's force that jumps on. Printed: the mean pressure that is kept,
the stiffness of the gas that follows from it, the largest deviation, the error at rest before and under the load, and
the air that is drawn, all in 6 s.
"""

from __future__ import annotations

import ctypes
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks import small
from benchmarks.exam_loop import LOAD, SETTLED, TIME, Exported, designed, driven
from pneucli.controller.parameters import Controller
from pneucli.design.air_spring import stiffness_per_pressure
from pneucli.exam.cases import generate_case, prepare_case
from pneucli.exam.conditions import parse
from pneucli.exam.laboratory import Laboratory

SHARES = (0.25, 0.5, 0.75)  # of the way from ambient to supply pressure
FROM, TO = 3.0, 6.0  # s, of the load


class Levelled(Exported):
    """An exported controller that keeps a pressure level in Pa."""

    def __init__(self, folder: Path, level: float) -> None:
        super().__init__(folder)
        set_level = self._library.pneucli_controller_set_level
        set_level.argtypes = [ctypes.c_void_p, ctypes.c_double]
        set_level(self._state, level)


def main(arguments: list[str]) -> None:
    """Print a row for each rig and pressure level."""
    print("| rig | level asked, bar | kept, bar | gas, N/mm | deviation, um | at rest, um | under load, um | air, g |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    conditions = parse("two-valves")
    is_small = small.SMALL in arguments
    for seed in [1] if is_small else [int(a) for a in arguments] or [1]:
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            laboratory = prepare_case("rig", "axis", (), "", 1.0, seed, conditions).laboratory
            if is_small:
                small.exported(folder / "out", laboratory)
            else:
                generate_case(folder, "axis", (), "", 1.0, seed, conditions)
                designed(folder)
            for share in SHARES[:1] if is_small else SHARES:
                row(seed, laboratory, folder / "out", share)


def row(seed: int, laboratory: Laboratory, out: Path, share: float) -> None:
    """Print the row of one pressure level."""
    par = laboratory.parameters
    values = Controller.from_json((out / small.CONTROLLERS / "best.json").read_text()).values
    still = np.full(TIME.size, 0.5 * par.stroke)
    push = LOAD * (par.supply - par.ambient) * par.piston_area_1 * (TIME >= FROM)
    level = par.ambient + share * (par.supply - par.ambient)
    trace = driven(par, laboratory.sensors, Levelled(out / "export", level), still, push, False)
    error, on = 1e6 * (trace.x - still), round(FROM / TIME[1])
    p1, p2 = trace.read[on - SETTLED : on, 1:].mean(axis=0)
    one, two = stiffness_per_pressure(values, np.array(0.5 * par.stroke))
    found = (
        1e-5 * level, 5e-6 * (p1 + p2), 1e-3 * (one * p1 + two * p2), np.abs(error[on:]).max(),
        np.abs(error[on - SETTLED : on]).max(), np.abs(error[-SETTLED:]).max(), 1e3 * trace.air,
    )  # fmt: skip
    print(f"| {seed} | {' | '.join(f'{value:.3g}' for value in found)} |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
