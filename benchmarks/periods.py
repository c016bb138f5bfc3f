"""The controller at other sample times and on other rigs: ``python -m benchmarks.periods [demo | CONDITION ...]``.

Each rig is recorded and identified by the program's own commands; for each sample time a controller is designed from
that model and drives the rig, which shares no code with it. Figures as in ``benchmarks.learning``, and the margins of
the real cascade (least over all operating points). Then, at 1 ms: half the moving mass more and less than was designed
for, an encoder of 20 um, and a sine of 60 mm at 0.5 Hz (on a stroke of 200 mm; in proportion to it elsewhere), of which
the largest error once it is under way is told. ``SEED`` draws other rigs.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks import small
from benchmarks.laws import ASKED, laboratory_of
from benchmarks.learning import HEAD, design, figures, identified
from benchmarks.rigs import driven
from pneucli.closed_loop.margins import analyse_margins
from pneucli.closed_loop.simulation import ClosedLoopSetup
from pneucli.controller.parameters import Controller
from pneucli.exam.laboratory import Laboratory
from pneucli.exam.rig.parameters import Parameters
from pneucli.simulate.model import Model

Array = NDArray[np.float64]
PERIODS = (0.25e-3, 1e-3, 2e-3, 5e-3)  # s
COARSE = 20e-6  # m
SINE = 0.3  # of the stroke: 60 mm of 200 mm


def main_small() -> None:
    """Print the row of one sample time, and the sine, for the exact model."""
    laboratory = small.laboratory()
    controller, model, _ = small.design(laboratory)
    show("usual", "1 ms", laboratory, laboratory.parameters, model, 1e-3, laboratory.sensors.position_step)
    print(f"sine of 0.3 strokes: {wide_sine(laboratory.parameters, controller, laboratory):.3g} um")


def main(arguments: list[str]) -> None:
    """Print the rows of each rig."""
    seed = int(os.environ.get("SEED", "1"))
    print(f"| rig | what | {' | '.join(HEAD)} | gain margin | phase, deg | delay, ms |")
    print(f"|{' --- |' * (len(HEAD) + 5)}")
    if small.SMALL in arguments:
        main_small()
        return
    for name in arguments or ASKED:
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            laboratory = laboratory_of(name, folder, seed)
            model = identified(folder)
        par, x = laboratory.parameters, laboratory.sensors.position_step
        for period in PERIODS:
            show(name, f"{1e3 * period:g} ms", laboratory, par, model, period, x)
        for share in (0.5, 1.5):
            show(name, f"mass x {share:g}", laboratory, par._replace(mass=share * par.mass), model, 1e-3, x)
        show(name, "20 um", laboratory, par, model, 1e-3, COARSE)
        controller = design(model, par, 1e-3, x, laboratory.sensors.pressure)
        print(f"{name}, sine of 0.3 strokes at 0.5 Hz: largest {wide_sine(par, controller, laboratory):.3g} um")


def show(
    name: str, what: str, laboratory: Laboratory, par: Parameters, model: Model, period: float, quantum: float
) -> None:
    """Print a row: designed for the model, driven on ``par``."""
    noise = laboratory.sensors.pressure
    controller = design(model, laboratory.parameters, period, quantum, noise)
    found = figures(par, controller, quantum, noise)
    cuts = analyse_margins(
        model, controller, ClosedLoopSetup(quantum_x=quantum, noise_p=noise), corner_of(controller)
    ).cuts
    margins = [c.margins for c in cuts]
    least = [min((getattr(m, n) for m in margins), default=np.nan) for n in ("gain_up", "phase", "delay")]
    cells = [f"{value:.3g}" for value in (*found, least[0], np.degrees(least[1]), 1e3 * least[2])]
    print(f"| {name} | {what} | {' | '.join(cells)} |", flush=True)


def corner_of(controller: Controller) -> float:
    """Return the corner of the position loop in rad/s, from the integral gain that ``pneucli.design`` gives it."""
    return float(controller.values["C_KI"] ** (1.0 / 3.0))


def wide_sine(par: Parameters, controller: Controller, laboratory: Laboratory) -> float:
    """Return the largest error in um on the sine from its second second on."""
    time: Array = controller.period * np.arange(round(6.0 / controller.period), dtype=np.float64)
    reference = 0.5 * par.stroke + SINE * par.stroke * np.sin(np.pi * np.maximum(time - 0.5, 0.0))
    sensors = laboratory.sensors
    done = driven(par, controller, reference, np.zeros(time.size), sensors.pressure, sensors.position_step)
    return float(1e6 * np.abs(done.x - reference)[time > 2.0].max())


if __name__ == "__main__":
    main(sys.argv[1:])
