"""Check stated probabilities: of the effects stated with 0.9, nine of ten should be present."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from pneucli.exam.graded_case import GradedCase

BIN_EDGES = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0)
MIN_PROBABILITY = 1e-3  # exams have some hundred cases: they cannot check a smaller one


def reliability(graded: Sequence[GradedCase]) -> dict[str, Any] | None:
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
            bins.append(
                {"from": low, "to": high, "stated": _mean([p for p, _ in in_bin]), "there": present, "of": len(in_bin)}
            )
    bounded = [(min(max(p, MIN_PROBABILITY), 1.0 - MIN_PROBABILITY), true) for p, true in stated]
    return {
        "bins": bins,
        "brier": _mean([(p - true) ** 2 for p, true in stated]),
        "log": _mean([-math.log(p if true else 1.0 - p) for p, true in bounded]),
        "of": len(stated),
    }


def reliability_table(result: dict[str, Any] | None) -> list[str]:
    """Return the reliability table as Markdown lines; none where no probability was stated."""
    if result is None:
        return []
    lines = ["", f"Probabilities: Brier score {result['brier']:.3f}, log score {result['log']:.3f}, of {result['of']}"]
    lines += ["", "| stated | mean | there | of |", "| --- | ---: | ---: | ---: |"]
    return lines + [
        f"| {b['from']:g} to {b['to']:g} | {b['stated']:.2f} | {b['there']} | {b['of']} |" for b in result["bins"]
    ]


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values)
