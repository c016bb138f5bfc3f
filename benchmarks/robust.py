"""Robust gains on the exam's rig, which shares no code with the model: ``python -m benchmarks.robust TABLE [NAME...]``.

TABLE is one of

- ``ensemble``: axes held, by the rules, with gains from an ensemble, and with these after a commissioning, of rigs with
  one effect that the model knows (told) or not (untold), told but with untold bristles, 5 ms of lag and 0.1 V of play
  (small), 10 ms of lag or of hose; at the end the probability that the ensemble promised;
- ``promise``: the probability that an ensemble promises, against the share of further rigs of the model, and of the
  exam's with the same untold effects, that hold;
- ``proof``: rigs that no design saw, of all arrangements, at 0.5 to 5 ms, encoders of 1 to 50 um, with 10 ms of lag
  or of hose, break-away or a null untold, commissioned or not, under what happens in a plant: loads on and off,
  emergency stops, a sensor lost, the supply lost. A loop runs away where the piston, once all is well again for 3 s,
  is further than 1 mm from its reference, unless a commissioning ended with shut valves, or swings by more.

The limits are those of ``python -m benchmarks.loop benefit``. ``--seeds N`` draws N rigs, ``--seed`` the first.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np
from scipy.stats import beta

from benchmarks import rigs
from benchmarks.loop import WORST_EFFECTS, exact_models, figures, head, is_held, row, with_unknowns
from pneucli.arrays import Array
from pneucli.closed_loop import ensemble
from pneucli.closed_loop.commissioning import SHUT, commissioned, member_on_ensemble, with_commissioning
from pneucli.closed_loop.simulation import ClosedLoopSetup
from pneucli.controller import layout
from pneucli.controller.parameters import Controller
from pneucli.design.cascade_design import design_cascade
from pneucli.design.requirements import Requirements
from pneucli.exam.cases import prepare_case
from pneucli.exam.conditions import parse
from pneucli.exam.hidden_effects import BY_NAME
from pneucli.exam.rig.parameters import ONE_CHAMBER, Parameters
from pneucli.simulate.model import Model

COMMISSIONING = 5.0  # s, before each run
DESIGNS = ("rules", "ensemble", "commissioned")


@dataclass
class Count:
    """What each of the ``DESIGNS`` did on the rigs of a column."""

    rigs: int = 0
    held: list[int] = field(default_factory=lambda: [0, 0, 0])
    swings: list[int] = field(default_factory=lambda: [0, 0, 0])
    chattering: list[list[float]] = field(default_factory=list)

    def shown(self, i: int) -> str:
        """What a design held, with the 90 % interval of Clopper and Pearson, and its chattering."""
        k, n = self.held[i], self.rigs
        low = beta.ppf(0.05, k, n - k + 1) if k else 0.0
        high = beta.ppf(0.95, k + 1, n - k) if k < n else 1.0
        noise = float(np.median(np.array(self.chattering)[:, i]))
        return f"{k} ({100 * low:.0f} to {100 * high:.0f} %), {self.swings[i]} swing, {noise:.2g} V"


def print_ensemble(asked: argparse.Namespace) -> None:
    """Print a row for each rig, and how many axes each design holds, by what it is not told."""
    names = ["none"] if asked.small else asked.names or list(WORST_EFFECTS)
    head("rig", "effect", "what", "at rest, um", "moves, um", "sine, um rms", "under the load, um", "held")
    counts: dict[str, Count] = {}
    promised: list[float] = []
    for seed in range(asked.seed, asked.seed + asked.seeds):
        name = names[seed % len(names)]
        par, without, known = exact_models(seed, name)
        untold, probability = designs(without, par, asked.small)
        told = untold if name == "none" else designs(known, par, asked.small)[0]
        promised.append(probability)
        cases = {"told": (par, told), "untold": (par, untold), "small": (with_unknowns(par), told)}
        cases["10 ms of lag"] = par._replace(valve_lag=par.valve_lag + 10e-3), told
        cases["10 ms of hose"] = par._replace(line_delay=par.line_delay + 10e-3), told
        for what, (actual, (rules, own)) in cases.items():
            found = [figures(actual, rules), figures(actual, own), figures(actual, own, commissioning=COMMISSIONING)]
            held = [is_held(one, unknown=False) for one in found]
            count = counts.setdefault(what, Count())
            count.rigs += 1
            count.held = [a + b for a, b in zip(count.held, held, strict=True)]
            count.swings = [a + (one[1] > 1e3) for a, one in zip(count.swings, found, strict=True)]
            count.chattering.append([chatters(actual, rules), chatters(actual, own), chatters(actual, own, True)])
            row(seed, name, what, *(" / ".join(f"{one[i]:.3g}" for one in found) for i in range(4)),
                " / ".join(map(str, held)))  # fmt: skip
    head("the rig has", "rigs", *DESIGNS)
    for what, count in counts.items():
        row(what, count.rigs, *(count.shown(i) for i in range(3)))
    print(f"promised on the ensemble: {np.mean(promised):.3f}")


def chatters(par: Parameters, c: Controller, is_commissioned: bool = False) -> float:
    """Return the rms in V of the command's chattering while a load comes and goes."""
    first = COMMISSIONING * is_commissioned
    time = c.period * np.arange(round((first + 5.0) / c.period)) - first
    push = 50.0 * par.piston_area_1 / 8e-4 * ((time >= 1.0) & (time < 3.0))
    mode = np.zeros(time.size)
    mode[round(0.2 / c.period)] = layout.OPERATING_MODES.index("commission") * is_commissioned
    u = rigs.driven(par, c, np.full(time.size, 0.5 * par.stroke), push, 400.0, 1e-6, mode=mode).u
    return ensemble.chattering(np.asarray(u[time >= 0.0]), c.period)


@dataclass(frozen=True)
class Searched:
    """Controllers by the rules and from the ensemble, and what the search of the latter was made with."""

    usual: Controller
    own: Controller
    rigs_like: ensemble.RigEnsemble
    test: ensemble.RigTest
    setup: ClosedLoopSetup

    def proof(self, count: int) -> ensemble.Proof:
        """What the controller from the ensemble does on ``count`` fresh rigs of the model."""
        return ensemble.prove(self.own, self.rigs_like, self.test, self.setup, count, explained=False)


def searched(model: Model, par: Parameters, is_small: bool) -> Searched:
    """Design by the rules and on the ensemble of a model."""
    wanted, sealed = requirements(par)
    rigs_like, setup = ensemble.ensemble_of(model, {}), ClosedLoopSetup(quantum_x=1e-6, noise_p=400.0)
    usual = design_cascade(model, wanted, sealed)
    test, family = ensemble.rig_test(usual, wanted), ensemble.family_of(rigs_like)
    family, count = (family[:2], 2) if is_small else (family, ensemble.SEARCH_RIGS)

    def make(choice: ensemble.Choice) -> Controller:
        return design_cascade(*ensemble.chosen_requirements(choice, model, wanted), sealed)

    own = make(ensemble.search(rigs_like, make, setup, test, family, count=count))
    return Searched(usual, own, rigs_like, test, setup)


def designs(model: Model, par: Parameters, is_small: bool) -> tuple[tuple[Controller, Controller], float]:
    """Return the controllers by the rules and from the ensemble, and the probability that the latter promises."""
    (wanted, sealed), found = requirements(par), searched(model, par, is_small)

    def member(slower: Model) -> Controller:
        if is_small:
            return design_cascade(slower, wanted, sealed)
        return member_on_ensemble(found.rigs_like, slower, wanted, sealed, found.test, found.setup)

    made = with_commissioning(model, found.own, member, found.setup)
    return (found.usual, made), found.proof(3 if is_small else 40).probability


def print_promise(asked: argparse.Namespace) -> None:
    """Print a row for each rig: what its ensemble promises and what held, on the model's rigs and on the exam's."""
    head("rig", "design, s", "promised", "held, model", "held, exam", "over rest, motion, load, chattering",
         "chattering, V, rules / ensemble")  # fmt: skip
    count, total = (2, 3) if asked.small else (40, ensemble.PROOF_RIGS), np.zeros(3)
    for seed in range(asked.seed, asked.seed + asked.seeds):
        par, model, _ = exact_models(seed, "none")
        start = perf_counter()
        found = searched(model, par, asked.small)
        proof, spent = found.proof(count[1]), perf_counter() - start
        on_exam = np.array([_on_exam(found, par, k) for k in range(count[0])])
        held = int(np.sum(on_exam.max(axis=1) <= 1.0))
        total += np.array([proof.probability, proof.held / count[1], held / count[0]])
        row(seed, round(spent), f"{proof.probability:.2f}", f"{proof.held} of {count[1]}", f"{held} of {count[0]}",
            " ".join(str(n) for n in np.sum(on_exam > 1.0, axis=0)),
            " / ".join(f"{chatters(par, c):.2g}" for c in (found.usual, found.own)))  # fmt: skip
    row("mean", "", *(f"{share:.2f}" for share in total / asked.seeds), "", "")


def _on_exam(found: Searched, par: Parameters, k: int) -> Array:
    """Return the figures over their limits on the exam's own rig k with what the ensemble draws for its rigs."""
    drawn = found.rigs_like.draw(ensemble.PROOF_SEED + 1, k)
    base, most = drawn.base_values(), np.array([par.command_range])
    scale = float((drawn.valve(most) / found.rigs_like.model.valve(most))[0])
    fields = {
        BY_NAME[name].fields[key][0]: BY_NAME[name].fields[key][1] * drawn.values[f"{name}.{key}"]
        for name in found.rigs_like.effects
        for key in BY_NAME[name].fields
    }
    actual = par._replace(
        supply=base["rig.supply_pressure"], mass=base["rig.moving_mass"], dead_volume_1=base["rig.dead_volume_1"],
        dead_volume_2=base["rig.dead_volume_2"], effective_area=scale * par.effective_area, **fields,
    )  # fmt: skip
    scenario = found.test.scenario
    run = rigs.driven(actual, found.own, scenario.reference, -scenario.force, seed=k)
    return found.test.judged(run.x, run.u)


def requirements(par: Parameters, period: float = 1e-3, quantum: float = 1e-6) -> tuple[Requirements, float | None]:
    """Return what is asked of an axis of the exam, and the pressure in Pa of a closed chamber 2."""
    closed = par.arrangement == ONE_CHAMBER
    wanted = Requirements(period=period, quantum_x=quantum, noise_p=400.0, chamber_2="closed" if closed else "valve")
    return wanted, float(np.sqrt(par.ambient * par.supply)) if closed else None


# Rigs that no design saw, and what happens in a plant.

CONDITIONS = ("usual", "5/3", "two-valves", "differential+5/3")
SAMPLE_TIMES, ENCODERS = (0.5e-3, 1e-3, 2e-3, 5e-3), (1e-6, 5e-6, 20e-6, 50e-6)
SURPRISES: dict[str, Callable[[Parameters], Parameters]] = {
    "as its model": lambda par: par,
    "10 ms of lag": lambda par: par._replace(valve_lag=par.valve_lag + 10e-3),
    "10 ms of hose": lambda par: par._replace(line_delay=par.line_delay + 10e-3),
    "break-away 1.8 times": lambda par: par._replace(static=max(par.static, 1.8 * par.coulomb)),
    "null off by 0.3 V": lambda par: par._replace(command_null=par.command_null + 0.3),
    "small effects": with_unknowns,
}
EVENTS = ("load", "stop", "x lost", "p1 lost", "p2 lost", "supply lost")
LAST = 3.0  # s at the end of a run, in which all is well
RUNAWAY = 1e-3  # m


@dataclass(frozen=True)
class Plant:
    """What happens over a run, one row a sample: reference (m), load (N), mode, lost readings, lost supply."""

    reference: Array
    load: Array
    mode: Array
    lost: Array
    starved: Array


def plant_run(event: str, par: Parameters, h: float, is_commissioned: bool) -> Plant:
    """Return a run of steps and a sine in which an event comes and goes, before it a commissioning if asked for."""
    first = COMMISSIONING if is_commissioned else 0.0
    time = h * np.arange(round((first + 9.0 + LAST) / h)) - first
    way = np.where(time < 1.0, 0.0, np.where(time < 4.0, 0.1, -0.1))
    way = np.where((time > 6.0) & (time < 8.0), 0.1 * np.sin(np.pi * (time - 6.0)) - 0.1, way)
    now = ((time >= 2.0) & (time < 3.5)) | ((time >= 6.4) & (time < 7.4))
    mode, lost = np.zeros(time.size), np.zeros((time.size, 3))
    if is_commissioned:
        mode[round(0.2 / h)] = layout.OPERATING_MODES.index("commission")
    if event == "stop":
        mode[now] = layout.OPERATING_MODES.index("off")
    if event.endswith("lost") and event != "supply lost":
        lost[now, ("x", "p1", "p2").index(event[:2].strip())] = np.nan
    push = 0.1 * (par.supply - par.ambient) * par.piston_area_1
    return Plant(
        par.stroke * (0.5 + way), push * now * (event == "load"), mode, lost, 1.0 * now * (event == "supply lost")
    )


def print_proof(asked: argparse.Namespace) -> None:
    """Print what ran away, a row each, how many runs of a rig, then counts by surprise."""
    head(
        "rig",
        "arrangement",
        "sample time",
        "encoder",
        "surprise",
        "event",
        "commissioned",
        "at the end, um",
        "moves, um",
    )
    runs: dict[tuple[str, bool], list[bool]] = {}
    ends: dict[str, int] = {}
    for seed in range(asked.seed, asked.seed + asked.seeds):
        rng = np.random.default_rng([seed, 11])
        condition = CONDITIONS[seed % len(CONDITIONS)]
        h, quantum = (float(rng.choice(those)) for those in (SAMPLE_TIMES, ENCODERS))
        par = prepare_case("rig", "axis", (), "", 1.0, seed, parse(condition)).laboratory.parameters
        wanted, sealed = requirements(par, h, quantum)
        model = rigs.model_of(par, ("stribeck",) if par.static > par.coulomb else ())
        made = with_commissioning(
            model, design_cascade(model, wanted, sealed), lambda m: design_cascade(m, wanted, sealed),  # noqa: B023
            ClosedLoopSetup(quantum_x=quantum, noise_p=400.0),
        )  # fmt: skip
        for surprise, change in list(SURPRISES.items())[: 1 if asked.small else None]:
            for event in EVENTS[: 1 if asked.small else None]:
                for is_commissioned in (False, True):
                    actual, run = change(par), plant_run(event, par, h, is_commissioned)
                    trace = rigs.driven(actual, made, run.reference, run.load, 400.0, quantum, seed, mode=run.mode,
                                        starved=run.starved, lost=run.lost)  # fmt: skip
                    last = trace.x[-round(1.0 / h) :]
                    error, moves = float(np.abs(last - run.reference[-1]).max()), float(np.ptp(last))
                    state = commissioned(trace.states[-1]).state
                    is_bad = not max(error if state not in SHUT else 0.0, moves) < RUNAWAY
                    runs.setdefault((surprise, is_commissioned), []).append(is_bad)
                    if is_commissioned:
                        ends[state] = ends.get(state, 0) + 1
                    if is_bad or asked.small:
                        row(seed, condition, h, quantum, surprise, event, is_commissioned, 1e6 * error, 1e6 * moves)
        row(seed, condition, h, quantum, "all so far", "", "", sum(map(len, runs.values())), str(ends))
    head("surprise", "commissioned", "runs", "ran away")
    for (surprise, is_commissioned), bad in runs.items():
        row(surprise, is_commissioned, len(bad), sum(bad))
    print("commissionings ended as:", ", ".join(f"{state} {n}" for state, n in ends.items()))


TABLES = {"ensemble": print_ensemble, "promise": print_promise, "proof": print_proof}


def main(arguments: list[str]) -> None:
    """Print one of the tables, or of each a small one."""
    rigs.print_rig_tables(TABLES, __doc__, arguments)


if __name__ == "__main__":
    main(sys.argv[1:])
