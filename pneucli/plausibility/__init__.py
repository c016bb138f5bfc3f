"""Whether recordings and the stated rig can be true together: looked at before anything is fitted.

A finding is a contradiction where what the file states and a law of physics rule out what was recorded, and a doubt
where it is unusual (:mod:`pneucli.plausibility.rig_check`).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from pneucli.plausibility.detectors import detectors
from pneucli.plausibility.rig_check import Finding, RigCheck, is_inactive
from pneucli.plausibility.signal_summary import summarize_signal, without_empty_signals
from pneucli.quantities import COMMANDS
from pneucli.recording import Calibration, Recording, Rig


def with_own_signals(findings: Sequence[Finding], recordings: Sequence[Recording]) -> list[Finding]:
    """Return findings; the mend of a command that is not reversed wherever it changes is for its recording alone.

    A log of discharges often holds the command without its sign. The sign of a sensor is the same in every recording.
    """
    reversed_in = {(one.signal, one.recording) for one in findings if one.check == "direction"}
    common = {
        signal: all(
            (signal, one.name) in reversed_in for one in recordings if signal in one and not is_inactive(one[signal])
        )
        for signal, _ in reversed_in
    }
    return [
        replace(one, mend=_for_one_recording(one))
        if one.check == "direction" and one.signal in COMMANDS and not common[one.signal]
        else one
        for one in findings
    ]


def _for_one_recording(one: Finding) -> str:
    own = f"in [recordings.signals] {one.signal} of {one.recording}"
    return (
        f"{one.mend.replace(f'in [signals] {one.signal}', own)}; not in [signals], which holds for the other recordings"
    )


__all__ = ["Finding", "findings", "summarize_signal", "without_empty_signals"]

THREADS = 2  # checks side by side: numpy lets others run while it sums over a long recording


def findings(
    recordings: Sequence[Recording],
    rig: Rig,
    stated: Mapping[str, Collection[str]],
    calibrations: Mapping[str, Calibration] | None = None,
) -> list[Finding]:
    """Return what is odd or cannot be true, by check and in the recordings' order.

    ``stated`` names, by recording, the signals that the pipeline file states as held; ``calibrations`` has those of
    the signals that state one.
    """
    bench = RigCheck([without_empty_signals(one) for one in recordings], rig, stated, calibrations or {})
    series = replace(bench, recordings=[one for one in bench.recordings if not one.kind.steady])
    looked_at = ((one.find, bench if one.steady else series) for one in detectors())
    checks = [(find, on) for find, on in looked_at if on.recordings]

    def findings_of(check: Callable[[RigCheck], Iterator[Finding]], on: RigCheck) -> list[Finding]:
        with np.errstate(all="ignore"):  # other checks report numbers that overflow
            return [*check(on)]

    with ThreadPoolExecutor(THREADS) as threads:
        found = [finding for own in threads.map(findings_of, *zip(*checks, strict=True)) for finding in own]
    return with_own_signals([*_empty(recordings), *found], bench.recordings)


def _empty(recordings: Sequence[Recording]) -> Iterator[Finding]:
    for one in recordings:
        for name in [name for name in one.signals if name not in without_empty_signals(one)]:
            mend = f"check the column in [signals] {name}, or leave it out of take in [[recordings]] {one.name}"
            yield Finding("missing", name, one.name, f"{name} has no sample", mend, float(one.time.size))
