"""What follows from the weights of findings: what is left out, and which doubts are told first."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from pneucli.messages.ingest import Implausible
from pneucli.plausibility.rig_check import Finding

# by kind of repair: what would mend the recording, or say how it is to be read
_MENDS = {
    "mark": "state missing = [...] in [signals] {signal}, or missing = [] where these numbers were measured",
    "saturated": "use a sensor of larger range, or take another stretch with from and to in [[recordings]] {recording}",
    "plateau": "check the range of the sensor; where it ends there, cut with from and to in [[recordings]] {recording}",
    "roll-over": "state offset in [signals] {signal} where x = 0 is not where chamber 1 is smallest",
    "jumps": "state what the position is, or cut the recording with from and to in [[recordings]] {recording}",
    "frozen": "look at the logger and the sensor of {signal}",
    "held": "state hold = true in [signals] {signal} if its value really stays between the samples",
    "spread": "export the stamps with more digits",
    "jitter": 'stamp the samples where they are taken; of an even logger write time = {{ expression = "row / RATE" }}',
    "words": "check what these cells should hold, in the file of [[recordings]] {recording}",
    "gap": "where the gap parts two runs, cut there with from and to in [[recordings]] {recording}",
    "counter": "export the stamps with more digits, or from a clock that does not wrap",
}
REPAIRS = frozenset(_MENDS)  # checks of these names say how a recording was read
GAPS = frozenset({"missing", "motionless", "sampling", "samples"})  # less than could have been recorded, nothing false
DERIVATIVES = frozenset({"v", "a"})  # follow from x: a dead one is left out alone


def contradictions(findings: Iterable[Implausible]) -> list[Implausible]:
    """Return the findings that stop what depends on their recording, of the answer of ``ingest``.

    >>> contradictions([Implausible("speed", "x", "run", "x jumps", "check it", 4.0)])
    []
    """
    return [one for one in findings if one.weight == "contradiction"]


def contradicted_parts(findings: Iterable[Implausible]) -> list[tuple[str, str | None]]:
    """Return what contradictions leave out: pairs of recording and signal, which is None for all of its signals.

    >>> contradicted_parts([Implausible("silent", "a", "run", "a stays", "leave it out", 7.0, weight="contradiction")])
    [('run', 'a')]
    """
    found = contradictions(findings)
    dead = {(one.recording, one.signal if _is_dead_derivative(one) else None) for one in found}
    return sorted(dead, key=lambda part: (part[0], part[1] or ""))


def _is_dead_derivative(finding: Implausible) -> bool:
    return finding.check == "silent" and finding.signal in DERIVATIVES


def rank(finding: Implausible) -> int:
    """Return the place of a finding: contradictions, doubts that could change an answer, and what only notes a loss.

    The last say how a recording was read or what it lacks.
    """
    return 0 if finding.weight == "contradiction" else 1 if finding.check not in REPAIRS | GAPS else 2


def repair_findings(repairs: Iterable[tuple[str, str, str, str, int, float]]) -> Iterator[Finding]:
    """Yield a finding for each repair that bears on what a recording says; its excess is its count.

    Args:
        repairs: recording, signal, kind, message, count, and share of the samples, of each repair.

    """
    for recording, signal, kind, message, count, share in repairs:
        if kind in _MENDS:
            mend = _MENDS[kind].format(signal=signal, recording=recording)
            yield Finding(kind, signal, recording, message, mend, float(count), share)
