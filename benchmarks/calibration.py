"""Estimate the logistic model of ``pneucli.diagnose.calibration``, and judge it by worlds that it has not seen.

    pneucli exam A --condition messy --cases 60 --nulls 30 --seed 5550123
    pneucli exam C --condition imposed+messy --cases 24 --nulls 12 --seed 5550125
    (each once more with --answer)
    python -m benchmarks.score rigs-plc rigs-seal rigs-bench real --full
    python -m benchmarks.calibration --answers build/score/DIGEST A C

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
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit

from benchmarks.worlds import worlds
from pneucli.diagnose.calibration import Evidence, probability
from pneucli.exam.grading import BIN_EDGES, graded_cases
from pneucli.quantities import Z95

Array = NDArray[np.float64]
RIDGE = 0.3  # of each weight but the constant
SMALL_CASES = 30
FEATURES = {
    True: ("significance", "relative_size", "free_run_share"),
    False: ("relative_size", "remaining_variance"),
}
WORLDS = ("rigs-plc", "rigs-seal", "rigs-bench", "real")  # of the score
HARD_CONSTRAINTS = frozenset(
    {"interval-contains-null", "vanishes", "at-bound", "below-resolution", "contradicted-by-reading", "cannot-show",
     "raises-error", "varies-with-horizon"}
)  # fmt: skip


class Case(NamedTuple):
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


def exam_cases(exam: Path) -> Iterator[Case]:
    """Yield the answered cases of an exam."""
    for g in graded_cases(exam, exam / "answers"):
        if "candidates" in g.answer:
            yield Case(exam.name, g.case, frozenset(g.hidden), g.answer)


def scored_cases(answers: Path) -> Iterator[Case]:
    """Yield the cases of rigs by other hands and of real recordings that ``benchmarks.score`` has answered."""
    for world in worlds(sys.executable, answers, full=True):
        for case in world.cases() if world.name in WORLDS else ():
            kept = answers / world.name / case.name / "diagnose.json"
            if case.truth.names_known and kept.exists() and (text := kept.read_text(encoding="utf-8")):
                answer = json.loads(text)
                yield Case(world.name, case.name, case.truth.hidden, answer, case.truth.mild)


def examples(cases: Sequence[Case], *, complete: bool) -> list[Example]:
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


def refusals(cases: Sequence[Case]) -> dict[str, tuple[int, int]]:
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


def main(arguments: list[str]) -> None:
    """Print the weights, the value of each term, the reliability, and the frequencies of refused effects."""
    if "--small" in arguments:
        estimate("DRAWN", drawn(SMALL_CASES), complete=False)
        return
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("exams", nargs="*", type=Path)
    parser.add_argument("--answers", type=Path, help="the folder in which benchmarks.score has kept answers")
    asked = parser.parse_args(arguments)
    exams = [case for exam in asked.exams for case in exam_cases(exam)]
    cases = [*exams, *(scored_cases(asked.answers) if asked.answers else ())]
    print(f"{len(cases)} cases of {len({c.world for c in cases})} worlds")
    for name, complete in (("white_residual", True), ("discrepancy", False)):
        estimate(name, examples(cases, complete=complete), complete=complete)
    for reason, (there, of) in sorted(refusals(cases).items()):
        print(f"{reason}: {there} of {of}")


if __name__ == "__main__":
    main(sys.argv[1:])
