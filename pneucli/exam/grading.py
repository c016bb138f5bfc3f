"""Grade the answers to an exam, also by condition: detections, accuracy, probabilities and causes of failure."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

from pneucli.errors import InputError
from pneucli.exam.cases import EXAM_FILE, SEALED_FOLDER
from pneucli.exam.graded_case import GradedCase
from pneucli.exam.grades import Bin, ConditionCounts, Confusion, Grades, Reliability, RunTimes, Share, Spread

BIN_EDGES = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0)
MIN_PROBABILITY = 1e-3  # exams have some hundred cases: they cannot check a smaller one
SECONDS_FILE = "seconds.json"


def reliability(graded: Sequence[GradedCase]) -> Reliability | None:
    """Return a reliability table, the Brier score and the mean logarithmic score of all fitted effects.

    None where no answer states a probability.

    References:
        G. Brier, Mon. Weather Rev. 78 (1950) 1; I. Good, J. R. Stat. Soc. B 14 (1952) 107.

    """
    stated = [(min(max(p, 0.0), 1.0), true) for g in graded for p, true in g.stated_probabilities]
    if not stated:
        return None
    bins = []
    for low, high in pairwise(BIN_EDGES):
        in_bin = [(p, true) for p, true in stated if low <= p < high or p == high == 1.0]
        if in_bin:
            present = sum(true for _, true in in_bin)
            bins.append(Bin(low, high, _mean([p for p, _ in in_bin]), present, len(in_bin)))
    bounded = [(min(max(p, MIN_PROBABILITY), 1.0 - MIN_PROBABILITY), true) for p, true in stated]
    return Reliability(
        bins,
        brier=_mean([(p - true) ** 2 for p, true in stated]),
        log=_mean([-math.log(p if true else 1.0 - p) for p, true in bounded]),
        of=len(stated),
    )


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values)


def grade(directory: Path, answers: Path) -> Grades:
    """Grade ``answers/CASE.json`` against the sealed truths (or ``CASE/truth.json``) below ``directory``.

    A share is given as right, of, share and its exact 95 % interval (Clopper and Pearson), for the exam and for each
    condition. A case without an answer is listed and counts as wrong. Raises InputError where there is no truth or an
    answer cannot be read.
    """
    graded = graded_cases(directory, answers)
    sealed = directory / SEALED_FOLDER / EXAM_FILE
    exam = json.loads(sealed.read_text(encoding="utf-8")) if sealed.exists() else None
    return report(graded, exam, sorted({str(g.answer["program"]) for g in graded if "program" in g.answer}))


def report(
    graded: Sequence[GradedCase], exam: Mapping[str, Any] | None = None, answered_by: Sequence[str] = ()
) -> Grades:
    """Count all cases and those of each condition, and make the confusion matrix."""
    groups = {name: [g for g in graded if name in g.conditions] for each in graded for name in each.conditions}
    return Grades(
        exam=exam,
        answered_by=answered_by,
        schema="pneucli/exam/1",
        **_counts(graded),
        conditions=[ConditionCounts(condition=name, **_counts(cases)) for name, cases in sorted(groups.items())],
        confusion=_confusion(graded),
    )


def graded_cases(directory: Path, answers: Path) -> list[GradedCase]:
    """All cases with their answers. Raises InputError as ``grade`` does."""
    seconds = answers / SECONDS_FILE
    taken: dict[str, float] = json.loads(seconds.read_text(encoding="utf-8")) if seconds.exists() else {}
    return [
        GradedCase(case, truth, _answer(answers / f"{case}.json"), taken.get(case))
        for case, truth in _truths(directory).items()
    ]


def _counts(graded: Sequence[GradedCase]) -> dict[str, Any]:
    with_effects = [g for g in graded if g.hidden]
    nulls = [g for g in graded if g.is_null]
    disturbed = [g for g in graded if g.uncatalogued_effect]
    accurate = [right for g in with_effects for right in g.parameters_within_tolerance]
    covered = [covers for g in with_effects for covers in g.intervals_cover_truth]
    stated = [right for g in graded for right in g.stated_within_tolerance]
    stated_covered = [covers for g in graded for covers in g.stated_intervals_cover_truth]
    without_area = [g for g in graded if not g.truth.get("command_sets_area", True)]
    confident_namings = [true for g in graded for true in g.confident_namings]
    confident_detections = [found for g in with_effects for found in g.confident_detections]
    return {
        "cases": len(graded),
        "unanswered": [g.case for g in graded if g.verdict == "no answer"],
        "shares": {
            "verdict right": _share_correct(graded, lambda g: g.verdict_is_correct),
            "true effects in the answer": _share_correct(with_effects, lambda g: g.hidden <= g.answer_set),
            "exactly the true effects": _share_correct(with_effects, lambda g: g.hidden == g.missing),
            "nulls named nothing": _share_correct(nulls, lambda g: g.is_correct_null),
            "clean nulls named nothing": _share_correct(
                [g for g in nulls if not g.has_small_effects], lambda g: g.is_correct_null
            ),
            "messy nulls named nothing": _share_correct(
                [g for g in nulls if g.has_small_effects], lambda g: g.is_correct_null
            ),
            "unknown flagged": _share_correct(disturbed, lambda g: g.verdict == "unexplained"),
            "unknown wrongly named": _share_correct(disturbed, lambda g: bool(g.missing)),
            "inconclusive": _share_correct(graded, lambda g: g.verdict == "inconclusive"),
            "parameters within 15 %": proportion(sum(accurate), len(accurate)),
            "intervals that hold the truth": proportion(sum(covered), len(covered)),
            "stated effects: parameters within 15 %": proportion(sum(stated), len(stated)),
            "stated effects: intervals that hold the truth": proportion(sum(stated_covered), len(stated_covered)),
            "told that the command sets no area": _share_correct(without_area, lambda g: g.is_source_recognised),
            "named with 0.9 or more, and true": proportion(sum(confident_namings), len(confident_namings)),
            "true effects named with 0.9 or more": proportion(sum(confident_detections), len(confident_detections)),
            "unknown flagged in its subsystem, over its signal": _share_correct(
                disturbed, lambda g: g.verdict_is_correct
            ),
        },
        "calibration": reliability(graded),
        "set_size": _summary([size for g in with_effects for size in g.set_sizes]),
        "error_after": _summary([g.final_error for g in with_effects if g.hidden == g.missing]),
        "seconds": _run_times(graded),
        "failures": dict(sorted(Counter(g.failure_cause for g in graded if g.failure_cause).items())),
    }


def _truths(directory: Path) -> dict[str, dict[str, Any]]:
    sealed = sorted((directory / SEALED_FOLDER).glob("*.json"))
    files = {path.stem: path for path in sealed if path.name != EXAM_FILE}
    files = files or {path.parent.name: path for path in sorted(directory.glob("*/truth.json"))}
    if not files:
        raise InputError(
            str(directory), "no sealed truths", "the folder that pneucli exam wrote", "write an exam first", code="E007"
        )
    return {case: json.loads(path.read_text(encoding="utf-8")) for case, path in files.items()}


def _answer(path: Path) -> dict[str, Any]:
    if not path.exists():
        return {"verdict": "no answer", "missing": []}
    try:
        answer = json.loads(path.read_text(encoding="utf-8"))
    except json.JSONDecodeError as error:
        raise InputError(
            f"{path}, line {error.lineno}", "not JSON", "what pneucli diagnose --json prints", code="E007"
        ) from error
    if not isinstance(answer, dict) or not {"verdict", "missing"} <= set(answer):
        raise InputError(
            str(path), "no verdict or no missing in it", "what pneucli diagnose --json prints", code="E007"
        )
    return answer


def _summary(values: Sequence[float | None]) -> Spread | None:
    there = [value for value in values if value is not None]
    return Spread(float(np.median(there)), float(max(there))) if there else None


def _run_times(graded: Sequence[GradedCase]) -> RunTimes | None:
    """Return the median and the maximum of the processor seconds; None where the answers have none."""
    noted = {g.case: g.seconds for g in graded if g.seconds is not None}
    if not noted:
        return None
    slowest = max(noted, key=noted.__getitem__)
    return RunTimes(float(np.median(list(noted.values()))), noted[slowest], slowest)


def _share_correct(cases: Sequence[GradedCase], is_right: Callable[[GradedCase], bool]) -> Share:
    return proportion(sum(is_right(case) for case in cases), len(cases))


def proportion(right: int, of: int) -> Share:
    """Return a share with its exact 95 % interval; None for both of no cases."""
    if not of:
        return Share(0, 0, None, None)
    interval = binomtest(right, of).proportion_ci(0.95, method="exact")
    return Share(right, of, right / of, [float(interval.low), float(interval.high)])


def _confusion(graded: Sequence[GradedCase]) -> list[Confusion]:
    counts = Counter((g.truth_label, g.answer_label) for g in graded)
    return [Confusion(hidden, label, n) for (hidden, label), n in sorted(counts.items())]
