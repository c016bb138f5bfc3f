"""The designed controller on the identified axis: ``python -m benchmarks.closed_loop DIR [RUNS]``. Writes nothing.

DIR holds the artifacts of ``pneucli design pipelines/demo.toml --out DIR``; RUNS is the size of the Monte Carlo study
(default 1000). Prints figures beside the limits that the project has set itself; exit code 1 where one is not held.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import json
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import small
from benchmarks.thesis_laws import design_data
from pneucli import config
from pneucli.closed_loop import robustness
from pneucli.closed_loop.metrics import evaluate_run
from pneucli.closed_loop.scenarios import equilibrium_at
from pneucli.closed_loop.simulation import ClosedLoopSetup, Scenario, simulate
from pneucli.controller import layout
from pneucli.controller.parameters import Controller
from pneucli.design.control_laws import controller_for
from pneucli.executors import engine_from
from pneucli.physics.declaration import Effect
from pneucli.physics.effects import catalogue, select_effects
from pneucli.simulate.model import Model
from pneucli.simulate.rig_quantities import rig_quantities
from pneucli.stages.designed_controller import closed_loop_setup, load_controller
from pneucli.stages.model_file import load_model

PIPELINE = Path(__file__).parents[1] / "pipelines/demo.toml"
TIME = 1e-3 * np.arange(5000)
STEPS = np.where(TIME < 0.5, 0.1, np.where(TIME < 2.75, 0.13, 0.07))
REST = np.full(TIME.size, 0.1)
SINE = 0.1 + 0.03 * np.sin(2 * np.pi * 0.5 * np.maximum(TIME - 0.5, 0.0))
LOAD = -50.0 * ((TIME >= 1.0) & (TIME < 3.0))


def main(arguments: Sequence[str]) -> int:
    """Print every figure and its limit; return the exit code, which ``--small`` leaves at 0."""
    if small.SMALL in arguments:
        main_small()
        return 0
    folder = Path(arguments[0])
    runs = int(arguments[1]) if len(arguments) > 1 else 1000
    settings = config.load(PIPELINE)
    model = load_model(folder / "identify", settings.to_rig(), select_effects(settings.model.effects, catalogue()))
    controller, alone, relay = (load_controller(folder / "design", name) for name in ("best", "pid", "relay"))
    answer = json.loads((folder / "design" / "stage.json").read_text())["answer"]
    bench = closed_loop_setup(answer)
    held = figures(model, controller, alone, relay, bench)
    print("\nLMI, decay rate by weight type:")
    for t in answer["lmi"]["types"]:
        print(f"  {t['weight_type']:6s} {t['rate']} 1/s, {t['status']}, verified {t['verified']}")
    effects_table(model, controller, bench)
    held &= monte_carlo(model, controller, bench, runs)
    return int(not held)


def main_small() -> None:
    """Run the controllers of an exact model: one seed, one effect, two draws."""
    data = design_data(small.laboratory().parameters, ())
    controller, alone, relay = (controller_for(law, data) for law in ("best", "pid", "relay"))
    _, model, bench = small.design(small.laboratory())
    figures(model, controller, alone, relay, bench, seeds=1)
    effects_table(model, controller, bench, list(catalogue().values())[:1])
    monte_carlo(model, controller, bench, 2, threads=True)


def scene(c: Controller, reference: np.ndarray, force: np.ndarray | float = 0.0) -> Scenario:
    n = reference.size
    supply = np.full(n, c.values["C_SUPPLY"])
    start = equilibrium_at(c.values, float(reference[0]))
    return Scenario("benchmark", reference, np.broadcast_to(force, n).astype(float), supply, start)


def figures(
    model: Model,
    controller: Controller,
    alone: Controller,
    relay: Controller,
    bench: ClosedLoopSetup,
    seeds: int = 5,
) -> bool:
    """Print the figures of the identified axis, the worst of the seeds; return whether all limits hold."""

    def worst(name: str, reference: np.ndarray, force: np.ndarray | float = 0.0, c: Controller = controller) -> float:
        return max(
            getattr(evaluate_run(simulate(model, c, scene(c, reference, force), bench, s), model, c), name)
            for s in range(seeds)
        )

    sine, sine_alone = worst("tracking_rms_um", SINE), worst("tracking_rms_um", SINE, c=alone)
    chatter, chatter_relay = (chattering(model, c, bench) for c in (controller, relay))
    rows = [
        ("error at rest after steps, um", worst("steady_um", STEPS), 10.0),
        ("movement at rest (limit cycle), um", worst("cycle_um", STEPS), 10.0),
        ("sine 0.5 Hz, 30 mm, rms, over that of the PIDs alone", sine / sine_alone, 0.2),
        ("load of 50 N rejected to 50 um after, s", worst("recovery_s", REST, LOAD), 0.5),
        ("its estimate off by, of the load", worst("load_error", REST, LOAD), 0.1),
        ("mean change of u a sample, at rest, over the relay's", chatter / chatter_relay, 0.1),
    ]
    print(f"sine: {sine:.0f} um, PIDs {sine_alone:.0f} um; chattering {chatter:.3g} V, relay {chatter_relay:.3g} V")
    for name, value, limit in rows:
        print(f"{name:55s} {value:9.3g}  (limit {limit:g}) {'ok' if value <= limit else 'FAILED'}")
    return all(value <= limit for _, value, limit in rows)


def chattering(model: Model, controller: Controller, bench: ClosedLoopSetup) -> float:
    """Return the mean change of u from sample to sample over the last second at rest."""
    result = simulate(model, controller, scene(controller, STEPS), bench)
    return float(np.mean(np.abs(np.diff(result.log[-1000:, layout.L_U1]))))


def effects_table(
    model: Model, controller: Controller, bench: ClosedLoopSetup, effects: Sequence[Effect] | None = None
) -> None:
    """Print the figures of an axis with one more effect, at its smallest and largest typical size."""
    print("\nController designed without the effect; each figure at the effect's first / last typical size:")
    heads = ("steady um", "cycle um", "sine um", "recovery s", "estimate")
    print(f"{'effect':22s} " + " ".join(f"{head:>15s}" for head in heads))
    facts = rig_quantities(model)
    active = {e.name for e in model.effects}
    for effect in effects or catalogue().values():
        if effect.name in active:
            continue
        both = []
        for end in (0, -1):
            sizes = {f"{effect.name}.{p.name}": p.range_on(facts).typical[end] for p in effect.parameters}
            axis = replace(model, effects=(*model.effects, effect)).with_values(sizes)
            both.append(all_figures(axis, controller, bench))
        print(f"{effect.name:22s} " + " ".join(f"{a:>7.3g}/{b:<7.3g}" for a, b in zip(*both, strict=True)))


def all_figures(model: Model, c: Controller, bench: ClosedLoopSetup) -> list[float]:
    def of(reference: np.ndarray, force: np.ndarray | float = 0.0) -> dict[str, float]:
        return asdict(evaluate_run(simulate(model, c, scene(c, reference, force), bench), model, c))

    steps, sine, load = of(STEPS), of(SINE), of(REST, LOAD)
    return [
        steps["steady_um"],
        steps["cycle_um"],
        sine["tracking_rms_um"],
        load["recovery_s"],
        load["load_error"],
    ]


def monte_carlo(
    model: Model, controller: Controller, bench: ClosedLoopSetup, runs: int, *, threads: bool = False
) -> bool:
    """Time a study against single simulations and print its success rates; whether it takes minutes at most."""
    active = {e.name for e in model.effects}
    effects = tuple(e for e in catalogue().values() if e.name not in active)
    axes = robustness.AxisDistribution(model, {}, robustness.TOLERANCES, effects)
    scenarios = (scene(controller, STEPS),)
    study = robustness.MonteCarloStudy(axes, controller, scenarios, bench, runs, 0, robustness.DEFAULT_LIMITS)
    robustness.run_draw(study, 1)  # compiles
    with tempfile.TemporaryDirectory() as place, engine_from(None, threads=threads) as engine:
        start = time.perf_counter()
        rows: list[dict[str, Any]] = robustness.run_study(study, engine, Path(place))
        took = time.perf_counter() - start
    few = max(runs // 10, 1)
    start = time.perf_counter()
    for k in range(few):
        robustness.run_draw(study, k)
    single = (time.perf_counter() - start) * runs / few
    print(
        f"\n{runs} runs of 5 s at 1 kHz: {took:.1f} s; one after the other {single:.1f} s (ratio {took / single:.2f})"
    )
    for rate in robustness.success_rates(rows, robustness.DEFAULT_LIMITS):
        if rate.effect in ("all", ""):
            print(f"  {rate.check} <= {rate.limit:g}, {rate.effect or 'no effect'}: {rate.held} of {rate.runs}")
    return took <= 120.0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
