"""Every law's exported C on the exam's rig: ``python -m benchmarks.laws [demo | CONDITION ...]``. Needs gcc.

Each rig is recorded, identified, designed for and driven; rig and model share no code. All errors in um; ``at rest``
and ``moves`` are the worst half second before a change, over steps of 15 % of the stroke and a load of a tenth of the
supply's force. ``load`` is the time after which that load is rejected to 50 um, ``fast`` the command's rms above 50 Hz
over all of it, ``C`` the largest difference of the C's command from the simulated one over a minute.
"""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from types import ModuleType

import numpy as np
from scipy.signal import welch

from benchmarks import small
from benchmarks.exam_loop import LOAD, SETTLED, TIME, Array, Exported, Trace, designed, driven
from pneucli.controller.laws import LAWS
from pneucli.exam.cases import generate_case, prepare_case
from pneucli.exam.conditions import parse
from pneucli.exam.laboratory import Laboratory

ASKED = ("demo", "bore-12mm", "bore-25mm", "bore-50mm", "bore-100mm")
FIXTURES = Path(__file__).parents[1] / "fixtures"
HEAD = ("rig", "law", "at rest", "moves", "sine, rms", "load, s", "at rest under it", "fast, V", "air, g", "C, V")
BACK = 50.0  # um


def laboratory_of(name: str, folder: Path, seed: int) -> Laboratory:
    """Record a rig into ``folder``, which then holds ``pipeline.toml``."""
    if name == "demo":
        shutil.copytree(FIXTURES / "demo", folder, dirs_exist_ok=True)
        shutil.copy(folder / "complete.toml", folder / "pipeline.toml")
        return next(f.laboratory for f in _make().fixtures() if f.laboratory.name == "demo")
    generate_case(folder, "axis", (), "", 1.0, seed, parse(name))
    return prepare_case("rig", "axis", (), "", 1.0, seed, parse(name)).laboratory


def _make() -> ModuleType:
    spec = importlib.util.spec_from_file_location("fixtures_make", FIXTURES / "make.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["fixtures_make"] = module
    spec.loader.exec_module(module)
    return module


def figures(laboratory: Laboratory, control: Path) -> list[float]:
    """Return the figures of one exported law on the rig."""
    par, middle = laboratory.parameters, 0.5 * laboratory.parameters.stroke
    steps = middle + par.stroke * np.where(TIME < 0.5, 0.0, np.where(TIME < 3.0, 0.15, -0.15))
    sine = middle + 0.15 * par.stroke * np.sin(np.pi * np.maximum(TIME - 0.5, 0.0))
    pushed = LOAD * (par.supply - par.ambient) * par.piston_area_1 * ((TIME >= 1.5) & (TIME < 4.0))
    nothing, still = np.zeros(TIME.size), np.full(TIME.size, middle)

    def runs(reference: Array, load: Array) -> tuple[Trace, Array]:
        done = driven(par, laboratory.sensors, Exported(control), reference, load, False)
        return done, 1e6 * (done.x - reference)

    (stepped, e_steps), (followed, e_sine), (loaded, e_load) = (
        runs(r, f) for r, f in ((steps, nothing), (sine, nothing), (still, pushed))
    )
    ends = [e_steps[3000 - SETTLED : 3000], e_steps[-SETTLED:]]
    under = e_load[4000 - SETTLED : 4000]
    back = [_back(e_load[1500:4000]), _back(e_load[4000:])]
    traces = (stepped, followed, loaded)
    return [
        max(float(np.abs(e).max()) for e in ends),
        max(float(np.ptp(e)) for e in [*ends, under]),
        float(np.sqrt(np.mean(e_sine[1500:] ** 2))),
        max(back),
        float(np.abs(under).max()),
        float(np.sqrt(np.mean([_fast(t.u) ** 2 for t in traces]))),
        1e3 * sum(t.air for t in traces),
    ]


def _back(error: Array) -> float:
    """Return the time in s after which an error stays within 50 um."""
    off = np.flatnonzero(np.abs(error) > BACK)
    return 0.0 if not off.size else float("inf") if off[-1] == error.size - 1 else 1e-3 * float(off[-1] + 1)


def _fast(u: Array) -> float:
    """Return the rms above 50 Hz in V."""
    frequency, power = welch(u, 1000.0, nperseg=1024)
    return float(np.sqrt(np.sum(power[frequency > 50.0]) * frequency[1]))


def difference(folder: Path) -> float:
    """Return by how much the C's command differs from the simulated one, in V."""
    program = folder / "replay"
    sources = [folder / "pneucli_replay.c", folder / "pneucli_controller.c"]
    subprocess.run(["gcc", "-std=c11", "-O2", *sources, "-lm", "-o", program], check=True)
    replayed = subprocess.run([program, folder / "pneucli_replay.csv"], check=False, capture_output=True, text=True)
    return float(replayed.stdout.split()[1])


def poles(out: Path) -> None:
    """Print the eigenvalues of every vertex loop of the PDC, the slowest of each."""
    answer = json.loads((out / "design" / "stage.json").read_text())["answer"]
    loops = answer["lmi"].get("vertex_loops", [])
    shown = "; ".join(", ".join(f"{re:.3g}{im:+.3g}j" for re, im in loop) for loop in loops)
    print(f"  PDC, weights {answer['lmi']['best']}, 1/s: {shown}", flush=True)


def main_small() -> None:
    """Print the row of the default law, designed for the exact model."""
    rig = small.laboratory()
    with tempfile.TemporaryDirectory() as place:
        control = small.exported(Path(place), rig, replay=True)
        shown = [f"{value:.3g}" for value in [*figures(rig, control), difference(control)]]
    print(f"| usual | `best` | {' | '.join(shown)} |")


def main(arguments: list[str]) -> None:
    """Print a row for each rig and control law."""
    seed = int(os.environ.get("SEED", "1"))
    print(f"| {' | '.join(HEAD)} |\n|{' --- |' * len(HEAD)}")
    if small.SMALL in arguments:
        main_small()
        return
    for name in arguments or ASKED:
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            laboratory = laboratory_of(name, folder, seed)
            try:
                designed(folder, ["design"])
            except RuntimeError as error:
                print(f"| {name} | {str(error)[:200]} |", flush=True)
                continue
            for law in LAWS:
                try:
                    control = designed(folder, ["export", "--to", "c", "--controller", law])
                except RuntimeError as error:
                    print(f"| {name} | {law} | {str(error).splitlines()[0][:160]} |", flush=True)
                    continue
                control = Path(shutil.copytree(control, folder / law))  # what is compiled is no part of the export
                shown = [f"{value:.3g}" for value in [*figures(laboratory, control), difference(control)]]
                print(f"| {name} | `{law}` | {' | '.join(shown)} |", flush=True)
            poles(folder / "out")


if __name__ == "__main__":
    main(sys.argv[1:])
