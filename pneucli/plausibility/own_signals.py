"""Mends of a command whose sign is wrong in some recordings alone: their ``[recordings.signals]``, not ``[signals]``.

A log of discharges often holds the command without its sign. The sign of a sensor is the same in every recording.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pneucli.plausibility.rig_check import Finding, is_inactive
from pneucli.quantities import COMMANDS
from pneucli.recording import Recording


def with_own_signals(findings: Sequence[Finding], recordings: Sequence[Recording]) -> list[Finding]:
    """Return findings; the mend of a command that is not reversed wherever it changes is for its recording alone."""
    reversed_in = {(one.signal, one.recording) for one in findings if one.check == "direction"}
    common = {
        signal: all((signal, one.name) in reversed_in for one in recordings if _changes(signal, one))
        for signal, _ in reversed_in
    }
    return [
        replace(one, mend=_for_one_recording(one))
        if one.check == "direction" and one.signal in COMMANDS and not common[one.signal]
        else one
        for one in findings
    ]


def _changes(signal: str, recording: Recording) -> bool:
    return signal in recording and not is_inactive(recording[signal])


def _for_one_recording(one: Finding) -> str:
    own = f"in [recordings.signals] {one.signal} of {one.recording}"
    return (
        f"{one.mend.replace(f'in [signals] {one.signal}', own)}; not in [signals], which holds for the other recordings"
    )
