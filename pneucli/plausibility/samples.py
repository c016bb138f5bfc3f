"""Checks of how much was measured: missing samples, too few of them, too slow, one column twice."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import combinations

import numpy as np

from pneucli.messages.formatting import format_plain
from pneucli.plausibility.rig_check import Finding, RigCheck, excess
from pneucli.plausibility.signal_summary import missing_share
from pneucli.quantities import CHANNELS
from pneucli.recording import Recording

MAX_MISSING_SHARE = 0.1  # of the time: more than now and then a sample; nothing in the catalogue loses any
MIN_SAMPLES = 8  # samples: fewer do not tell a sensor's noise (pneucli.noise)
STIFFNESS_ERROR = 0.1  # of the piston's frequency on its air: volumes are stated to a fifth or so
INITIAL_STATES = {"p1": 1, "p2": 1, "x": 2}  # what a restart takes from a channel: its value, and the velocity of x


def check(rig_check: RigCheck) -> Iterator[Finding]:
    """Yield findings of all recordings."""
    for one in rig_check.recordings:
        yield from _missing(one)
        yield from _too_few_samples(one)
        yield from _duplicated_columns(one)
        yield from _undersampled(one, rig_check)


def _missing(one: Recording) -> Iterator[Finding]:
    for signal in one.signals:
        share = missing_share(one, signal)
        if share > MAX_MISSING_SHARE:
            by = excess(share - MAX_MISSING_SHARE, math.sqrt(MAX_MISSING_SHARE / one.time.size))
            found = f"{signal} was not measured in {100 * share:.0f} % of the time"
            mend = f"look at the logger, or take what was measured with from and to in [[recordings]] {one.name}"
            yield from Finding("missing", signal, one.name, found, mend, by, share).judged()


def _too_few_samples(one: Recording) -> Iterator[Finding]:
    """The start of each compared channel is fitted too; effects of [model] come on top."""
    compared = [name for name in CHANNELS if name in one]
    needed = max(MIN_SAMPLES, one.kind.min_parameters + sum(INITIAL_STATES.get(name, 0) for name in compared))
    for signal in compared:
        count = int(np.isfinite(one[signal]).sum())
        if count < needed:
            found = f"{signal} has {count} samples, and {needed} at least are needed for parameters, start and noise"
            mend = f"record for longer or faster, or check from, to and skip_rows of [[recordings]] {one.name}"
            yield Finding("samples", signal, one.name, found, mend, float(needed - count))


def _duplicated_columns(one: Recording) -> Iterator[Finding]:
    """Two sensors never give the same digits, unless neither of them does anything."""
    sensors = [name for name in CHANNELS if name in one] + [name for name in ("p_supply",) if name in one]
    for first, second in combinations(sensors, 2):
        a, b = one[first], one[second]
        if np.nanmin(a) < np.nanmax(a) and np.array_equal(a, b, equal_nan=True):
            found, mend = f"{second} is {first}, digit by digit", f"name the column of {second} in [signals] {second}"
            yield Finding("copy", second, one.name, found, mend, float(np.isfinite(a).sum()))


def _undersampled(one: Recording, bench: RigCheck) -> Iterator[Finding]:
    """A piston that turns by more than one radian of its own oscillation from sample to sample is not seen moving.

    It hangs between two springs of air, k = kappa p A^2 / V each.
    """
    rig = bench.rig
    known = rig.piston_area_1 and rig.moving_mass and rig.dead_volume_1 and "x" in one and "p1" in one
    if one.kind.vessel or one.imposed or not known:
        return
    stiffness = sum(_air_spring_stiffness(bench, one, chamber) for chamber in (1, 2))
    omega = float(np.sqrt(max(stiffness, 0.0) / ((rig.moving_mass or 1.0) + one.added_mass)))
    if omega * one.period > 1.0:
        by = excess(omega * one.period - 1.0, STIFFNESS_ERROR)
        rate, swing = 1 / one.period, omega / (2 * np.pi)
        found = (
            f"sampled at {format_plain(rate, 3)} Hz, and the piston swings on its air at {format_plain(swing, 3)} Hz"
        )
        wanted = format_plain(10 * swing, 2)
        mend = f"record at {wanted} Hz or more; if the logger did, mend the unit in [signals] time"
        yield from Finding("sampling", "time", one.name, found, mend, by).judged()


def _air_spring_stiffness(bench: RigCheck, one: Recording, chamber: int) -> float:
    if f"p{chamber}" not in one or (chamber == 2 and one.chamber_2 == "open"):
        return 0.0
    volume = bench.volume(chamber, one["x"])
    if volume is None:
        return 0.0
    area = bench.rig.piston_areas[chamber - 1]
    return float(bench.rig.heat_capacity_ratio * np.nanmedian(one[f"p{chamber}"]) * area**2 / np.nanmedian(volume))
