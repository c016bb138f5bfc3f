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


def contradicted_signals(findings: Iterable[FindingAnswer]) -> set[tuple[str, str]]:
    """Return the pairs of recording and signal of which only the signal is left out.

    >>> contradicted_signals([{"check": "silent", "signal": "a", "recording": "run", "weight": "contradiction"}])
    {('run', 'a')}
    """
    dead = [one for one in contradictions(findings) if one["check"] == "silent" and one["signal"] in DERIVATIVES]
    return {(one["recording"], one["signal"]) for one in dead}


def contradicted_recordings(findings: Iterable[FindingAnswer]) -> set[str]:
    """Return the names of the recordings that are left out."""
    found = contradictions(findings)
    alone = contradicted_signals(found)
    return {one["recording"] for one in found if (one["recording"], one["signal"]) not in alone}


def rank(finding: FindingAnswer) -> int:
    """Return the place of a finding: contradictions, doubts that could change an answer, and what only notes a loss.

    The last say how a recording was read or what it lacks.
    """
    return 0 if finding["weight"] == "contradiction" else 1 if finding["check"] not in REPAIRS | GAPS else 2
