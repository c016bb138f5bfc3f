"""The diagnosis against the truth: ``python -m benchmarks.diagnosis calibration|intervals|limit|plan``.

``calibration [--answers FOLDER] [EXAM...]`` estimates the logistic model of ``pneucli.diagnose.calibration``, and
judges it by worlds that it has not seen:

    pneucli exam A --condition messy --cases 60 --nulls 30 --seed 5550123
    pneucli exam C --condition imposed+messy --cases 24 --nulls 12 --seed 5550125
    (each once more with --answer)
    python -m benchmarks.score rigs-plc rigs-seal rigs-bench real --full
    python -m benchmarks.diagnosis calibration --answers build/score/DIGEST A C

estimated the model for residuals with an unmodelled effect. Each exam, each rig and the real recordings are a world;
the printed log score and the reliability of a world are those of the model of all other worlds. An effect of which a
healthy rig has a little is left out: whether it is present is a matter of definition. The effects of a world are not
independent, so a world counts as the square root of their number. The weights are shrunk toward 0.

The model for white residuals rests on earlier exams:

    pneucli exam E1 --condition usual --condition messy --cases 60 --nulls 150 --seed 334663411
    pneucli exam E2 --condition usual --condition messy --cases 24 --nulls 12 --seed 3061778563
    pneucli exam E3 --size 0.3333 --cases 12 --nulls 0 --seed 3061778563
    pneucli exam E4 --condition imposed+messy --condition imposed --cases 20 --nulls 8 --seed 9
    pneucli exam E5 --condition imposed+rough --cases 30 --nulls 10 --seed 5501
    pneucli exam E6 --size 0.3333 --cases 60 --nulls 0 --seed 334663411
    pneucli exam E7 --cases 20 --nulls 0 --seed 334663411 with a --condition for each of the first twelve, and
    pneucli exam E8 ..., E9 ... for the others, in the order of the table in docs/development/experiments.md

The printed JSON goes into ``pneucli/diagnose/calibration.json``.

``intervals FOLDER...``: how often 95 % intervals hold the truth, and how wide they are. A folder is an exam, or holds
cases of a rig by other hands (``pipeline.toml``, ``truth.json``). Every case is fitted with its true effects, as
``diagnose`` fits; a row for each kind of interval: from blocks of time alone, and as they are reported, of all
parameters and of hidden effects alone. The interval score is that of Gneiting and Raftery (J. Am. Stat. Assoc. 102
(2007) 359): width plus 2 / 0.05 times the distance by which the truth lies outside, over the truth; its geometric
mean is printed.

``limit FOLDER...``: what could any search name? Each case is fitted with the effects that it hides and those that the
rig always has, and each hidden one is judged in the model with all of them. An effect that is improbable or violates a
hard constraint even so explains too little of what the recordings show.

``plan limits [PROGRAMMES] [SEED]`` draws programmes on axes of the exam, within limits so narrow that many manoeuvres
come close to one, and plays them on rigs whose parameters are off by up to two standard errors; prints how many
limits are exceeded. ``plan decide OUT CASES CONDITION [SEED] [KIND]``: each case hides one effect; it is diagnosed,
the plan of a minute is recorded on the same rig, and it is diagnosed again. Finished cases in OUT are read, not run
again.
"""

import argparse
import csv
import json
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice, pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit

from benchmarks import rigs
from benchmarks.cases import CLOSE, SEALED, Truth, judged, truth_of, truths, worlds
from benchmarks.score import essence, measured
from pneucli.arrays import Array
from pneucli.diagnose.calibration import Evidence, probability
from pneucli.diagnose.candidate import Reason
from pneucli.diagnose.data import DiagnosisData, folds_of
from pneucli.diagnose.decision import judge
from pneucli.diagnose.equivalence import Term
from pneucli.diagnose.free_run_error import FreeRunErrors
from pneucli.diagnose.subsample import MAX_SAMPLES
from pneucli.exam.cases import PlannedCase, generate_case, plan_cases, prepare_case
from pneucli.exam.conditions import parse
from pneucli.exam.grades import BIN_EDGES, graded_cases
from pneucli.exam.laboratory import Laboratory, RecordingPlan
from pneucli.exam.rig.excitations import MotionMachine, closed_loop
from pneucli.exam.rig.parameters import FIVE_THREE, Parameters
from pneucli.exam.rig.simulation import Excitation, simulate_rig
from pneucli.figure import to_json
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.intervals import with_intervals
from pneucli.identify.estimation.model_fit import fit_model, fit_with_effect
from pneucli.physics.effects import catalogue_with_sides
from pneucli.plan.bench import LOOP_RANGE, Bench, Manoeuvre, Outcome, described_benches
from pneucli.plan.limits import SHIFTED_BEST, Limits, Safety, limits_of, violations
from pneucli.plan.manoeuvres import candidate_manoeuvres, draw_programme
from pneucli.quantities import Z95
from pneucli.stages.plan import commands_csv
from pneucli.stages.plan import planned_recordings as recordings_of

FACTORS = {"u [V]": 1.0, "u2 [V]": 1.0, "p_ref [bar]": 1e5, "x_ref [mm]": 1e-3}
DRIVE_GAIN = 600.0  # V/m, of the own drive of a bench that follows a position, on the usual rig (0.2 m, 10 V)
Commands = dict[str, dict[str, Array]]


def read_commands(path: Path) -> Commands:
    """Return the commands of each recording by column, SI, each (n,) with a value each ms."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    names = [name for name in dict.fromkeys(row["recording"] for row in rows) if name]
    return {name: _columns([row for row in rows if row["recording"] == name]) for name in names}


def _columns(rows: Sequence[Mapping[str, str]]) -> dict[str, Array]:
    return {
        header.partition(" ")[0]: factor * np.array([float(row[header]) for row in rows])
        for header, factor in FACTORS.items()
        if rows[0].get(header)
    }


def planned_recordings(
    laboratory: Laboratory, planned: Sequence[Mapping[str, Any]], commands: Commands, load: float = 0.0
) -> list[RecordingPlan]:
    """Return the recordings of a plan on the rig of a laboratory.

    Args:
        laboratory: The laboratory with the hidden rig.
        planned: The entries ``recordings`` of the plan's answer; of those by hand a weight is hung on the piston, and a
            valve that a person shuts is left out.
        commands: The commands of each, as :func:`read_commands` returns them.
        load: Stated force in N toward x = 0 that p1 carries at the start.
    """
    return [
        RecordingPlan(
            one["name"],
            one["experiment"],
            one["use"],
            excitation(laboratory, one, commands[one["name"]], load - one["force"]),
            one["chamber"],
            one["force"],
        )
        for one in planned
        if one["force"] or not one["by_hand"]
    ]


def excitation(
    laboratory: Laboratory, planned: Mapping[str, Any], commands: Mapping[str, Array], load: float
) -> Excitation | MotionMachine:
    """Return the excitation of one recording of a plan.

    Args:
        laboratory: The laboratory with the hidden rig.
        planned: The entry of the plan.
        commands: Its commands.
        load: Stated force in N toward x = 0.
    """
    par = laboratory.parameters
    if planned["experiment"] == "valve":
        bench = laboratory.valve_test_rig(planned["chamber"])
        opening = bench.command_sign * (commands["u"] - par.command_null)
        return Excitation(opening, pressure_1=par.ambient, pressure_2=par.ambient)
    if planned["drive"] == "machine":
        return _machine_strokes(commands["x_ref"], float(commands["p_ref"][0]), planned["speed"])
    start, is_open = planned["start"], planned["chamber_2"] == "open"
    gauge = float(start["p1"]) - par.ambient
    if planned["drive"] == "valve":
        at_rest = closed_loop(par, np.full(1, float(start["x"])), 0.0, gauge, load)
        return replace(at_rest, command=commands["u"] - par.command_null, chamber_2_open=is_open)
    gain = planned["gain"] if planned["drive"] == "position" else drive_gain(par)
    return replace(closed_loop(par, commands["x_ref"], gain, gauge, load), chamber_2_open=is_open)


def drive_gain(par: Parameters) -> float:
    """Return the gain in V/m of a bench's own drive; half where the valve drives both chambers."""
    shared = 0.5 if par.arrangement == FIVE_THREE else 1.0
    return shared * DRIVE_GAIN * (par.command_range / 10.0) * (0.2 / par.stroke)


def _machine_strokes(reference: Array, pressure: float, speed: float) -> MotionMachine:
    """Return the strokes of a machine between the extremes of a reference (m)."""
    low, high = float(reference.min()), float(reference.max())
    return MotionMachine((low, high), (speed,), 4, pressure)


RIDGE = 0.3  # of each weight but the constant
SMALL_CASES = 30
FEATURES = {
    True: ("significance", "relative_size", "free_run_share"),
    False: ("relative_size", "remaining_variance"),
}
WORLDS = ("rigs-plc", "rigs-seal", "rigs-bench", "real")  # of the score
HARD_CONSTRAINTS = frozenset(
    {"interval-contains-null", "vanishes", "at-bound", "below-resolution", "contradicted-by-reading", "cannot-show",
     "raises-error"}
)  # fmt: skip


class AnsweredCase(NamedTuple):
    """An answered case: its world and name, its effects, those of which it has a little, and the answer."""

    world: str
    name: str
    effects: frozenset[str]
    answer: Mapping[str, Any]
    mild: frozenset[str] = frozenset()


class Example(NamedTuple):
    """An added effect: its world, its evidence, and whether the rig has it or an equivalent."""

    world: str
    evidence: Evidence
    present: bool


def exam_cases(exam: Path) -> Iterator[AnsweredCase]:
    """Yield the answered cases of an exam."""
    for g in graded_cases(exam, exam / "answers"):
        if "candidates" in g.answer:
            yield AnsweredCase(exam.name, g.case, frozenset(g.hidden), g.answer)


def scored_cases(answers: Path) -> Iterator[AnsweredCase]:
    """Yield the cases of rigs by other hands and of real recordings that ``benchmarks.score`` has answered."""
    for world in worlds(sys.executable, answers, full=True):
        for case in world.cases() if world.name in WORLDS else ():
            kept = answers / world.name / case.name / "diagnose.json"
            if case.truth.names_known and kept.exists() and (text := kept.read_text(encoding="utf-8")):
                answer = json.loads(text)
                yield AnsweredCase(world.name, case.name, case.truth.hidden, answer, case.truth.mild)


def examples(cases: Sequence[AnsweredCase], *, complete: bool) -> list[Example]:
    """Return the added effects of cases with a white residual (``complete``), or of the others.

    An effect that violates a hard constraint, or whose interval contains its null, needs no probability.
    """
    out = []
    for case in cases:
        for c in case.answer.get("candidates", []):
            if (found := c.get("evidence")) and c["reason"] not in HARD_CONSTRAINTS:
                evidence = Evidence(**{n: v for n, v in found.items() if n in Evidence._fields})
                names = {c["effect"], *c["indistinguishable_from"]}
                present = bool(case.effects & names)
                if evidence.significance < Z95 or (not present and case.mild & names):
                    continue
                evidence = evidence._replace(complete=case.answer["verdict"] != "unexplained")
                out.append(Example(case.world, evidence, present))
    return [one for one in out if one.evidence.complete == complete]


def counts(world: NDArray[np.str_]) -> Array:
    """Return the count (n,) of each effect, n in all; a world counts as the square root of its number of effects."""
    _, index, number = np.unique(world, return_inverse=True, return_counts=True)
    count = number[index] ** -0.5
    return np.asarray(count * world.size / count.sum())


def fitted(x: Array, y: Array, world: NDArray[np.str_]) -> Array:
    """Return the weights (k,) of the penalised logistic model of features (n, k), outcomes (n,) and worlds (n,)."""
    penalty, count = _penalty(x), counts(world)

    def cost(w: Array) -> tuple[float, Array]:
        z = x @ w
        value = float(count @ (np.logaddexp(0.0, z) - y * z)) + 0.5 * float(penalty @ w**2)
        return value, x.T @ (count * (expit(z) - y)) + penalty * w

    return np.asarray(minimize(cost, np.zeros(x.shape[1]), jac=True, method="BFGS").x)


def errors(x: Array, weights: Array, world: NDArray[np.str_]) -> Array:
    """Return the standard errors (k,) of the weights, from the curvature of the penalised likelihood."""
    p = expit(x @ weights)
    curvature = x.T @ (x * (counts(world) * p * (1.0 - p))[:, None]) + np.diag(_penalty(x))
    return np.asarray(np.sqrt(np.diag(np.linalg.pinv(curvature))))


def _penalty(x: Array) -> Array:
    """Return the penalty (k,) of the weights of features (n, k); that of the constant is 0."""
    return np.array([0.0, *[RIDGE] * (x.shape[1] - 1)])


def by_other_worlds(x: Array, y: Array, world: NDArray[np.str_]) -> Array:
    """Return the probability (n,) of each effect by the model of all other worlds; of its own where there is one."""
    p = np.zeros(y.size)
    for one in np.unique(world):
        mine = world == one
        rest = ~mine if (~mine).any() else mine
        p[mine] = expit(x[mine] @ fitted(x[rest], y[rest], world[rest]))
    return p


def log_score(p: Array, y: Array) -> float:
    """Return the mean of -log of the probability of each outcome."""
    return float(-np.mean(np.log(np.clip(np.where(y > 0.0, p, 1.0 - p), 1e-4, 1.0))))


def estimate(name: str, found: Sequence[Example], *, complete: bool) -> None:
    """Print the weights, the score and the value of each term by worlds left out, and the reliability."""
    y, world = np.array([e.present for e in found], float), np.array([e.world for e in found])
    if len(set(y)) < 2:
        return
    x = np.array([e.evidence.features for e in found])
    p, weights = by_other_worlds(x, y, world), fitted(x, y, world)
    names = ("constant", *FEATURES[complete])
    print(f"{name}: {y.size} effects, {int(y.sum())} of them present")
    for title, values in (("weights", weights), ("standard_errors", errors(x, weights, world))):
        print(json.dumps({title: {n: round(float(v), 2) for n, v in zip(names, values, strict=True)}}))
    print(f"worlds left out one at a time: Brier {np.mean((p - y) ** 2):.3f}, log score {log_score(p, y):.3f}")
    for i, term in enumerate(FEATURES[complete], 1):
        print(f"without {term}: log score {log_score(by_other_worlds(np.delete(x, i, axis=1), y, world), y):.3f}")
    stated = np.array([probability(e.evidence) for e in found])
    print(
        "| world | effects | log score by the other worlds | named at 0.5 or more: present | by the present weights |"
    )
    print("| --- | --- | --- | --- | --- |")
    for one in np.unique(world):
        mine, named = world == one, (world == one) & (p >= 0.5)
        cells = (
            one,
            int(mine.sum()),
            f"{log_score(p[mine], y[mine]):.3f}",
            f"{int(y[named].sum())}/{int(named.sum())}",
        )
        print("| " + " | ".join(map(str, (*cells, f"{log_score(stated[mine], y[mine]):.3f}"))) + " |")
    for low, high in pairwise(BIN_EDGES):
        mine = (p >= low) & (p <= high)
        if mine.any():
            print(f"{low:g} to {high:g}: stated {p[mine].mean():.2f}, present {int(y[mine].sum())} of {mine.sum()}")


def refusals(cases: Sequence[AnsweredCase]) -> dict[str, tuple[int, int]]:
    """Return by reason how many effects that were refused for it were present, and of how many.

    An effect with evidence has a probability of its own, unless its interval contains the null.
    """
    of, there = Counter[str](), Counter[str]()
    for case in cases:
        for c in case.answer.get("candidates", []):
            reason = c["reason"]
            if found := c.get("evidence"):
                reason = "interval-contains-null" if found["significance"] < Z95 else "supported"
            if reason != "supported":
                of[reason] += 1
                there[reason] += c["effect"] in case.effects
    return {reason: (there[reason], of[reason]) for reason in of}


def drawn(number: int) -> list[Example]:
    """Return effects that are there with the probability that the present weights state, of three worlds."""
    rng = np.random.default_rng(1)
    out = []
    for k in range(number):
        evidence = Evidence(rng.uniform(0.0, 1.0), 10.0 ** rng.uniform(0.0, 2.0), 10.0 ** rng.uniform(-1.5, 0.0))
        out.append(Example(f"world {k % 3}", evidence, bool(rng.random() < probability(evidence))))
    return out


def print_calibration(arguments: Sequence[str], *, is_small: bool) -> None:
    """Print the weights, the value of each term, the reliability, and the frequencies of refused effects."""
    if is_small:
        estimate("DRAWN", drawn(SMALL_CASES), complete=False)
        return
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("exams", nargs="*", type=Path)
    parser.add_argument("--answers", type=Path, help="the folder in which benchmarks.score has kept answers")
    asked = parser.parse_args(list(arguments))
    exams = [case for exam in asked.exams for case in exam_cases(exam)]
    cases = [*exams, *(scored_cases(asked.answers) if asked.answers else ())]
    print(f"{len(cases)} cases of {len({c.world for c in cases})} worlds")
    for name, complete in (("white_residual", True), ("discrepancy", False)):
        estimate(name, examples(cases, complete=complete), complete=complete)
    for reason, (there, of) in sorted(refusals(cases).items()):
        print(f"{reason}: {there} of {of}")


REPORTED = "as reported"
PENALTY = 2.0 / 0.05  # of an interval's distance from the truth, at 95 %
FITTED_SAMPLES = 60_000  # of a case
TRUE_FRICTION = {"Fc": "friction.coulomb", "visc": "friction.viscous"}  # in the truth of a rig by other hands


class KnownCase(NamedTuple):
    """A case: its folder, the effects of its rig, and the true values that are known."""

    folder: Path
    effects: tuple[str, ...]
    known: Mapping[str, float]


class Interval(NamedTuple):
    """One interval: the folder of its case, how it was made; over the truth the error of the estimate, the width of the
    interval and its distance from the truth.
    """

    world: str
    made: str
    error: float
    width: float
    distance: float

    @property
    def score(self) -> float:
        """The interval score."""
        return self.width + PENALTY * self.distance


def known_cases(folder: Path) -> Iterator[KnownCase]:
    """Yield the cases of an exam or of a rig whose effects are all in the catalogue."""
    if (folder / SEALED).is_dir():
        for path, truth in truths(folder):
            if truth["outside_the_catalogue"] is None:
                friction = {f"friction.{n}": v for n, v in truth["base"].items() if n in ("coulomb", "viscous")}
                yield _known_case(path, truth["baseline"], truth["hidden"], friction)
    for path in sorted(folder.glob("*/truth.json")):
        truth = json.loads(path.read_text())
        if not truth_of(truth).unknown:
            true = truth.get("true") or {}
            true = json.loads(true) if isinstance(true, str) else true
            friction = {name: true[key] for key, name in TRUE_FRICTION.items() if key in true}
            yield _known_case(path.parent, truth["baseline"], truth_of(truth).parameters, friction)


def _known_case(
    folder: Path, baseline: list[str], hidden: Mapping[str, Mapping[str, float]], friction: Any
) -> KnownCase:
    known = friction | {f"{e}.{n}": value for e, values in hidden.items() for n, value in values.items()}
    return KnownCase(folder, tuple(dict.fromkeys((*baseline, *hidden))), known)


def interval_rows(world: str, case: KnownCase) -> Iterator[Interval]:
    """Yield the intervals of one case."""
    with tempfile.TemporaryDirectory() as out:
        study = rigs.study_of(case.folder, Path(out), FITTED_SAMPLES)
        views = study.residual_models("train")
        found = fit_model(study.guess(), views, tuple(catalogue_with_sides()[name] for name in case.effects))
    fits: dict[str, Fit] = {"blocks of time": found, REPORTED: with_intervals(found, views)}
    for made, fit in fits.items():
        for e in fit.estimates:
            if e.name in case.known and case.known[e.name] and not e.at_bound:
                (low, high), true = e.ci95, case.known[e.name]
                distance = max(low - true, true - high, 0.0)
                row = Interval(world, made, *(abs(y / true) for y in (e.value - true, high - low, distance)))
                yield row
                if made == REPORTED and not e.name.startswith("friction."):
                    yield row._replace(made="as reported, of hidden effects")


def table_of_intervals(folders: list[Path]) -> None:
    """Print coverage, median width and score for each folder."""
    print(
        "| cases | interval | number | hold the truth | within 15 % | median width | score |\n"
        "| --- | --- | --- | --- | --- | --- | --- |"
    )
    for folder in folders:
        seen: list[Interval] = []
        for case in known_cases(folder):
            seen += interval_rows(folder.name, case)
            print(case.folder.name, len(seen), file=sys.stderr, flush=True)
        for made in dict.fromkeys(r.made for r in seen):
            mine = [r for r in seen if r.made == made]
            held, near = (np.mean(of) for of in ([r.distance == 0.0 for r in mine], [r.error <= CLOSE for r in mine]))
            width, score = np.median([r.width for r in mine]), np.exp(np.mean(np.log([r.score for r in mine])))
            shares = f"{100 * held:.0f} % | {100 * near:.0f} % | {100 * width:.2g} %"
            print(f"| {folder.name} | {made} | {len(mine)} | {shares} | {score:.3g} |")


CERTAIN = 0.9


class TrueEffect(NamedTuple):
    """One true effect of a case: its probability, the remaining variance, and what is decided on it."""

    case: str
    effect: str
    probability: float
    left: float
    reason: Reason

    @property
    def is_nameable(self) -> bool:
        """Whether the rules of the diagnosis would name the effect."""
        return self.reason == "supported"


def fit_of(bench: DiagnosisData, base: Fit, names: list[str]) -> Fit:
    """Return the better of the fits with these effects, added in either order."""
    orders = [names, names[::-1]] if len(names) > 1 else [names]
    ends = []
    for order in orders:
        found = base
        for name in order:
            found = fit_with_effect(found, bench.train, bench.effects[name])
        ends.append(found)
    return min(ends, key=lambda f: f.cost)


def true_effects(case: Path, truth: Truth) -> Iterator[TrueEffect]:
    """Yield the true effects of one case."""
    with tempfile.TemporaryDirectory() as out:
        study = rigs.study_of(case, Path(out), MAX_SAMPLES)
        train, test = (study.residual_models(use) for use in ("train", "test"))
        guess = study.guess()
        bench = DiagnosisData(
            train,
            test,
            study.available_effects,
            modelled_parts=guess.valve.covers,
            free_run_errors=FreeRunErrors(study.experiments),
            folds=() if test else folds_of(train),
        )
        base = fit_model(guess, train, study.effects)
        names = [n for n in [*sorted(truth.hidden), *sorted(truth.mild - truth.hidden)] if n in bench.effects]
        names = [
            n for n in names if bench.is_observable(bench.effects[n]) and n not in bench.fitted_model(base).effect_names
        ]
        last = bench.fitted_model(fit_of(bench, base, names))
        for effect in (bench.effects[n] for n in names if n in truth.hidden):
            (before,) = bench.refit_without(last, [effect])
            found = judge(bench, Term(bench.candidate(before, last, effect), ()), constrained=True)
            name = f"{case.parent.name} {case.name}"
            yield TrueEffect(name, effect.name, found.probability, found.evidence.left, found.decision.reason)


def table_of_limits(folders: list[Path]) -> None:
    """Print what could be named in the cases of the exams and rigs."""
    seen: list[TrueEffect] = []
    for folder in folders:
        for case, truth in truths(folder):
            if truth["hidden"] or truth.get("unknown"):
                seen += true_effects(case, truth_of(truth))
                print(case.name, len(seen), file=sys.stderr, flush=True)
    for row in sorted(seen, key=lambda r: r.probability):
        refused = "" if row.is_nameable else f", {row.reason}"
        print(f"{row.case} {row.effect}: probability {row.probability:.2f}, leaves {row.left:.2f}{refused}")
    cases = {r.case: [o.is_nameable for o in seen if o.case == r.case] for r in seen}
    print(
        f"{sum(r.is_nameable for r in seen)} of {len(seen)} effects can be named, "
        f"{sum(r.is_nameable and r.probability >= CERTAIN for r in seen)} at {CERTAIN:g} or more; "
        f"all effects of {sum(map(all, cases.values()))} of {len(cases)} cases"
    )


SECONDS = 60.0
SEED = 4919
LIMIT_CONDITIONS = ("usual", "5/3")
RELATIVE_ERRORS = {  # standard errors of what a user's pipeline identifies or states, relative to the value
    "coulomb": 0.1, "viscous": 0.1, "effective_area": 0.03, "effective_area_2": 0.03, "mass": 0.02,
    "dead_volume_1": 0.05, "dead_volume_2": 0.05, "supply": 0.01,
}  # fmt: skip
TOLERANCE = 0.02  # of a limit: the model's integrator and the rig's agree that closely
ROW_FILE = "row.json"  # of a finished case
MAX_DRAWN = 200  # cases that are drawn for each one of a stated kind


def print_limits(programmes: int = 300, seed: int = 49) -> None:
    """Play programmes on the exam's rig with parameters off by their intervals, and count exceeded limits."""
    rng, exceeded, played, refused = np.random.default_rng(seed), Counter[str](), 0, 0
    laboratories = [rigs.laboratory(condition) for condition in LIMIT_CONDITIONS]
    for number in range(programmes):
        laboratory = laboratories[number % len(laboratories)]
        benches, limits, safety = benches_within_limits(laboratory, rng)
        listed = [m for bench in benches for m in candidate_manoeuvres(bench, limits)]
        drawn = draw_programme(listed, SECONDS, safety, seed + number)
        real = replace(laboratory, parameters=off_by_interval(laboratory.parameters, rng))
        exceeded.update(played_violations(real, drawn, safety))
        played, refused = played + len(drawn), refused + len(safety.refused)
    print("| programmes | manoeuvres played | refused before | exceeded limits |\n| ---: | ---: | ---: | ---: |")
    kinds = ", ".join(f"{count} of {name}" for name, count in exceeded.items())
    print(f"| {programmes} | {played} | {refused} | {sum(exceeded.values())}{f' ({kinds})' if kinds else ''} |")


def benches_within_limits(laboratory: Laboratory, rng: np.random.Generator) -> tuple[list[Bench], Limits, Safety]:
    """Return the benches of a healthy axis, limits as a user may state them, and the check of its manoeuvres."""
    par = laboratory.parameters
    model = rigs.model_of(par)
    rig = replace(model.rig, valve_arrangement=model.rig.valve_arrangement or "one-chamber")
    benches = [replace(b, loop_range=LOOP_RANGE) for b in described_benches(rig, par.command_range)]
    stated = {
        "end_margin": par.stroke * rng.uniform(0.05, 0.3),
        "max_speed": rng.uniform(0.1, 1.0),
        "max_pressure": par.supply * rng.uniform(0.7, 1.1),
        "max_force": (par.supply - par.ambient) * par.piston_area_1 * rng.uniform(0.1, 1.0),
    }
    limits = limits_of(rig, benches, stated)
    off = {str(i): rigs.model_of(off_by_interval(par, rng)) for i in range(SHIFTED_BEST)}
    return benches, limits, Safety(rig, limits, {"exact": model} | off)


def off_by_interval(par: Parameters, rng: np.random.Generator) -> Parameters:
    """Return a rig whose parameters are off by two standard errors at most."""
    off = {
        name: getattr(par, name) * (1.0 + error * float(np.clip(rng.standard_normal(), -2.0, 2.0)))
        for name, error in RELATIVE_ERRORS.items()
    }
    return par._replace(**off)


def played_violations(laboratory: Laboratory, programme: Sequence[Manoeuvre], safety: Safety) -> Iterator[str]:
    """Play a programme on the rig from its file of commands; yield the quantity of each limit that is exceeded."""
    rows = [*recordings_of(programme, safety.models["exact"])]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "commands.csv"
        file.write_text(commands_csv(programme, rows), encoding="utf-8")
        takes = planned_recordings(laboratory, to_json(rows), read_commands(file)) if programme else []
    for take, one in zip(takes, programme, strict=True):
        assert isinstance(take.excitation, Excitation)
        truth = simulate_rig(laboratory.parameters, take.excitation)
        outcome = Outcome(truth["u"], {}, truth["p1"], truth["p2"], truth["x"], truth["v"])
        for found in violations(outcome, safety.limits, one.bench.rig):
            scale = one.bench.rig.stroke if found.quantity == "x" else abs(found.limit)
            if abs(found.value - found.limit) > TOLERANCE * (scale or 1.0):
                yield found.quantity


def planned_cases(cases: int, condition: str, seed: int, kind: str | None) -> list[PlannedCase]:
    """Return cases that hide one effect, on any kind of rig or a stated one."""
    drawn = plan_cases((4 if kind is None else MAX_DRAWN) * cases, 0, parse(condition), seed)
    return list(islice((p for p in drawn if len(p.hidden) == 1 and kind in (None, p.kind)), cases))


def print_decided(out: Path, wanted: Sequence[PlannedCase]) -> None:
    """Print how often the hidden effect is in the answer, and the false names, before and after a plan."""
    rows = []
    for number, planned in enumerate(wanted, 1):
        folder = out / f"case-{number:03d}"
        if not (folder / ROW_FILE).exists():
            shutil.rmtree(folder, ignore_errors=True)
            row = before_and_after(folder, planned)
            (folder / ROW_FILE).write_text(json.dumps(row), encoding="utf-8")
        rows.append(json.loads((folder / ROW_FILE).read_text(encoding="utf-8")))
        print(number, rows[-1], flush=True)
    print("\n| recordings | in the answer | false names |\n| --- | ---: | ---: |")
    for when in ("before", "after"):
        found, false = (sum(row[when][key] for row in rows) for key in ("found", "false"))
        print(f"| {when} | {found} of {len(rows)} | {false} |")


def before_and_after(folder: Path, planned: PlannedCase) -> dict[str, Any]:
    """Diagnose a case, record its plan on the same rig, and diagnose again."""
    asked = (planned.kind, planned.hidden, planned.outside, 1.0, planned.seed, planned.conditions)
    truth = truth_of(generate_case(folder, *asked))
    before = answer(folder, "diagnose")
    plan = json.loads(answer(folder, "plan", "--minutes", str(SECONDS / 60.0)))
    laboratory = prepare_case("case", *asked).laboratory
    par, commands = laboratory.parameters, read_commands(folder / "out" / "plan" / "commands.csv")
    load = par.constant_force + par.spring_stiffness * (0.5 * par.stroke - par.spring_rest)
    takes = planned_recordings(laboratory, plan["recordings"], commands, load)
    laboratory.record(folder / "raw", takes, np.random.default_rng([planned.seed, 49]))
    answer(folder, "plan", "--take", *(str(folder / "raw" / f"{take.name}.csv") for take in takes))
    after = answer(folder, "diagnose")
    counts = [judged(truth, {"exit": 0} | essence("diagnose", text)) for text in (before, after)]
    found = {when: {"found": c.right, "false": c.false} for when, c in zip(("before", "after"), counts, strict=True)}
    return {"hidden": planned.hidden, "plan": [r["kind"] for r in plan["recordings"]]} | found


def answer(folder: Path, command: str, *words: str) -> str:
    """Return what a command of the program answers to the pipeline of a folder, as JSON."""
    program = [sys.executable, "-m", "pneucli", command, str(folder / "pipeline.toml"), *words]
    code, text, *_ = measured([*program, "--out", str(folder / "out"), "--quiet", "--json"])
    if code not in (0, 1):
        raise RuntimeError(text)
    return text


def print_intervals(arguments: Sequence[str], *, is_small: bool) -> None:
    """Fit every case with its true effects, and print the table of intervals."""
    rigs.on_folders([*arguments, *([rigs.SMALL] if is_small else [])], table_of_intervals)


def print_limit(arguments: Sequence[str], *, is_small: bool) -> None:
    """Fit every case that hides effects, and print what could be named."""
    rigs.on_folders([*arguments, *([rigs.SMALL] if is_small else [])], table_of_limits)


def print_plan(arguments: Sequence[str], *, is_small: bool) -> None:
    """Print one of the tables of plans."""
    if is_small:
        print_limits(2)
    elif arguments[0] == "limits":
        print_limits(*map(int, arguments[1:]))
    else:
        out, cases, condition, *rest = arguments[1:]
        seed, kind = int(rest[0]) if rest else SEED, rest[1] if len(rest) > 1 else None
        print_decided(Path(out), planned_cases(int(cases), condition, seed, kind))


TABLES: dict[str, Callable[..., object]] = {
    "calibration": print_calibration,
    "intervals": print_intervals,
    "limit": print_limit,
    "plan": print_plan,
}


def main(arguments: list[str]) -> int:
    """Print one of the tables, or of each a small one."""
    return rigs.print_tables(TABLES, arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
