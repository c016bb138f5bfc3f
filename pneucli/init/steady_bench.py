"""Part of ``init``: files of a steady flow bench, which have a flow, pressures on both sides, and no clock."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pneucli.init.clock_units import stated_period
from pneucli.init.column_names import DOWNSTREAM, UPSTREAM, read_name
from pneucli.init.role_evidence import BY_ORDER
from pneucli.init.survey_types import Guess, Survey

MAX_ROWS = 5000  # a person or a bench sets each row; more rows are a recording over time whose clock is missing
OPENINGS = "opening offnung- offnungs- turns lift spindle position stellung valve poppet"


def as_steady_bench(surveys: Sequence[Survey], guesses: Sequence[Guess]) -> list[Guess]:
    """Return the guesses of a steady bench's columns where these are one; else the guesses as they are.

    The pressure upstream becomes ``p_supply``, the one downstream ``p1``, and an opening the command ``u``.
    """
    found = {one.signal: one for one in guesses if one.signal}
    if not is_steady_bench(surveys, found):
        return list(guesses)
    renamed = {**_pressures(surveys[0], found), **_opening(surveys[0], guesses)}
    return [renamed.get(id(one), one) for one in guesses]


def is_steady_bench(surveys: Sequence[Survey], found: Mapping[str, Guess]) -> bool:
    """Return whether rows have a flow and a pressure, and neither a clock nor a sampling rate."""
    rows = max((one.values.size for survey in surveys for one in survey.columns), default=0)
    pressures = found.keys() & {"p_supply", "p1", "p2"}
    timed = "time" in found or any(column.clock is not None for survey in surveys for column in survey.columns)
    rated = any(stated_period(survey.scalars) is not None for survey in surveys)
    return "flow" in found and bool(pressures) and not timed and not rated and rows <= MAX_ROWS


def _pressures(survey: Survey, found: Mapping[str, Guess]) -> dict[int, Guess]:
    """Return the pressures by what they were taken for: upstream is what is called so, else the higher one."""
    taken = [found[name] for name in ("p_supply", "p1", "p2") if name in found]
    if len(taken) < 2:
        return {id(one): replace(one, signal="p_supply") for one in taken}
    if "p_supply" in found and "p2" not in found:
        return {}
    names = [read_name(one.column, survey.is_text) for one in taken]
    order = sorted(
        range(len(taken)),
        key=lambda i: (names[i].has(DOWNSTREAM), not names[i].has(UPSTREAM), -_median(taken[i])),
    )
    first, last = taken[order[0]], taken[order[-1]]
    note = "" if names[order[0]].has(UPSTREAM) or names[order[-1]].has(DOWNSTREAM) else "CHECK the higher one"
    own = [*(part for part in first.note.split("; ") if BY_ORDER not in part), note]
    return {
        id(first): replace(first, signal="p_supply", note="; ".join(filter(None, own))),
        id(last): replace(last, signal="p1", note="; ".join(p for p in last.note.split("; ") if BY_ORDER not in p)),
        **{id(one): replace(one, signal="") for one in taken if one is not first and one is not last},
    }


def _median(one: Guess) -> float:
    known = one.column.finite_values
    return float(np.median(known)) if known.size else 0.0


def _opening(survey: Survey, guesses: Sequence[Guess]) -> dict[int, Guess]:
    """Return the column that opens the valve, where none is taken for the command: a stroke, or one called so."""
    if any(one.signal == "u" for one in guesses):
        return {}
    moved = [one for one in guesses if one.signal == "x"]
    called = [one for one in guesses if not one.signal and read_name(one.column, survey.is_text).has(OPENINGS)]
    if not (moved or called):
        return {}
    one = [*moved, *called][0]
    unit = one.unit or one.column.written
    note = f"CHECK an opening{f' in {unit}' if unit else ''}: its number is the command"
    return {id(one): replace(one, signal="u", unit="V", scale=1.0, note=note)}
