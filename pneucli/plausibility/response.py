"""Checks that a sensor answers to what the other sensors see."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pneucli.plausibility.bench import Bench
from pneucli.plausibility.finding import Finding, shown
from pneucli.recording import Recording

SEEN = 10.0  # times its noise, that a sensor must see of something to answer to it


def check(bench: Bench) -> Iterator[Finding]:
    """Yield findings of all recordings in which the piston moves."""
    for one in bench.recordings:
        if one.experiment == "valve" or not bench.moving(one, "x"):
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
        found = f"p2 of the closed chamber stays at {shown(middle, 'p2')} while x would change it by {shown(expected, 'p2')}"
        mend = f'a dead sensor or another column? check [signals] p2, and chamber_2 in [[recordings]] {one.name}'
        yield Finding("silent", "p2", one.name, found, mend)


def _force(one: Recording, bench: Bench) -> Iterator[Finding]:
    """Friction changes its sign with the motion's: a force that is measured shows it."""
    x = one["x"][np.isfinite(one["x"])]
    returns = min(np.max(x) - x[0], x[0] - np.min(x), key=abs) if x.size else 0.0
    turns = max(np.max(x) - x[-1], x[-1] - np.min(x), abs(returns)) > 0.1 * float(np.ptp(x)) if x.size else False
    if "force" in one and turns and bench.rests(one, "force") and not bench.moving(one, "p1", "p2"):
        found = f"the piston moves, and force stays at {shown(float(np.nanmedian(one['force'])), 'force')}"
        mend = "a dead sensor or another column? check column and unit in [signals] force"
        yield Finding("silent", "force", one.name, found, mend)
