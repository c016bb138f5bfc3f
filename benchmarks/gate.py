"""What the gate of ``design`` stops, against what the exported C does on the exam's rig: ``python -m benchmarks.gate``.

Each rig is recorded, identified and designed for by the program's own commands; then the exported C drives the rig, or
one that differs from it. Models that are good (nothing hidden, or what was hidden is known), and models with one thing
wrong: an effect left out, a friction far off, a payload of half the mass more or less that came later, a sample time of
5 ms. A rig holds where it keeps what the gate asks: rest within the tolerance, without a cycle, after steps and under
a load, three times with other noise. ``SEEDS`` rigs from ``FIRST`` on (default 3 from 1). Needs gcc.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit

from benchmarks import small
from benchmarks.exam_loop import Exported, driven
from pneucli.closed_loop.acceptance import ACCEPTANCE_SCENARIOS, acceptance_criteria
from pneucli.closed_loop.metrics import evaluate_run
from pneucli.closed_loop.scenarios import read_scenarios
from pneucli.closed_loop.simulation import Run, Scenario
from pneucli.controller import layout
from pneucli.controller.parameters import Controller
from pneucli.design.requirements import Requirements
from pneucli.exam.cases import generate_case, prepare_case
from pneucli.exam.conditions import Conditions
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.sensors import Sensors
from pneucli.recording import Rig
from pneucli.simulate import layout as at
from pneucli.simulate.model import Model

CONDITIONS = Conditions()
EFFECTS = ("valve-lag", "presliding", "stribeck", "piston-leak", "pressure-friction", "constant-force")
NOISES = 3  # runs of a scenario on the rig, each with its own noise
SLOW = {"period": "5 ms"}
FAR = {"friction.coulomb": {"fixed": "80 N"}}


@dataclass(frozen=True)
class Variant:
    """How a model comes about: hidden effect, known effects, tables of the pipeline file, and the payload that came."""

    title: str
    hidden: tuple[str, ...] = ()
    known: tuple[str, ...] = ()
    design: tuple[tuple[str, str], ...] = ()
    fixed: bool = False
    payload: float = 0.0


def variants() -> list[Variant]:
    good = [Variant("good"), *(Variant("good", (e,), (e,)) for e in EFFECTS)]
    left = [Variant("effect left out", (e,)) for e in EFFECTS]
    rest = [
        Variant("far from its data", fixed=True),
        Variant("payload +50 %", payload=0.5),
        Variant("payload -50 %", payload=-0.5),
        Variant("5 ms", design=tuple(SLOW.items())),
    ]
    return [*good, *left, *rest]


def main_small() -> None:
    """Print whether the C of a controller for the exact model holds the rig."""
    rig = small.laboratory()
    wanted = Requirements(quantum_x=rig.sensors.position_step, noise_p=rig.sensors.pressure)
    with tempfile.TemporaryDirectory() as place:
        small.exported(Path(place), rig)
        held, found = on_the_rig(Path(place), rig.parameters, rig.sensors, wanted, noises=1)
    print(f"| exact model | {'holds' if held else 'fails'} | {' | '.join(f'{value:.3g}' for value in found)} |")


def main(arguments: list[str]) -> None:
    """Print a row for each model, then the counts by kind of model."""
    if small.SMALL in arguments:
        main_small()
        return
    counts: Counter[tuple[str, bool, bool]] = Counter()
    print("| model | hidden | rig | gate | model's error | on the rig | at rest, um | moves, um |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    first = int(os.environ.get("FIRST", "1"))
    for seed in range(first, first + int(os.environ.get("SEEDS", "3"))):
        for variant in variants():
            try:
                stopped, error, held, found = judged(variant, seed)
            except RuntimeError as failure:
                print(f"| {variant.title} | {', '.join(variant.hidden)} | {seed} | {str(failure)[:200]} |", flush=True)
                continue
            counts[variant.title, stopped, held] += 1
            cells = (", ".join(variant.hidden), seed, "stops" if stopped else "passes", f"{error:.3g}")
            figures = " | ".join(f"{value:.3g}" for value in found)
            print(
                f"| {variant.title} | {' | '.join(map(str, cells))} | {'holds' if held else 'fails'} | {figures} |",
                flush=True,
            )
    print("\n| model | stops what fails | stops what holds | passes what holds | passes what fails |")
    print("| --- | --- | --- | --- | --- |")
    for title in dict.fromkeys(v.title for v in variants()):
        four = [counts[title, s, h] for s, h in ((True, False), (True, True), (False, True), (False, False))]
        print(f"| {title} | {' | '.join(map(str, four))} |")


def judged(variant: Variant, seed: int) -> tuple[bool, float, bool, tuple[float, float]]:
    """Return whether the gate stops a design, the model's error over its noise, whether the rig holds, and figures."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        generate_case(folder, "axis", variant.hidden, "", 1.0, seed, CONDITIONS)
        case = prepare_case("rig", "axis", variant.hidden, "", 1.0, seed, CONDITIONS)
        change(folder / "pipeline.toml", variant)
        answer = told(folder, "design", "--compare", "best")
        told(folder, "export", "--to", "c")
        par = case.laboratory.parameters
        par = par._replace(mass=par.mass * (1.0 + variant.payload))
        gate, wanted = answer["gate"], Requirements(**answer["requirements"])
        held, found = on_the_rig(folder / "out", par, case.laboratory.sensors, wanted)
        return not gate["passed"], gate["model_error"], held, found


def change(path: Path, variant: Variant) -> None:
    """Write what the variant says into its pipeline file."""
    document: Any = tomlkit.parse(path.read_text())
    model = document.setdefault("model", tomlkit.table())
    model["effects"] = sorted({*model.get("effects", []), *variant.known})
    if variant.fixed:
        model["parameters"] = FAR
    if variant.design:
        document["design"] = dict(variant.design)
    path.write_text(tomlkit.dumps(document))


def told(folder: Path, *command: str) -> dict[str, Any]:
    """Return the answer of a command to the folder's pipeline."""
    asked = [sys.executable, "-m", "pneucli", command[0], "pipeline.toml", *command[1:], "--out", "out", "--json"]
    root = os.environ | {"PYTHONPATH": str(Path(__file__).parents[1])}
    done = subprocess.run([*asked, "--quiet"], cwd=folder, capture_output=True, text=True, check=False, env=root)
    if done.returncode > 1:
        raise RuntimeError(done.stderr.strip().replace("\n", " "))
    return dict(json.loads(done.stdout))


def on_the_rig(
    out: Path, par: Parameters, sensors: Sensors, wanted: Requirements, noises: int = NOISES
) -> tuple[bool, tuple[float, float]]:
    """Return whether the exported C keeps what the gate asks on the rig, the error at rest and the cycle in um."""
    text = (out / "design" / "controllers" / f"{wanted.controller}.json").read_text()
    controller = Controller.from_json(text)
    found = []
    for scenario in read_scenarios([], controller, ""):
        if scenario.name in ACCEPTANCE_SCENARIOS:
            for seed in range(noises):
                control = Exported(out / "export")
                asked = (scenario.reference, -scenario.force, False, controller.period, seed)
                trace = driven(par, sensors, control, *asked)
                with np.errstate(invalid="ignore"):
                    found.append(evaluate_run(as_run(scenario, controller, trace.x, trace.u), MODEL, controller))
    missed = [d.is_violated(d.figure(m)) for d in acceptance_criteria(wanted, controller) for m in found]
    at_rest, cycle = (np.nanmax([getattr(m, n) for m in found]) for n in ("steady_um", "cycle_um"))
    return not any(missed), (float(at_rest), float(cycle))


MODEL = Model(Rig(gas_temperature=293.15, ambient_pressure=1.013e5))  # of which the figures of air are told, not used


def as_run(scenario: Scenario, controller: Controller, x: np.ndarray, u: np.ndarray) -> Run:
    """Return what the rig did in the form of a simulated run."""
    out, rows = np.full((x.size, at.OUTPUTS), np.nan), np.zeros((x.size, layout.L_ROW))
    out[:, at.X], rows[:, layout.L_U1] = x, u
    return Run(scenario, controller.period * np.arange(x.size), out, rows)


if __name__ == "__main__":
    main(sys.argv[1:])
