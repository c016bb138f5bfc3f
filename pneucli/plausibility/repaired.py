"""What ``ingest`` repaired or noticed in the raw numbers, as findings that stay in every later answer."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

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
    "counter": "export the stamps with more digits, or from a clock that does not wrap",
}
REPAIRS = frozenset(_MENDS)  # checks of these names say how a recording was read, not that it cannot be true

GAPS = frozenset({"missing", "motionless"})  # less than could have been recorded (a piston on its stop), nothing false


def impossible_findings(findings: Iterable[Mapping[str, str]]) -> list[Mapping[str, str]]:
    """Return the findings with which recordings and the stated rig cannot both be true.

    Args:
        findings: Findings as the answer of ``ingest`` has them.

    >>> impossible_findings([{"check": "speed"}, {"check": "missing"}, {"check": "roll-over"}])
    [{'check': 'speed'}]
    """
    return [one for one in findings if one["check"] not in REPAIRS | GAPS]


def repair_findings(repairs: Iterable[tuple[str, str, str, str]]) -> Iterator[Finding]:
    """Yield a finding for each repair that bears on what a recording says.

    Args:
        repairs: recording, signal, kind and message of each repair.

    """
    for recording, signal, kind, message in repairs:
        if kind in _MENDS:
            mend = _MENDS[kind].format(signal=signal, recording=recording)
            yield Finding(kind, signal, recording, message, mend)
