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
- ``long``: the same rigs, 10 minutes each: moves every 4 s, in half of them something that happens in a plant for 1 s;
- ``faults``: the exported C is commissioned on rigs with a fault (gcc): the state that names it, travel and pressure
  over their limits, whether gains and nulls are as designed, and the error 1.5 s after the fault is gone and the
  controller was disabled and enabled.
- ``published``: what Zhu and Barth measured (International Journal of Fluid Power 11, 2010, 43-55: sliding-mode force
  control with adapted friction; steps and sines of 60 mm), beside ``best`` as exported, gains by the rules, on
  simulated cylinders that can make these motions. The abstract tells the errors and the rise; bore, mass, friction and
  valve are ours, so several; NAME picks one by its number.

The limits are those of ``python -m benchmarks.loop benefit``. ``--seeds N`` draws N rigs, ``--seed`` the first.
"""

import argparse
import math
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from time import perf_counter

import numpy as np
from scipy.stats import beta

from benchmarks import rigs
from benchmarks.loop import (
    WORST_EFFECTS,
    Exported,
    benefit_runs,
    driven,
    exact_models,
    head,
    is_held,
    row,
    with_unknowns,
)
from pneucli.arrays import Array
from pneucli.closed_loop import ensemble
from pneucli.closed_loop.commissioning import SHUT, STATES, commissioned, member_on_ensemble, with_commissioning
from pneucli.closed_loop.simulation import ClosedLoopSetup, replay_log
from pneucli.controller import layout
from pneucli.controller.parameters import Controller
from pneucli.design.cascade_design import design_cascade
from pneucli.design.requirements import Requirements
from pneucli.exam.cases import prepare_case
from pneucli.exam.conditions import parse
from pneucli.exam.hidden_effects import BY_NAME
from pneucli.exam.rig.parameters import FIVE_THREE, ONE_CHAMBER, Parameters
from pneucli.exam.rig.sensors import Sensors
from pneucli.export.export_files import write_c_source
from pneucli.simulate.model import Model

COMMISSIONING = 5.0  # s, before each run
DESIGNS = ("rules", "ensemble", "commissioned")


@dataclass
class Count:
    """What each of the ``DESIGNS`` did on the rigs of a column; chattering (V) and variation at rest (V/s) by rig."""

    held: list[list[bool]] = field(default_factory=list)
    swings: list[list[bool]] = field(default_factory=list)
    chattering: list[list[float]] = field(default_factory=list)
    variation: list[list[float]] = field(default_factory=list)

    def shown(self, i: int) -> str:
        """What a design held, with the 95 % interval of Clopper and Pearson, and the medians of its command."""
        k, n = int(np.sum(np.array(self.held)[:, i])), len(self.held)
        low = beta.ppf(0.025, k, n - k + 1) if k else 0.0
        high = beta.ppf(0.975, k + 1, n - k) if k < n else 1.0
        fast, rest = (float(np.median(np.array(of)[:, i])) for of in (self.chattering, self.variation))
        swings = int(np.sum(np.array(self.swings)[:, i]))
        return f"{k} ({100 * low:.0f} to {100 * high:.0f} %), {swings} swing, {fast:.2g} V, {rest:.2g} V/s"


def print_ensemble(asked: argparse.Namespace) -> None:
    """Print a row for each rig, and how many axes each design holds, by what it is not told."""
    names = ["none"] if asked.small else asked.names or list(WORST_EFFECTS)
    head("rig", "effect", "what", "at rest, um", "moves, um", "sine, um rms", "under the load, um", "held",
         "chattering, V", "variation at rest, V/s")  # fmt: skip
    counts: dict[str, Count] = {}
    promised, floors = [], []
    for seed in range(asked.seed, asked.seed + asked.seeds):
        name = names[seed % len(names)]
        par, without, known = exact_models(seed, name)
        untold, probability = designs(without, par, asked.small)
        told = untold if name == "none" else designs(known, par, asked.small)[0]
        promised.append(probability)
        floors.append([noise_variation(par, without, made) for made in untold])
        cases = {"told": (par, told), "untold": (par, untold), "small": (with_unknowns(par), told)}
        cases["10 ms of lag"] = par._replace(valve_lag=par.valve_lag + 10e-3), told
        cases["10 ms of hose"] = par._replace(line_delay=par.line_delay + 10e-3), told
        if name == "none":
            del cases["untold"]
        for what, (actual, (rules, own)) in cases.items():
            runs = [benefit_runs(actual, rules), benefit_runs(actual, own)]
            runs.append(benefit_runs(actual, own, commissioning=COMMISSIONING))
            found, count = [one.figures() for one in runs], counts.setdefault(what, Count())
            count.held.append([is_held(one, unknown=False) for one in found])
            count.swings.append([one[1] > 1e3 for one in found])
            count.chattering.append([ensemble.chattering(one.commands[2], one.period) for one in runs])
            count.variation.append(
                [max(map(partial(variation, period=one.period), one.rests(one.commands))) for one in runs]
            )
            row(seed, name, what, *(" / ".join(f"{one[i]:.3g}" for one in found) for i in range(4)),
                *(" / ".join(str(one) if isinstance(one, bool) else f"{one:.2g}" for one in of[-1])
                  for of in (count.held, count.chattering, count.variation)))  # fmt: skip
    head("the rig has", "rigs", *DESIGNS)
    for what, count in counts.items():
        row(what, len(count.held), *(count.shown(i) for i in range(3)))
    print(f"promised on the ensemble: {np.mean(promised):.3f}")
    print("variation of the command by noise alone, V/s:", " / ".join(f"{v:.2g}" for v in np.median(floors, axis=0)))


def variation(u: Array, period: float) -> float:
    """Return the total variation of a command over its time, in V/s."""
    return float(np.abs(np.diff(u)).sum() / (period * u.size))


def noise_variation(par: Parameters, model: Model, c: Controller) -> float:
    """Return the variation of the command by the noise of the pressures alone, in V/s: the axis stands."""
    n, p2 = round(2.0 / c.period), math.sqrt(par.ambient * par.supply)
    p1 = (p2 * par.piston_area_2 + par.ambient * (par.piston_area_1 - par.piston_area_2)) / par.piston_area_1
    x = np.full(n, 0.5 * par.stroke)
    noise = 400.0 * np.random.default_rng(0).standard_normal((2, n))
    u = replay_log(model, c, {"x_ref": x, "x": x, "p1": p1 + noise[0], "p2": p2 + noise[1]}, "with")[:, layout.L_U1]
    return variation(u[-round(0.5 / c.period) :], c.period)


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


def searched(model: Model, wanted: Requirements, sealed: float | None, is_small: bool) -> Searched:
    """Design by the rules and on the ensemble of a model; ``sealed``: pressure in Pa of a closed chamber 2."""
    rigs_like, setup = (
        ensemble.ensemble_of(model, {}),
        ClosedLoopSetup(quantum_x=wanted.quantum_x, noise_p=wanted.noise_p),
    )
    usual = design_cascade(model, wanted, sealed)
    test, family = ensemble.rig_test(usual, wanted), ensemble.family_of(rigs_like)
    family, count = (family[:2], 2) if is_small else (family, ensemble.SEARCH_RIGS)

    def make(choice: ensemble.Choice) -> Controller:
        return design_cascade(*ensemble.chosen_requirements(choice, model, wanted), sealed)

    own = make(ensemble.search(rigs_like, make, setup, test, family, count=count))
    return Searched(usual, own, rigs_like, test, setup)


def designs(model: Model, par: Parameters, is_small: bool) -> tuple[tuple[Controller, Controller], float]:
    """Return the controllers by the rules and from the ensemble, and the probability that the latter promises."""
    wanted, sealed = requirements(par, tolerance=ensemble.REST_LIMIT)
    found = searched(model, wanted, sealed, is_small)

    def member(slower: Model) -> Controller:
        if is_small:
            return design_cascade(slower, wanted, sealed)
        return member_on_ensemble(found.rigs_like, slower, wanted, sealed, found.test, found.setup)

    made = with_commissioning(model, found.own, member, found.setup)
    return (found.usual, made), found.proof(3 if is_small else 40).probability


def print_promise(asked: argparse.Namespace) -> None:
    """Print a row for each rig: what its ensemble promises and what held, on the model's rigs and on the exam's."""
    head("rig", "design, s", "promised", "held, model", "held, exam", "over rest, motion, load, chattering")
    count, total = (2, 3) if asked.small else (40, ensemble.PROOF_RIGS), np.zeros(3)
    for seed in range(asked.seed, asked.seed + asked.seeds):
        par, model, _ = exact_models(seed, "none")
        start = perf_counter()
        found = searched(model, *requirements(par, tolerance=ensemble.REST_LIMIT), asked.small)
        proof, spent = found.proof(count[1]), perf_counter() - start
        on_exam = np.array([_on_exam(found, par, k) for k in range(count[0])])
        held = int(np.sum(on_exam.max(axis=1) <= 1.0))
        total += np.array([proof.probability, proof.held / count[1], held / count[0]])
        row(seed, round(spent), f"{proof.probability:.2f}", f"{proof.held} of {count[1]}", f"{held} of {count[0]}",
            " ".join(str(n) for n in np.sum(on_exam > 1.0, axis=0)))  # fmt: skip
    row("mean", "", *(f"{share:.2f}" for share in total / asked.seeds), "")


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
    reference = found.test.scenario.reference.copy()
    reference[0] = found.test.scenario.start[0]  # where a closed chamber was shut
    run = rigs.driven(actual, found.own, reference, -found.test.scenario.force, seed=k)
    return found.test.judged(run.x, run.u)


def requirements(
    par: Parameters, period: float = 1e-3, quantum: float = 1e-6, tolerance: float | None = None
) -> tuple[Requirements, float | None]:
    """Return what is asked of an axis of the exam, and the pressure in Pa of a closed chamber 2."""
    closed = par.arrangement == ONE_CHAMBER
    chamber_2 = "closed" if closed else "valve"
    wanted = Requirements(period=period, quantum_x=quantum, noise_p=400.0, chamber_2=chamber_2, tolerance=tolerance)
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
    head("rig", "arrangement", "sample time", "encoder", "surprise", "event", "commissioned", "at the end, um",
         "moves, um")  # fmt: skip
    runs: dict[tuple[str, bool], list[tuple[bool, float]]] = {}
    ends: dict[str, int] = {}
    for seed in range(asked.seed, asked.seed + asked.seeds):
        rng = np.random.default_rng([seed, 11])
        condition = CONDITIONS[seed % len(CONDITIONS)]
        h, quantum = (float(rng.choice(those)) for those in (SAMPLE_TIMES, ENCODERS))
        par, made = designed_rig(seed, condition, h, quantum)
        for surprise, change in list(SURPRISES.items())[: 1 if asked.small else None]:
            for event in EVENTS[: 1 if asked.small else None]:
                for is_commissioned in (False, True):
                    actual, run = change(par), plant_run(event, par, h, is_commissioned)
                    trace = rigs.driven(actual, made, run.reference, run.load, 400.0, quantum, seed, mode=run.mode,
                                        starved=run.starved, lost=run.lost, keeps_states=False)  # fmt: skip
                    last = trace.x[-round(1.0 / h) :]
                    error, moves = float(np.abs(last - run.reference[-1]).max()), float(np.ptp(last))
                    state = commissioned(trace.states[-1]).state
                    is_bad = not max(error if state not in SHUT else 0.0, moves) < RUNAWAY
                    now = variation(trace.u[-round(1.0 / h) :], h)
                    runs.setdefault((surprise, is_commissioned), []).append((is_bad, now))
                    if is_commissioned:
                        ends[state] = ends.get(state, 0) + 1
                    if is_bad or asked.small:
                        row(seed, condition, h, quantum, surprise, event, is_commissioned, 1e6 * error, 1e6 * moves)
        row(seed, condition, h, quantum, "all so far", "", "", sum(map(len, runs.values())), str(ends))
    head("surprise", "commissioned", "runs", "ran away", "variation at the end, V/s: median, 95 %")
    for (surprise, is_commissioned), found in runs.items():
        at_rest = np.quantile([one for _, one in found], [0.5, 0.95])
        bad = sum(is_bad for is_bad, _ in found)
        row(surprise, is_commissioned, len(found), bad, "{:.2g}, {:.2g}".format(*at_rest))
    print("commissionings ended as:", ", ".join(f"{state} {n}" for state, n in ends.items()))


DWELL, LONG = 4.0, 600.0  # s, of each position, and of all


def print_long(asked: argparse.Namespace) -> None:
    """Print a row for each rig: how many dwells end within 50 um, or 2 counts of the encoder, and how many 1 mm off."""
    head("rig", "arrangement", "sample time", "encoder", "surprise", "dwells", "within 50 um", "beyond 1 mm",
         "largest, um", "chattering, V", "air a move, g", "commissioned")  # fmt: skip
    for seed in range(asked.seed, asked.seed + asked.seeds):
        rng = np.random.default_rng([seed, 12])
        condition, (surprise, change) = (
            CONDITIONS[seed % len(CONDITIONS)],
            list(SURPRISES.items())[seed % len(SURPRISES)],
        )
        h, quantum = (float(rng.choice(those)) for those in (SAMPLE_TIMES, ENCODERS))
        par, made = designed_rig(seed, condition, h, quantum)
        dwells = 2 if asked.small else round(LONG / DWELL)
        run = long_run(rng, par, h, dwells)
        trace = rigs.driven(change(par), made, run.reference, run.load, 400.0, quantum, seed, mode=run.mode,
                            starved=run.starved, lost=run.lost, keeps_states=False)  # fmt: skip
        error = np.abs(trace.x - run.reference)[-round(dwells * DWELL / h) :].reshape(dwells, -1)
        ends = 1e6 * error[:, -round(0.5 / h) :].max(axis=1)
        row(seed, condition, h, quantum, surprise, dwells, int(np.sum(ends <= max(50.0, 2e6 * quantum))),
            int(np.sum(ends > 1e3)), float(ends.max()), ensemble.chattering(trace.u, h), 1e3 * trace.air / dwells,
            commissioned(trace.states[-1]).state)  # fmt: skip


def long_run(rng: np.random.Generator, par: Parameters, h: float, dwells: int) -> Plant:
    """Return a commissioning, then dwells at random positions, half of them with an event from 0.5 to 1.5 s."""
    first, each = round(COMMISSIONING / h), round(DWELL / h)
    now = (h * np.arange(each) >= 0.5) & (h * np.arange(each) < 1.5)
    n = first + dwells * each
    reference, mode, lost = np.full(n, 0.5 * par.stroke), np.zeros(n), np.zeros((n, 3))
    load, starved = np.zeros(n), np.zeros(n)
    mode[round(0.2 / h)] = layout.OPERATING_MODES.index("commission")
    for i in range(dwells):
        part = slice(first + i * each, first + (i + 1) * each)
        reference[part] = par.stroke * rng.uniform(0.35, 0.65)
        event = str(rng.choice([*EVENTS, *len(EVENTS) * [""]]))
        load[part] = 0.1 * (par.supply - par.ambient) * par.piston_area_1 * now * (event == "load")
        mode[part] = layout.OPERATING_MODES.index("off") * now * (event == "stop")
        starved[part] = now * (event == "supply lost")
        for column, name in enumerate(("x", "p1", "p2")):
            lost[part, column] = np.where(now & (event == f"{name} lost"), np.nan, 0.0)
    return Plant(reference, load, mode, lost, starved)


# Faults during a commissioning of the exported C.

BEGUN, FAULTY, MENDED, ENDED = 300, 900, 4800, 6500  # samples: a commissioning begins, a fault comes and goes
JITTER = np.random.default_rng(0).standard_normal((ENDED, 3))


@dataclass(frozen=True)
class Fault:
    """What is wrong with a machine from ``since`` (samples) until ``MENDED``, and the states that may name it.

    Attributes:
        states: Of :mod:`pneucli.closed_loop.commissioning`.
        since: Sample.
        gain: What is read of x, p1, p2 over what there is; NaN: nothing.
        noise: Standard deviation added to the readings x (m), p1, p2 (Pa).
        sign: Of the valves: -1 reversed.
        opening: Where the valves stick, of their range; NaN: they do not.
        load: A push over a tenth of the supply's force.
        starved: The supply is lost.
        start: Where the piston stands, of the stroke.
    """

    states: tuple[str, ...]
    since: int = FAULTY
    gain: tuple[float, float, float] = (1.0, 1.0, 1.0)
    noise: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sign: float = 1.0
    opening: float = np.nan
    load: float = 0.0
    starved: bool = False
    start: float = 0.5


FINE, TRAVEL, PRESSURE, SILENT, MISSING, NOISY, AGAINST, OTHER = (STATES[i] for i in (4, *range(11, 18)))
FAULTS = {
    "none": Fault((FINE,)),
    "at an end of the stroke": Fault((FINE,), start=0.0),
    "valve stuck in its middle": Fault((SILENT,), opening=0.0),
    "valve stuck open": Fault((TRAVEL, PRESSURE, AGAINST), opening=0.1),
    "valve stuck open before": Fault((TRAVEL, PRESSURE, AGAINST), since=0, opening=0.1),
    "valve reversed": Fault((AGAINST,), since=BEGUN, sign=-1.0),
    "supply lost": Fault((SILENT, OTHER), starved=True),
    "supply lost before": Fault((SILENT, OTHER), since=BEGUN, starved=True),
    "x lost": Fault((MISSING,), gain=(np.nan, 1.0, 1.0)),
    "p1 lost": Fault((MISSING,), gain=(1.0, np.nan, 1.0)),
    "p2 lost": Fault((MISSING,), gain=(1.0, 1.0, np.nan)),
    "p1 reads zero": Fault((MISSING,), gain=(1.0, 0.0, 1.0)),
    "encoder noisy": Fault((NOISY,), since=0, noise=(50e-6, 0.0, 0.0)),
    "encoder very noisy": Fault((NOISY,), since=0, noise=(2e-3, 0.0, 0.0)),
    "pressures noisy": Fault((NOISY,), since=0, noise=(0.0, 2e3, 2e3)),
    "a load comes": Fault((TRAVEL,), load=1.0),
    "a small load comes": Fault((FINE,), load=0.1),
}


class Machine:
    """An exported controller that is commissioned while there is a fault between it and the rig.

    It is disabled, then enabled again where the fault is ``MENDED``. ``states`` has the chart's after each sample.
    """

    def __init__(self, control: Exported, fault: Fault, par: Parameters) -> None:
        self._control, self._fault, self._par = control, fault, par
        self.states: list[str] = []

    def __call__(self, x_ref: float, x: float, p1: float, p2: float) -> tuple[float, float]:
        k, fault, par, control = len(self.states), self._fault, self._par, self._control
        if k == BEGUN:
            control.commission()
        if k in (MENDED, MENDED + 100):
            control.enable(k > MENDED)
        is_faulty = fault.since <= k < MENDED
        if is_faulty:
            x, p1, p2 = np.array([x, p1, p2]) * fault.gain + JITTER[k] * fault.noise
        u = control(x_ref, x, p1, p2)
        self.states.append(control.commissioned().state)
        if not is_faulty:
            return u
        if not np.isnan(fault.opening):
            return par.command_null + fault.opening * par.command_range * par.command_sign, u[1]
        first, second = (par.command_null + fault.sign * (one - par.command_null) for one in u)
        return first, second


@dataclass(frozen=True)
class Ending:
    """How a commissioning with a fault ended.

    Attributes:
        state: In words.
        travel, pressure: The largest of the relay test over their limits.
        unchanged: Whether gains and nulls are those of the design.
        error: In m, at the end, after the fault is gone.
        gain: Rate of the pressure over the model's.
    """

    state: str
    travel: float
    pressure: float
    unchanged: bool
    error: float
    gain: float


def commissioned_with(fault: Fault, par: Parameters, made: Controller, folder: Path) -> Ending:
    """Commission the exported C of a controller, which ``folder`` holds, on a rig with a fault."""
    control, time = Exported(folder), np.arange(ENDED)
    machine = Machine(control, fault, par)
    now = (time >= fault.since) & (time < MENDED)
    push = 0.1 * (par.supply - par.ambient) * par.piston_area_1 * fault.load
    start = np.full(ENDED, fault.start * par.stroke)
    trace = driven(par, Sensors(400.0, 1e-6, 0.0), machine, start, push * now, starved=now & fault.starved)
    state = machine.states[MENDED - 1]
    tested = np.flatnonzero(np.char.startswith(np.array(machine.states), "relay"))
    x, true = trace.x[tested], trace.chambers[tested]
    moved = (float(np.abs(one - one[:1]).max(initial=0.0)) for one in (x, true))
    limits = made.values["C_TRAVEL_LIMIT"], made.values["C_PRESSURE_LIMIT"]
    vector = made.vector()
    same = np.array_equal(control.numbers(vector.size), vector)
    return Ending(state, *(m / limit for m, limit in zip(moved, limits, strict=True)), same,
                  float(np.abs(trace.x[-200:] - start[-200:]).max()), control.commissioned().gain)  # fmt: skip


def print_faults(asked: argparse.Namespace) -> None:
    """Print a row for each arrangement and fault."""
    head("rig", "arrangement", "fault", "ended as", "travel", "pressure", "as designed", "at the end, um", "gain")
    for seed in range(asked.seed, asked.seed + asked.seeds):
        for condition in CONDITIONS[: 1 if asked.small else 3]:
            par, made = designed_rig(seed, condition)
            with tempfile.TemporaryDirectory() as place:
                write_c_source(Path(place), made, "faults")
                for name, fault in list(FAULTS.items())[: 2 if asked.small else None]:
                    found = commissioned_with(fault, par, made, Path(place))
                    row(seed, condition, name, found.state + ("" if found.state in fault.states else " (!)"),
                        found.travel, found.pressure, found.unchanged, 1e6 * found.error, found.gain)  # fmt: skip


def designed_rig(seed: int, condition: str, h: float = 1e-3, quantum: float = 1e-6) -> tuple[Parameters, Controller]:
    """Return a rig of the exam and the controller for its exact model, with the family of gains by the rules."""
    par = prepare_case("rig", "axis", (), "", 1.0, seed, parse(condition)).laboratory.parameters
    wanted, sealed = requirements(par, h, quantum)
    model = rigs.model_of(par, ("stribeck",) if par.static > par.coulomb else ())
    setup = ClosedLoopSetup(quantum_x=quantum, noise_p=400.0)

    def make(slower: Model) -> Controller:
        return design_cascade(slower, wanted, sealed)

    return par, with_commissioning(model, make(model), make, setup)


# A published case.

CYLINDERS = ((20e-3, 1.0), (20e-3, 5.0), (32e-3, 5.0))  # bore in m, mass in kg
ROD = 0.4  # of the bore
SLIDE, WAY = 0.15, 60e-3  # m: stroke, and step and amplitude
BREAK_AWAY, SLIDING = 0.3e5, 0.2e5  # Pa, on the piston
PUBLISHED = (0.2, 50.0, 700.0, 1200.0)  # rise in s; largest errors in um at rest, on sines of 0.5 and 1 Hz
UNTOLD: dict[str, Callable[[Parameters], Parameters]] = {
    "nothing": lambda par: par,
    "friction half again": lambda par: par._replace(coulomb=1.5 * par.coulomb, static=1.5 * par.static),
    "twice the mass": lambda par: par._replace(mass=2.0 * par.mass),
    "small effects": with_unknowns,
}


def published_rig(bore: float, mass: float) -> Parameters:
    """Return a cylinder of a bore (m) that moves a mass (kg), with a 5/3 valve of 100 l/min, 125 Hz at 6 bar gauge."""
    area = np.pi / 4.0 * bore**2
    return Parameters(
        piston_area_1=area, piston_area_2=area * (1.0 - ROD**2), stroke=SLIDE, dead_volume_1=0.1 * area * SLIDE,
        dead_volume_2=0.1 * area * SLIDE, mass=mass, coulomb=SLIDING * area, static=BREAK_AWAY * area,
        viscous=SLIDING * area, effective_area=2e-6, effective_area_2=2e-6, valve_lag=1.0 / (2.0 * np.pi * 125.0),
        arrangement=FIVE_THREE,
    )  # fmt: skip


def print_published(asked: argparse.Namespace) -> None:
    """Print what the paper states, then a row for each cylinder and what the controllers are not told."""
    head("bore, mm", "mass, kg", "untold", "rise, s", "at rest, um", "0.5 Hz, um", "1 Hz, um", "chattering, V")
    row("published", "", "friction, payload", *PUBLISHED, "")
    for bore, mass in [CYLINDERS[int(i)] for i in asked.names] or CYLINDERS[: 1 if asked.small else None]:
        par = published_rig(bore, mass)
        wanted, sealed = requirements(par, quantum=5e-6)
        wanted = replace(wanted, max_speed=0.5, max_acceleration=5.0)
        model = rigs.model_of(par, ("stribeck", "valve-lag"))
        make = partial(design_cascade, requirements=wanted, sealed_pressure=sealed)
        setup = ClosedLoopSetup(quantum_x=wanted.quantum_x, noise_p=wanted.noise_p)
        made = with_commissioning(model, make(model), make, setup)
        for untold, change in list(UNTOLD.items())[: 1 if asked.small else None]:
            row(round(1e3 * bore), mass, untold, *published_figures(change(par), made))


def published_figures(par: Parameters, c: Controller) -> list[float]:
    """Return rise (s, 10 to 90 %), and the largest errors (um) at rest and on both sines, and the chattering (V)."""
    time = c.period * np.arange(round(5.0 / c.period))
    step = 0.5 * par.stroke - 0.5 * WAY + WAY * (time >= 1.0)
    sines = [0.5 * par.stroke + WAY * np.sin(2.0 * np.pi * hz * np.maximum(time - 1.0, 0.0)) for hz in (0.5, 1.0)]
    runs = [rigs.driven(par, c, reference, 0.0 * time, 400.0, 5e-6) for reference in (step, *sines)]
    done = (runs[0].x - step[0]) / WAY
    rise = float(c.period * (np.argmax(done > 0.9) - np.argmax(done > 0.1)))
    errors = [1e6 * np.abs(run.x - reference) for run, reference in zip(runs, (step, *sines), strict=True)]
    worst = [float(e[-round(last / c.period) :].max()) for e, last in zip(errors, (1.0, 2.0, 2.0), strict=True)]
    return [rise, *worst, ensemble.chattering(runs[1].u, c.period)]


TABLES = {
    "ensemble": print_ensemble,
    "promise": print_promise,
    "proof": print_proof,
    "long": print_long,
    "faults": print_faults,
    "published": print_published,
}


def main(arguments: list[str]) -> None:
    """Print one of the tables, or of each a small one."""
    rigs.print_rig_tables(TABLES, __doc__, arguments)


if __name__ == "__main__":
    main(sys.argv[1:])
