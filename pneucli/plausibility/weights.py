"""What follows from the weights of findings: what is left out, and which doubts are told first."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from pneucli.plausibility.repaired import REPAIRS

GAPS = frozenset({"missing", "motionless", "sampling", "samples"})  # less than could have been recorded, nothing false
DERIVATIVES = frozenset({"v", "a"})  # follow from x: a dead one is left out alone

FindingAnswer = Mapping[str, Any]


def contradictions(findings: Iterable[FindingAnswer]) -> list[FindingAnswer]:
    """Return the findings that stop what depends on their recording, of the answer of ``ingest``.

    >>> contradictions([{"check": "speed", "weight": "doubt"}])
    []
    """
    return [one for one in findings if one["weight"] == "contradiction"]


def contradicted_parts(findings: Iterable[FindingAnswer]) -> list[tuple[str, str | None]]:
    """Return what contradictions leave out: pairs of recording and signal, which is None for all of its signals.

    >>> contradicted_parts([{"check": "silent", "signal": "a", "recording": "run", "weight": "contradiction"}])
    [('run', 'a')]
    """
    found = contradictions(findings)
    dead = {(one["recording"], one["signal"] if _is_dead_derivative(one) else None) for one in found}
    return sorted(dead, key=lambda part: (part[0], part[1] or ""))


def _is_dead_derivative(finding: FindingAnswer) -> bool:
    return finding["check"] == "silent" and finding["signal"] in DERIVATIVES


def rank(finding: FindingAnswer) -> int:
    """Return the place of a finding: contradictions, doubts that could change an answer, and what only notes a loss.

    The last say how a recording was read or what it lacks.
    """
    return 0 if finding["weight"] == "contradiction" else 1 if finding["check"] not in REPAIRS | GAPS else 2
