"""Part of ``init``: what all columns together say of the role of one of them, beside its name.

A supply stands at the top of the other pressures and hardly moves; a command is set in steps and shows no noise; of two
columns that fit a role alike the order alone decides, which is said.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from pneucli.arrays import Array
from pneucli.init.column_names import DIFFERENCE, SUPPLY, ColumnName, quantity_kind
from pneucli.init.survey_types import Column
from pneucli.units import parse_unit

MAX_SUPPLY_RANGE = 0.15  # of the largest range of the other pressures, over which a supply moves
MIN_SUPPLY_LEVEL = 0.95  # of the most that another pressure reaches, at which a supply stands
MIN_STILL_SHARE = 0.6  # of the steps of a command, that are 0: it is set, and shows no noise
MAX_LEVELS = 0.1  # of its samples, that a command is set to
SURE, LIKELY = 3.0, 0.8  # what evidence adds to the score of a name; "supply" in a name adds 3
BY_ORDER = "the order of the columns decided"
RIVAL = 0.05  # of a score, by which another column may fit less and still might be meant


class Evidence(NamedTuple):
    """What speaks for a role of the column at a position, how much, and why."""

    position: int
    signal: str
    weight: float
    why: str


def role_evidence(columns: Sequence[Column], names: Sequence[ColumnName], free: Sequence[int]) -> Iterator[Evidence]:
    """Yield what the numbers of the ``free`` columns say of their roles."""
    pressures = [n for n in free if names[n].kind == "pressure" and not names[n].has(DIFFERENCE)]
    if not any(names[n].has(SUPPLY) for n in pressures):
        piston = any(names[n].kind in ("position", "velocity") for n in free) and len(pressures) < 3
        for n in supply_like({n: in_one_unit(columns[n]) for n in pressures}):
            counted = "pressure" in names[n].nouns and names[n].words[-1] in ("1", "2", "a", "b")
            if not (counted and piston):  # a chamber's; of a vessel and of a valve's ports the first is the supply
                why = "CHECK it hardly moves and stands at the top of the other pressures, as a supply does"
                yield Evidence(n, "p_supply", SURE, why)
    if not any("command" in names[n].nouns for n in free):
        for n in free:
            letters = all(len(word) == 1 for word in names[n].noun_words)
            volts = quantity_kind(names[n].unit) == "command" and letters  # Y1 is a coil as well as a position
            nameless = not (names[n].nouns and names[n].kind) and quantity_kind(names[n].unit) == ""
            if (nameless or volts) and looks_set(columns[n].values):
                why = "CHECK it is set in steps and shows no noise, as a command does"
                yield Evidence(n, "u", SURE if volts else LIKELY, why)


def pressure_behind_valve(columns: Sequence[Column], names: Sequence[ColumnName]) -> list[Column]:
    """Return the pressure behind a valve: the only one that is recorded, less the difference over the valve.

    Nothing where there is no difference, where several pressures are recorded, or in other units, or where the
    difference changes its sign: that of two chambers.
    """
    pressures = [n for n, name in enumerate(names) if name.kind == "pressure" and not columns[n].computed]
    differences = [n for n in pressures if names[n].has(DIFFERENCE)]
    if len(differences) != 1 or len(pressures) != 2:
        return []
    first, less = (columns[n] for n in (next(n for n in pressures if n not in differences), differences[0]))
    same = first.unit and less.unit and parse_unit(first.unit).factor == parse_unit(less.unit).factor
    if not same or (first.scale, less.scale) != (1.0, 1.0) or first.where or less.where or first.clock != less.clock:
        return []
    if not _has_one_sign(less.values):
        return []
    text = f"`{first.key}` - `{less.key}`"
    return [Column(text, "p1 behind the valve", first.unit, first.values - less.values, computed=True)]


def _has_one_sign(difference: Array) -> bool:
    """Return whether a difference of pressures is that over a valve from one side: noise apart it has one sign."""
    known = difference[np.isfinite(difference)]
    return known.size > 0 and float(-known.min()) <= MAX_BACKWARD_DIFFERENCE * float(known.max())


MAX_BACKWARD_DIFFERENCE = 0.1  # of the largest difference, that one over a valve may be below 0: noise and overshoot


def supply_like(pressures: Mapping[int, Array]) -> list[int]:
    """Return the only pressure that hardly moves and bounds all others; nothing where there is none."""
    known = {n: values[np.isfinite(values)] for n, values in pressures.items()}
    known = {n: values for n, values in known.items() if values.size > 1}
    found = []
    for n, values in known.items():
        others = [other for m, other in known.items() if m != n]
        widest = max((_range(other) for other in others), default=0.0)
        highest = max((float(np.quantile(other, 0.99)) for other in others), default=np.inf)
        if _range(values) < MAX_SUPPLY_RANGE * widest and float(np.median(values)) >= MIN_SUPPLY_LEVEL * highest:
            found.append(n)
    return found if len(found) == 1 else []


def in_one_unit(column: Column) -> Array:
    """Return the values of a pressure in Pa where its unit is known, else as they are."""
    known = bool(column.unit) and np.isfinite(column.scale)
    return column.values * column.scale * parse_unit(column.unit).factor if known else column.values


def _range(values: Array) -> float:
    low, high = np.quantile(values, (0.01, 0.99))
    return float(high - low)


def looks_set(values: Array) -> bool:
    """Return whether numbers stay where they are for most steps, and go to few levels."""
    known = values[np.isfinite(values)]
    if known.size < 8 or not np.ptp(known):
        return False
    still = float(np.mean(np.diff(known) == 0)) >= MIN_STILL_SHARE or known.size < MIN_STILL_SHARE * values.size
    return still and np.unique(known).size <= max(3.0, MAX_LEVELS * known.size)


def rivals(
    taken: Mapping[int, str], scores: Mapping[tuple[int, str], float], columns: Sequence[Column]
) -> dict[int, str]:
    """Return, for each column whose role another column fits as well, which one that is, in words."""
    found = {}
    for n, signal in taken.items():
        own = scores.get((n, signal), np.inf)
        alike = [m for (m, other), score in scores.items() if other == signal and m != n and score > own - RIVAL]
        if alike:
            found[n] = f'CHECK "{columns[alike[0]].name}" may be {signal} as well: {BY_ORDER}'
    return found
