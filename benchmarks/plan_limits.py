"""Does a plan ever exceed a limit? ``python -m benchmarks.plan_limits [PLANS] [SEED]``.

Plays manoeuvres that the check of the planner allows on rigs of the exam whose parameters are off by their intervals,
and counts exceeded limits.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from benchmarks import small
from benchmarks.rigs import model_of
from pneucli.exam.laboratory import Laboratory
from pneucli.exam.planned_recordings import excitation
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.simulation import LOOP_PERIOD, Excitation, simulate_rig
from pneucli.plan.bench import LOOP_RANGE, Bench, described_benches
from pneucli.plan.limits import Limits, limits_of, violations
from pneucli.plan.manoeuvre import Manoeuvre
from pneucli.plan.manoeuvres import candidate_manoeuvres
from pneucli.plan.outcome import Outcome
from pneucli.plan.profile import sample
from pneucli.plan.safety import Safety
from pneucli.simulate.model import Model
from pneucli.stages.plan_answer import manoeuvre_answer

LIMIT_CONDITIONS = ("usual", "5/3")
CHECKED_MODELS = 4  # models off by their intervals in which each manoeuvre is checked, as in pneucli.plan.safety
MANOEUVRES_PER_PLAN = 3
RELATIVE_ERRORS = {  # standard errors of what a user's pipeline identifies or states, relative to the value
    "coulomb": 0.1, "viscous": 0.1, "effective_area": 0.03, "effective_area_2": 0.03, "mass": 0.02,
    "dead_volume_1": 0.05, "dead_volume_2": 0.05, "supply": 0.01,
}  # fmt: skip
TOLERANCE = 0.02  # of a limit: the model's integrator and the rig's agree that closely


def main(arguments: Sequence[str]) -> None:
    """Print the table."""
    if small.SMALL in arguments:
        print_limits(2)
        return
    numbers = [int(a) for a in arguments]
    print_limits(*numbers)


def print_limits(plans: int = 200, seed: int = 49) -> None:
    """Play safe manoeuvres on the exam's rig with parameters off by their intervals, and count exceeded limits."""
    rng, exceeded, played, refused = np.random.default_rng(seed), Counter[str](), 0, 0
    rigs = [limit_rig(condition) for condition in LIMIT_CONDITIONS]
    for number in range(plans):
        laboratory, benches, _, model = rigs[number % len(rigs)]
        limits = limits_of(model.rig, benches, random_limits(laboratory.parameters, rng))
        off = [off_by_interval(laboratory.parameters, rng) for _ in range(CHECKED_MODELS)]
        safety = Safety(model.rig, limits, {"exact": model} | {str(i): model_of(par) for i, par in enumerate(off)})
        bench = benches[int(rng.integers(len(benches)))]
        listed = list(candidate_manoeuvres(bench, limits))
        order = [listed[i] for i in rng.permutation(len(listed))[:MANOEUVRES_PER_PLAN]]
        chosen = [m for m in order if safety(m)]
        refused += len(order) - len(chosen)
        real = replace(laboratory, parameters=off_by_interval(laboratory.parameters, rng))
        for quantity in played_violations(real, chosen, limits):
            exceeded[quantity] += 1
        played += len(chosen)
    print("| plans | manoeuvres played | refused before | exceeded limits |\n| --- | --- | --- | --- |")
    kinds = ", ".join(f"{count} of {name}" for name, count in exceeded.items())
    print(f"| {plans} | {played} | {refused} | {sum(exceeded.values())}{f' ({kinds})' if kinds else ''} |")


def random_limits(par: Parameters, rng: np.random.Generator) -> dict[str, float]:
    """Return limits as a user may state them, so narrow that many manoeuvres come close to one."""
    return {
        "end_margin": par.stroke * rng.uniform(0.05, 0.3),
        "max_speed": rng.uniform(0.1, 1.0),
        "max_pressure": par.supply * rng.uniform(0.7, 1.1),
        "max_force": (par.supply - par.ambient) * par.piston_area_1 * rng.uniform(0.1, 1.0),
    }


def limit_rig(condition: str) -> tuple[Laboratory, list[Bench], Limits, Model]:
    """Return a healthy axis of the exam, its benches, its limits, and its exact model."""
    laboratory = small.laboratory(condition)
    model = model_of(laboratory.parameters)
    model = replace(model, rig=replace(model.rig, valve_arrangement=model.rig.valve_arrangement or "one-chamber"))
    benches = [
        replace(b, loop_range=LOOP_RANGE) for b in described_benches(model.rig, laboratory.parameters.command_range)
    ]
    return laboratory, benches, limits_of(model.rig, benches), model


def off_by_interval(par: Parameters, rng: np.random.Generator) -> Parameters:
    """Return a rig whose parameters are off by two standard errors at most."""
    off = {
        name: getattr(par, name) * (1.0 + error * float(np.clip(rng.standard_normal(), -2.0, 2.0)))
        for name, error in RELATIVE_ERRORS.items()
    }
    return par._replace(**off)


def played_violations(laboratory: Laboratory, chosen: Sequence[Manoeuvre], limits: Limits) -> Iterator[str]:
    """Play manoeuvres on the rig; yield the quantity of each limit that one exceeds."""
    par = laboratory.parameters
    for one in chosen:
        commands = {one.bench.quantity: sample(one.profile, LOOP_PERIOD)}
        made = excitation(laboratory, manoeuvre_answer(one), commands, 0.0)
        assert isinstance(made, Excitation)
        truth = simulate_rig(par, made)
        outcome = Outcome(truth["u"], {}, truth["p1"], truth["p2"], truth["x"], truth["v"])
        for found in violations(outcome, limits, one.bench.rig):
            beyond = abs(found.value - found.limit)
            scale = one.bench.rig.stroke if found.quantity == "x" else abs(found.limit)
            if beyond > TOLERANCE * (scale or 1.0):
                yield found.quantity


if __name__ == "__main__":
    main(sys.argv[1:])
