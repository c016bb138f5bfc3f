"""Part of ``init``: one recording in several files of one signal each, as figures are digitised."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pneucli.quantities import SIGNALS
from pneucli.stages.init_guess import guess
from pneucli.stages.init_kinds import Kind
from pneucli.stages.init_survey import Column, Guess, Survey
from pneucli.units import parse_unit


def joined(surveys: Sequence[Survey]) -> Kind | None:
    """Return one kind for all files, if each holds a clock and one reading, no two of them the same signal.

    A reading is called what its column is called, or its file where all columns are called alike.
    """
    pairs = [_pair(one) for one in surveys]
    if len(surveys) < 2 or None in pairs:
        return None
    found = [pair for pair in pairs if pair is not None]
    readings = [reading for _, reading in found]
    if len({one.name for one in readings}) < len(readings):
        stems = zip(surveys, readings, strict=True)
        readings = [replace(one, name=survey.path.stem) for survey, one in stems]
    clocks = [clock for clock, _ in found]
    together = guess([Survey(surveys[0].raw, surveys[0].is_text, [clocks[0].column, *readings], {})])[1:]
    signals = [one.signal for one in together]
    if "" in signals or len(set(signals)) < len(signals) or not _overlap(clocks):
        return None
    kinds = [
        Kind([survey], survey.path.as_posix(), (), {"time": clock, one.signal: replace(one, column=column)}, ())
        for survey, (clock, column), one in zip(surveys, found, together, strict=True)
    ]
    kinds.sort(key=lambda kind: [*SIGNALS].index([*kind.guesses][1]))
    return replace(kinds[0], more=kinds[1:])


def _pair(one: Survey) -> tuple[Guess, Column] | None:
    """Return the clock of a file and its only reading; None where it holds anything else."""
    guesses = guess([one])
    clock = [g for g in guesses if g.signal == "time"]
    rest = [g.column for g in guesses if g.signal != "time"]
    return (clock[0], rest[0]) if len(clock) == len(rest) == 1 and rest[0].where is None else None


def _overlap(clocks: Sequence[Guess]) -> bool:
    """Return whether all files have a time in common."""
    times = [parse_unit(one.unit).factor * one.column.known for one in clocks]
    return bool(max(float(np.min(t)) for t in times) < min(float(np.max(t)) for t in times))
