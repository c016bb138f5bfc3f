"""Part of ``init``: what all columns together say of the role of one of them, beside its name.

A supply stands at the top of the other pressures and hardly moves; a command is set in steps and shows no noise; of two
columns that fit a role alike the order alone decides, which is said. Of columns without names the numbers tell some,
people the rest.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pneucli.arrays import Array
from pneucli.init.clock_columns import computed_column, counts_rows, guess_clock_unit
from pneucli.init.column_names import DIFFERENCE, NO_SIGNAL, SUPPLY, ColumnName, quantity_kind
from pneucli.init.survey_types import Column, Guess, Survey, UnitGuess
from pneucli.init.units import guess_unit, implausibility
from pneucli.units import is_unit, parse_unit, same_dimension

MAX_SUPPLY_RANGE = 0.15  # of the largest range of the other pressures, over which a supply moves
MIN_SUPPLY_LEVEL = 0.95  # of the most that another pressure reaches, at which a supply stands
MIN_STILL_SHARE = 0.6  # of the steps of a command, that are 0: it is set, and shows no noise
# rows by which distances between readings of an even clock differ: each reading falls on a row half a row off at most
MAX_UNEVEN_ROWS = 2
MAX_LEVELS = 0.1  # of its samples, that a command is set to
SURE, LIKELY = 3.0, 0.8  # what evidence adds to the score of a name; "supply" in a name adds 3
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
    moved = any(names[n].kind in ("pressure", "position", "flow") for n in free)  # what a command may move
    if moved and not any("command" in names[n].nouns for n in free):
        for n in free:
            letters = all(len(word) == 1 for word in names[n].noun_words)
            volts = quantity_kind(names[n].unit) == "command" and letters  # Y1 is a coil as well as a position
            is_share = quantity_kind(names[n].unit) == "" and (not names[n].unit or same_dimension(names[n].unit, "1"))
            nameless = is_share and not (names[n].nouns and names[n].kind) and not names[n].has(NO_SIGNAL)
            if (volts or (nameless and not _counts_on(columns[n]))) and looks_set(columns[n].values):
                why = "CHECK it is set in steps and shows no noise, as a command does"
                yield Evidence(n, "u", SURE if volts else LIKELY, why)


def _counts_on(column: Column) -> bool:
    """Return whether a column only ever goes on by one: the number of a step, a cycle or a segment."""
    steps = np.diff(column.finite_values)
    return bool(np.all(steps[steps != 0] == 1.0))


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
    return computed_column(f"`{first.key}` - `{less.key}`", "p1 behind the valve", first.unit, columns)


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
    """Return whether numbers stay where they are for most steps, and go to few levels; or are logged on change."""
    known = values[np.isfinite(values)]
    if known.size < 8 or not np.ptp(known):
        return False
    steps, levels, sparse = np.diff(known), np.unique(known).size, known.size < MIN_STILL_SHARE * values.size
    apart = np.diff(np.flatnonzero(np.isfinite(values)))  # rows: those of a slow reading are as far apart
    if sparse and np.all(steps) and levels < known.size and np.ptp(apart) > MAX_UNEVEN_ROWS:
        return True
    return (sparse or float(np.mean(steps == 0)) >= MIN_STILL_SHARE) and levels <= max(3.0, MAX_LEVELS * known.size)


def rivals(
    taken: Mapping[int, str], scores: Mapping[tuple[int, str], float], columns: Sequence[Column]
) -> dict[int, str]:
    """Return, for each column whose role another column fits as well, which one that is, in words."""
    found = {}
    for n, signal in taken.items():
        own = scores.get((n, signal), np.inf)
        alike = [m for (m, other), score in scores.items() if other == signal and m != n and score > own - RIVAL]
        if alike:
            other = columns[alike[0]].name
            found[n] = f'CHECK "{other}" may be {signal} as well: the order of the columns decided'
    return found


MOTION_SEGMENTS = 500  # segments of a recording over which its motion is judged
MOSTLY = 0.95  # of the rows: what is fast is told by these
# of the deviation of p1 - p2, by which it is less where the piston moves toward +x; in 120 recordings of virtual rigs
# it is 1.2 times that deviation more where the piston moves, and at most 0.004 less where it is held
MIN_AGAINST = 0.1


def moves_against(taken: Mapping[int, str], columns: Sequence[Column]) -> dict[int, str]:
    """Return the pressures of a driven piston that moves against their difference, with the doubt in words.

    Friction holds back in either direction, so what drives a piston is more where it moves toward its positive side.
    """
    at = {signal: n for n, signal in taken.items()}
    if not {"u", "x", "p1", "p2"} <= at.keys():
        return {}
    p1, p2, x = in_one_unit(columns[at["p1"]]), in_one_unit(columns[at["p2"]]), columns[at["x"]].values
    if not p1.size == p2.size == x.size:  # of a long table
        return {}
    drive = p1 - p2
    both = np.isfinite(drive) & np.isfinite(x)
    more = drive_by_direction(drive[both], x[both])
    if more is None or more > -MIN_AGAINST * float(np.std(drive[both])):
        return {}
    doubt = "CHECK the piston moves against p1 - p2: exchange p1 and p2, or let x count the other way (scale = -1.0)"
    return dict.fromkeys((at["p1"], at["p2"]), doubt)


def drive_by_direction(drive: Array, x: Array) -> float | None:
    """Return how much larger a force, or a pressure, is where x grows than where it falls; None: too few rows tell."""
    if drive.size != x.size or x.size < MOTION_SEGMENTS:
        return None
    reach = x.size // MOTION_SEGMENTS + 1
    moved = x[reach:] - x[:-reach]
    between = drive[reach // 2 :][: moved.size]
    fast = 0.25 * float(np.quantile(np.abs(moved), MOSTLY))  # a few jumps are those of a counter
    out, back = between[moved > fast], between[moved < -fast]
    return float(np.median(out) - np.median(back)) if out.size and back.size else None


MIN_ALIKE = 3  # columns that differ by a number alone: two may be those of the chambers, or a reading and a spare
NUMBERED = ("time", "p1", "p2", "u", "u2")  # signals that have a number of their own


def without_alike(scores: Mapping[tuple[int, str], float], columns: Sequence[Column]) -> dict[tuple[int, str], float]:
    """Return the scores without roles that several columns claim which differ by a number alone: joints of a robot."""
    stems = [re.sub(r"\d+", "#", one.name) for one in columns]
    claims = Counter((stems[n], signal) for n, signal in scores if signal not in NUMBERED)
    return {(n, one): score for (n, one), score in scores.items() if claims[stems[n], one] < MIN_ALIKE}


MIN_RANGE_STEPS = 5.0  # steps of its resolution that a reading moves at least, to be compared
COPY_TOLERANCE = 0.01  # of its deviation, that one reading in two columns may be off a line at most
MAX_COMPARED = 60  # columns without names, of which each is compared with each
MIN_LINE_POINTS = 3  # rows that tell a line
_IN_NAME = re.compile(r"(\d+(?:[.,]\d+)?)\s*([A-Za-z]+)")


def guess_unnamed_columns(survey: Survey, clock: int | None) -> list[Guess]:
    """Return a guess for every column of files without names of columns; ``clock`` is the one that rises."""
    columns = survey.columns
    twins = _copied_columns(columns)
    parts = [] if clock is None else re.findall(r"`(.+?)`", str(columns[clock].key))  # of a clock that is computed
    own = [n for n, one in enumerate(columns) if n not in twins and n != clock and str(one.key) not in parts]
    own = [n for n in own if columns[n].finite_values.size and not counts_rows(columns[n])]
    found = {} if clock is None else {clock: ("time", _clock_unit(survey, clock))}
    found |= _driven_vessel(survey, own)
    guesses = []
    for n, column in enumerate(columns):
        signal, (unit, note, asked, _) = found.get(n, ("", UnitGuess("", "")))
        note = note or (f"column {columns[twins[n]].key} in other numbers" if n in twins else "")
        mute = bool(signal) and not column.unit
        asked = mute and (asked or bool(implausibility(signal, unit, column.finite_values)))
        guesses.append(Guess(column, signal, unit, False, "", note, ask_unit=asked))
    return guesses


def _driven_vessel(found: Survey, own: Sequence[int]) -> dict[int, tuple[str, UnitGuess]]:
    """Return command, supply and pressure of a vessel: what is set, what bounds the others, and what is between."""
    columns = {n: found.columns[n] for n in own if np.ptp(found.columns[n].finite_values) > 0}
    commands = [n for n, one in columns.items() if looks_set(one.values)]
    others = {n: one.values for n, one in columns.items() if n not in commands}
    supply = supply_like(others)
    if len(commands) != 1 or len(supply) != 1 or len(others) != 2:
        return {}
    pressure = next(n for n in others if n not in supply)
    roles = {
        commands[0]: ("u", "it is set in steps and shows no noise, as a command does"),
        supply[0]: ("p_supply", "it stands at the top of the other reading, as a supply does"),
        pressure: ("p1", "it moves below the supply"),
    }
    guessed = {n: guess_unit(signal, columns[n].finite_values, angle=False) for n, (signal, _) in roles.items()}
    both = guessed[pressure]
    guessed[supply[0]] = guessed[supply[0]]._replace(unit=both.unit, asked=both.asked)
    return {
        n: (signal, guessed[n]._replace(why=f"CHECK {why}; {guessed[n].why}")) for n, (signal, why) in roles.items()
    }


def _clock_unit(found: Survey, clock: int) -> UnitGuess:
    column = found.columns[clock]
    return UnitGuess(column.unit, "") if column.unit else guess_clock_unit(column, found.columns, found.scalars)


def _copied_columns(columns: Sequence[Column]) -> dict[int, int]:
    """Return columns that are another, later one in other numbers, such as a sensor's volts."""
    width = len(columns) if len(columns) <= MAX_COMPARED else 0
    pairs = [(n, later) for n in range(width) for later in range(width - 1, n, -1)]
    return {n: later for n, later in reversed(pairs) if is_copy(columns[n].values, columns[later].values)}


def is_copy(first: Array, second: Array) -> bool:
    """Return whether a column is another one again, in other numbers that grow with it, but for what both round."""
    if first.size != second.size:  # of files that have a clock each
        return False
    both = np.isfinite(first) & np.isfinite(second)
    first, second = first[both], second[both]
    steps = _resolution(first), _resolution(second)
    ranges = (float(np.ptp(one)) > MIN_RANGE_STEPS * step for one, step in zip((first, second), steps, strict=True))
    if first.size < MIN_LINE_POINTS or not all(ranges):
        return False
    slope, offset = np.polyfit(first, second, 1)
    off, spread = float(np.std(second - slope * first - offset)), float(np.std(second))
    rounding = min(0.5 * (slope * steps[0] + steps[1]), COPY_TOLERANCE * spread)  # few levels are no coarse rounding
    return bool(slope > 0 and off <= max(rounding, 1e-9 * spread))


def _resolution(values: Array) -> float:
    """Return the resolution of a column: the least difference between two of its values."""
    steps = np.diff(np.unique(values))
    return float(steps.min()) if steps.size else 0.0


def pressures_in_name(path: Path) -> dict[str, float]:
    """Return the largest pressure that a file's name says, by unit."""
    found = dict[str, float]()
    for number, unit in _IN_NAME.findall(path.stem):
        found[unit] = max(found.get(unit, 0.0), float(number.replace(",", ".")))
    return {unit: number for unit, number in found.items() if is_unit(unit) and same_dimension(unit, "Pa")}
