"""Checks that a sensor answers to what the other sensors see."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pneucli.messages.formatting import format_signal
from pneucli.plausibility.detectors import Detector
from pneucli.plausibility.rig_check import (
    MIN_SIGNAL_TO_NOISE,
    Finding,
    RigCheck,
    excess,
)
from pneucli.recording import Recording


def _check(rig_check: RigCheck) -> Iterator[Finding]:
    """Yield findings of all recordings in which the piston moves."""
    for one in rig_check.recordings:
        if one.kind.vessel or not rig_check.active_signals(one, "x"):
            continue
        yield from _driving_pressure(one, rig_check)
        yield from _closed_chamber(one, rig_check)


def _driving_pressure(one: Recording, bench: RigCheck) -> Iterator[Finding]:
    """What drives the piston changes, unless something else does."""
    if "p1" not in one or one.imposed or "force" in one or not bench.is_inactive(one, "p1"):
        return
    found = f"the piston moves, and p1 stays at {format_signal(float(np.nanmedian(one['p1'])), 'p1')}"
    if one.chamber_2 == "open" and bench.active_signals(one, "p2"):
        mend = "exchange the columns in [signals] p1 and p2"
        found = f"{found} while p2 of the open chamber moves: swapped?"
        yield from Finding("swapped", "p1", one.name, found, mend, _travel_over_noise(one)).judged()
    else:
        mend = "a dead sensor or another column? check column and unit in [signals] p1"
        yield from Finding("silent", "p1", one.name, found, mend, _travel_over_noise(one)).judged()


def _closed_chamber(one: Recording, bench: RigCheck) -> Iterator[Finding]:
    """The pressure of a closed chamber changes with its volume."""
    volume = bench.volume(2, one["x"]) if one.chamber_2 == "closed" and "p2" in one else None
    if volume is None or not bench.is_inactive(one, "p2"):
        return
    middle = float(np.nanmedian(one["p2"]))
    expected = middle * float(np.nanmax(volume) - np.nanmin(volume)) / float(np.nanmax(np.abs(volume)))
    noise = one.noise_rms("p2")
    stays = f"p2 of the closed chamber stays at {format_signal(middle, 'p2')}"
    mend = f"a dead sensor or another column? check [signals] p2, and chamber_2 in [[recordings]] {one.name}"
    found = f"{stays} while x would change it by {format_signal(expected, 'p2')}"
    by = excess(expected, MIN_SIGNAL_TO_NOISE * noise)
    yield from Finding("silent", "p2", one.name, found, mend, by).judged(physics=True)


def _travel_over_noise(one: Recording) -> float:
    """Return how far the piston goes in units of the noise of x: that it moves is what makes a silent sensor odd."""
    noise = one.noise_rms("x")
    return excess(float(np.nanmax(one["x"]) - np.nanmin(one["x"])), MIN_SIGNAL_TO_NOISE * noise)


DETECTOR = Detector(
    _check,
    {
        "silent": ("p2 of a closed chamber rests while x changes its volume", "p1 rests while the piston moves"),
        "swapped": ("", "p2 of an open chamber moves instead of p1"),
    },
    place=4,
)
