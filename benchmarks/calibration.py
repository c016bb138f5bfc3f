"""Estimate the logistic model of ``pneucli.diagnose.calibration`` on answered exams, and measure its calibration.

    pneucli exam M1 --condition messy --cases 120 --nulls 40 --seed 918273
    pneucli exam M2 --condition uneven --condition messy --cases 50 --nulls 30 --seed 60211
    pneucli exam I1 --condition imposed+messy --cases 60 --nulls 40 --seed 77123
    (each once more with --answer; M1 as it was written before a spool that sticks kept its lag)
    for NAME in zillen-o-ring zillen-pk zillen-kdn zillen-x-ring257 emps:
        pneucli diagnose pipelines/NAME.toml --json > REAL/NAME.json
    python -m benchmarks.calibration --anew --real REAL M1 M2 I1

gave a first model with an unmodelled effect present. Exams that were answered with it have updated it:

    pneucli exam M3 --condition messy --cases 70 --nulls 150 --seed 3362281473
    pneucli exam M4 --condition uneven --cases 60 --nulls 40 --seed 3362281473
    pneucli exam I2 --condition imposed+messy --cases 60 --nulls 40 --seed 2097309982
    pneucli exam M5 --condition messy --cases 70 --nulls 150 --seed 2434437604
    pneucli exam M6 --condition messy --cases 70 --nulls 150 --seed 3115428340
    pneucli exam M7 --condition messy --condition uneven --cases 45 --nulls 40 --seed 2997824875
    python -m benchmarks.calibration --real REAL M3 M4 I2 M5 M6 M7

The model for white residuals rests on earlier exams, whose answers lack ``left``, which it does not use:

    pneucli exam E1 --condition usual --condition messy --cases 60 --nulls 150 --seed 334663411
    pneucli exam E2 --condition usual --condition messy --cases 24 --nulls 12 --seed 3061778563
    pneucli exam E3 --size 0.3333 --cases 12 --nulls 0 --seed 3061778563
    pneucli exam E4 --condition imposed+messy --condition imposed --cases 20 --nulls 8 --seed 9
    pneucli exam E5 --condition imposed+rough --cases 30 --nulls 10 --seed 5501
    pneucli exam E6 --size 0.3333 --cases 60 --nulls 0 --seed 334663411
    pneucli exam E7 --cases 20 --nulls 0 --seed 334663411 with a --condition for each of the first twelve, and
    pneucli exam E8 ..., E9 ... for the others, in the order of the table in docs/development/experiments.md

The weights are shrunk toward those that they update (``--anew``: toward 0), and scored by leave-one-case-out
cross-validation. The printed JSON goes into ``pneucli/diagnose/calibration.json``.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit

from pneucli.diagnose.calibration import (
    EFFECT_INTERCEPTS,
    WEIGHTS_DISCREPANCY,
    WEIGHTS_WHITE_RESIDUAL,
    Evidence,
    probability,
)
from pneucli.exam.graded_case import GradedCase
from pneucli.exam.grading import graded_cases
from pneucli.exam.reliability import BIN_EDGES

Array = NDArray[np.float64]
RIDGES = (0.3, 1.0, 3.0, 10.0, 30.0)
SMALL_CASES = 30
OF_EFFECTS = (0.3, 1.0, 3.0)  # the same of the weights of single effects
ROUNDED = 0.1  # a weight of an effect that is smaller is not stated
FEATURES = {
    True: ("significance", "relative_size", "free_run_share"),
    False: ("significance", "relative_size", "remaining_share", "free_run_share"),
}


# what was published of real recordings (shared/real/README.md): friction that grows with the pressure, a mean force of
# 1.3 % of p A (scale of load cell or area), directions that differ
PUBLISHED = {
    "zillen-o-ring": {"pressure-friction", "pressure-scale", "friction-asymmetry"},
    "zillen-pk": {"pressure-friction", "pressure-scale", "friction-asymmetry"},
    "zillen-kdn": {"pressure-friction", "pressure-scale", "friction-asymmetry"},
    "zillen-x-ring257": {"pressure-friction", "pressure-scale", "friction-asymmetry"},
    "emps": {"friction-asymmetry"},
}


def real(folder: Path) -> list[GradedCase]:
    """Return the answers to real recordings as cases, with what was published of them."""
    cases = []
    for name, effects in PUBLISHED.items():
        truth = {"hidden": {e: {} for e in effects}, "outside_the_catalogue": "", "conditions": ["imposed"]}
        cases.append(GradedCase(name, truth, json.loads((folder / f"{name}.json").read_text()), None))
    return cases


def labelled_evidence(
    cases: Sequence[GradedCase], *, complete: bool
) -> tuple[list[Evidence], Array, NDArray[np.int64]]:
    """Return the evidence of added effects, whether the effect or an equivalent was present (n,), and the case (n,).

    Of cases with a white residual (``complete``), or of the others.
    """
    rows = [
        (evidence_of(g, c), is_there(g, c), i)
        for i, g in enumerate(cases)
        for c in g.answer.get("candidates", [])
        if c.get("evidence") and complete == (g.verdict != "unexplained")
    ]
    evidence, there, case = zip(*rows, strict=True) if rows else ((), (), ())
    return list(evidence), np.array(there, float), np.array(case)


def evidence_of(graded: GradedCase, candidate: dict) -> Evidence:  # type: ignore[type-arg]
    """Return the evidence of a candidate."""
    complete = graded.verdict != "unexplained"
    values = {name: value for name, value in candidate["evidence"].items() if name in Evidence._fields}
    equivalents = (candidate["effect"], *candidate["indistinguishable_from"])
    return Evidence(**{**values, "complete": complete, "effects": equivalents})


def parts_of(evidence: Sequence[Evidence], names: Sequence[str]) -> Array:
    """Return the share of each name in a set of equivalents (n, k); 0 where intercepts do not apply."""
    own = np.array([[not (e.complete or e.imposed)] for e in evidence])
    return own * np.array([[e.effects.count(name) / len(e.effects) for name in names] for e in evidence])


def is_there(graded: GradedCase, candidate: dict) -> bool:  # type: ignore[type-arg]
    """Whether a candidate or one of its equivalents is present."""
    return bool(graded.hidden & {candidate["effect"], *candidate["indistinguishable_from"]})


class Ridge(NamedTuple):
    """The shrinkage of the weights of the evidence, and of the intercepts of effects."""

    evidence: float
    effect: float

    def penalty(self, features: int, effects: int) -> Array:
        """Return the penalty of each weight (features + effects,); that of the constant is 0."""
        return np.array([0.0, *[self.evidence] * (features - 1), *[self.effect] * effects])


def fitted(x: Array, y: Array, penalty: Array, known: Array) -> Array:
    """Return the weights (k,) of the penalised logistic model, shrunk toward the ``known`` ones."""

    def cost(w: Array) -> tuple[float, Array]:
        z, off = x @ w, penalty * (w - known)
        value = float(np.sum(np.logaddexp(0.0, z) - y * z)) + 0.5 * float(off @ (w - known))
        return value, x.T @ (expit(z) - y) + off

    return np.asarray(minimize(cost, known, jac=True, method="BFGS").x)


def errors(x: Array, weights: Array, penalty: Array) -> Array:
    """Return the standard errors (k,) of the weights, from the curvature of the penalised likelihood."""
    p = expit(x @ weights)
    return np.asarray(np.sqrt(np.diag(np.linalg.pinv(x.T @ (x * (p * (1.0 - p))[:, None]) + np.diag(penalty)))))


def as_json(weights: Array, features: Sequence[str], error: Array) -> dict[str, dict[str, float]]:
    """Return weights and standard errors by feature, as ``calibration.json`` has them."""
    names = ("constant", *features)
    return {
        "weights": {n: round(float(w), 2) for n, w in zip(names, weights, strict=True)},
        "standard_errors": {n: round(float(e), 2) for n, e in zip(names, error, strict=True)},
    }


def left_out(x: Array, y: Array, case: NDArray[np.int64], penalty: Array, known: Array) -> Array:
    """Return the probability (n,) of each effect by the model of all other cases."""
    p = np.zeros(y.size)
    for one in np.unique(case):
        mine = case == one
        p[mine] = expit(x[mine] @ fitted(x[~mine], y[~mine], penalty, known))
    return p


def log_score(p: Array, y: Array) -> float:
    """Return the mean of -log of the probability of each outcome."""
    return float(-np.mean(np.log(np.clip(np.where(y > 0.0, p, 1.0 - p), 1e-4, 1.0))))


def refusals(cases: Sequence[GradedCase]) -> dict[str, tuple[int, int]]:
    """Return by reason how many effects without evidence that were refused for it were present, and of how many."""
    of, there = Counter[str](), Counter[str]()
    for g in cases:
        for c in g.answer.get("candidates", []):
            if not (c["supported"] or c.get("evidence")):
                of[c["reason"]] += 1
                there[c["reason"]] += c["effect"] in g.hidden
    return {reason: (there[reason], of[reason]) for reason in of}


def estimate(name: str, cases: Sequence[GradedCase], exams: int, *, complete: bool, anew: bool) -> None:
    """Print the weights, the value of each term, and the reliability; the first ``exams`` cases are of exams."""
    evidence, y, case = labelled_evidence(cases, complete=complete)
    if len(set(y)) < 2:
        return
    now, stated = (
        np.array(WEIGHTS_WHITE_RESIDUAL if complete else WEIGHTS_DISCREPANCY),
        np.array([probability(e) for e in evidence]),
    )
    names = [] if complete else sorted({*EFFECT_INTERCEPTS, *(one for e in evidence for one in e.effects)})
    x = np.column_stack([[e.features for e in evidence], parts_of(evidence, names)])
    known = np.array([*now, *(EFFECT_INTERCEPTS.get(name, 0.0) for name in names)]) * (not anew)
    penalties = [Ridge(a, b).penalty(now.size, len(names)) for a in RIDGES for b in (OF_EFFECTS if names else (1.0,))]
    penalty = min(penalties, key=lambda one: log_score(left_out(x, y, case, one, known), y))
    p = left_out(x, y, case, penalty, known)
    weights = fitted(x, y, penalty, known)
    print(f"{name}: {y.size} effects")
    print(json.dumps(as_json(weights[: now.size], FEATURES[complete], errors(x, weights, penalty)[: now.size])))
    print("shrunk by", sorted(set(penalty[1:].tolist())))
    of_effects = dict(zip(names, weights[now.size :], strict=True))
    print({one: round(float(w), 1) for one, w in of_effects.items() if abs(w) > ROUNDED})
    print(
        f"{int(y.sum())} effects were present; Brier {np.mean((p - y) ** 2):.3f}, "
        f"log score {log_score(p, y):.3f}, "
        "by leave-one-case-out cross-validation"
    )
    print(f"the present weights: log score {log_score(stated, y):.3f}")
    terms = [*FEATURES[complete], "effects"] if names else FEATURES[complete]
    for i, term in enumerate(terms, 1):
        kept = np.delete(np.arange(x.shape[1]), i if i < now.size else range(now.size, x.shape[1]))
        lesser = left_out(x[:, kept], y, case, penalty[kept], known[kept])
        print(f"without {term}: log score {log_score(lesser, y):.3f}")
    for low, high in pairwise(BIN_EDGES):
        mine = (p >= low) & (p <= high)
        if mine.any():
            print(f"{low:g} to {high:g}: stated {p[mine].mean():.2f}, present {int(y[mine].sum())} of {mine.sum()}")
    for i, one in zip(case, p, strict=True):
        if i >= exams:
            print(f"{cases[i].case}: {one:.2f}")


def drawn(number: int) -> list[GradedCase]:
    """Return cases of one candidate each, whose effect is there with the probability that the present weights state."""
    rng = np.random.default_rng(1)
    cases = []
    for k in range(number):
        evidence = {"share": rng.uniform(0.0, 1.0), "significance": 10.0 ** rng.uniform(0.0, 2.5),
                    "size": 10.0 ** rng.uniform(-1.5, 0.0), "left": 1.0, "imposed": False}  # fmt: skip
        candidate = {"effect": "stribeck", "indistinguishable_from": [], "supported": True, "evidence": evidence}
        stated = probability(Evidence(**evidence, complete=True, effects=("stribeck",)))
        truth = {"hidden": {"stribeck": {}} if rng.random() < stated else {}, "outside_the_catalogue": ""}
        answer = {"verdict": "missing-effect", "candidates": [candidate]}
        cases.append(GradedCase(f"case-{k:03d}", truth, answer, None))
    return cases


def main(arguments: list[str]) -> None:
    """Print the weights, the value of each term, the reliability, and the frequencies of refused effects."""
    if "--small" in arguments:
        estimate("COMPLETE", drawn(SMALL_CASES), SMALL_CASES, complete=True, anew=True)
        return
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("exams", nargs="+", type=Path)
    parser.add_argument("--real", type=Path, help="folder with the answers to real recordings")
    parser.add_argument("--anew", action="store_true", help="do not use the present weights")
    asked = parser.parse_args(arguments)
    exams = [g for exam in asked.exams for g in graded_cases(exam, exam / "answers") if "candidates" in g.answer]
    recorded = real(asked.real) if asked.real else []
    print(f"{len(exams)} cases of exams, {len(recorded)} real ones")
    for name, complete in (("white_residual", True), ("discrepancy", False)):
        estimate(name, [*exams, *recorded], len(exams), complete=complete, anew=asked.anew)
    for reason, (there, of) in sorted(refusals(exams).items()):
        print(f"{reason}: {there} of {of}")


if __name__ == "__main__":
    main(sys.argv[1:])
