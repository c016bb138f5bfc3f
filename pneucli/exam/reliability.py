"""Whether stated probabilities are right: of what is given with 0.9, nine of ten should be there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from pneucli.exam.graded_case import GradedCase

BIN_EDGES = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0)
MIN_PROBABILITY = 1e-3  # no exam is large enough to tell more


def reliability(graded: Sequence[GradedCase]) -> dict[str, Any] | None:
    """Return a reliability table, Brier's score and the mean logarithmic score of all effects that were fitted.

    None where no answer states a probability. Sources: G. Brier, Mon. Weather Rev. 78 (1950) 1; I. Good, J. R. Stat.
    Soc. B 14 (1952) 107.
    """
    said = [(min(max(p, 0.0), 1.0), true) for g in graded for p, true in g.stated_probabilities]
    if not said:
        return None
    bins = []
    for low, high in pairwise(BIN_EDGES):
        mine = [(p, true) for p, true in said if low <= p < high or p == high == 1.0]
        if mine:
            there = sum(true for _, true in mine)
            bins.append(
                {"from": low, "to": high, "stated": _mean([p for p, _ in mine]), "there": there, "of": len(mine)}
            )
    held = [(min(max(p, MIN_PROBABILITY), 1.0 - MIN_PROBABILITY), true) for p, true in said]
    return {
        "bins": bins,
        "brier": _mean([(p - true) ** 2 for p, true in said]),
        "log": _mean([-math.log(p if true else 1.0 - p) for p, true in held]),
        "of": len(said),
    }


def reliability_table(result: dict[str, Any] | None) -> list[str]:
    """Return the reliability table as Markdown lines; none where nothing was stated."""
    if result is None:
        return []
    lines = ["", f"Probabilities: Brier score {result['brier']:.3f}, log score {result['log']:.3f}, of {result['of']}"]
    lines += ["", "| stated | mean | there | of |", "| --- | ---: | ---: | ---: |"]
    return lines + [
        f"| {b['from']:g} to {b['to']:g} | {b['stated']:.2f} | {b['there']} | {b['of']} |" for b in result["bins"]
    ]


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values)
