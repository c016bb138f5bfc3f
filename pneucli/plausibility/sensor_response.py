"""Checks that a sensor answers to what the other sensors see."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pneucli.plausibility.blocks import blocks
from pneucli.plausibility.rig_check import BOTH_WAYS, SEEN, Bench, Finding, shown
from pneucli.recording import Recording


def check(bench: Bench) -> Iterator[Finding]:
    """Yield findings of all recordings in which the piston moves."""
    for one in bench.recordings:
        if one.kind.vessel or not bench.moving(one, "x"):
            continue
        yield from _drive(one, bench)
        yield from _closed(one, bench)
        yield from _force(one, bench)


def _drive(one: Recording, bench: Bench) -> Iterator[Finding]:
    """What drives the piston changes, unless something else does."""
    if "p1" not in one or one.imposed or "force" in one or not bench.rests(one, "p1"):
        return
    found = f"the piston moves, and p1 stays at {shown(float(np.nanmedian(one['p1'])), 'p1')}"
    if one.chamber_2 == "open" and bench.moving(one, "p2"):
        mend = "exchange the columns in [signals] p1 and p2"
        yield Finding("swapped", "p1", one.name, f"{found} while p2 of the open chamber moves: swapped?", mend)
    else:
        mend = "a dead sensor or another column? check column and unit in [signals] p1"
        yield Finding("silent", "p1", one.name, found, mend)


def _closed(one: Recording, bench: Bench) -> Iterator[Finding]:
    """The pressure of a closed chamber changes with its volume."""
    volume = bench.volume(2, one["x"]) if one.chamber_2 == "closed" and "p2" in one else None
    if volume is None or not bench.rests(one, "p2"):
        return
    middle = float(np.nanmedian(one["p2"]))
    expected = middle * float(np.nanmax(volume) - np.nanmin(volume)) / float(np.nanmax(np.abs(volume)))
    noise = one.noise["p2"].rms if "p2" in one.noise else 0.0
    if expected > SEEN * noise:
        stays = f"p2 of the closed chamber stays at {shown(middle, 'p2')}"
        mend = f"a dead sensor or another column? check [signals] p2, and chamber_2 in [[recordings]] {one.name}"
        found = f"{stays} while x would change it by {shown(expected, 'p2')}"
        yield Finding("silent", "p2", one.name, found, mend)


def _force(one: Recording, bench: Bench) -> Iterator[Finding]:
    """Friction changes its sign with the motion's: a force that is measured shows it."""
    if "force" not in one or not bench.rests(one, "force") or bench.moving(one, "p1", "p2"):
        return
    cut = blocks(one, "x", 1)
    forth = float(np.mean(cut.slope("x") > 0)) if cut else 0.0
    if BOTH_WAYS < forth < 1 - BOTH_WAYS:
        found = f"the piston moves, and force stays at {shown(float(np.nanmedian(one['force'])), 'force')}"
        mend = "a dead sensor or another column? check column and unit in [signals] force"
        yield Finding("silent", "force", one.name, found, mend)
