"""Part of ``init``: columns without names. The numbers and the files' own names tell some of them; people the rest."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from pneucli.arrays import Array
from pneucli.init.clock_columns import counts_rows
from pneucli.init.clock_units import guess_clock_unit
from pneucli.init.role_evidence import looks_set, supply_like
from pneucli.init.survey_types import Guess, Survey
from pneucli.init.units import guess_unit
from pneucli.io.text_sniffer import is_unit
from pneucli.units import same_dimension

MIN_RANGE_STEPS = 5.0  # steps of its resolution that a reading moves at least, to be compared
PRESSURE_NAME_TOLERANCE = 0.06  # of the number in a file's name
COPY_TOLERANCE = 0.01  # of its deviation, that one reading in two columns may be off a line
MIN_COPY_SHARE = 0.5  # of the files
MIN_FORCE_CORRELATION = 0.99  # correlation of what grows with the pressure
MIN_LINE_POINTS = 3  # files that tell a line
_IN_NAME = re.compile(r"(\d+(?:[.,]\d+)?)\s*([A-Za-z]+)")


def guess_unnamed_columns(surveys: Sequence[Survey], clock: int | None) -> list[Guess]:
    """Return a guess for every column of files without names of columns; ``clock`` is the one that rises."""
    columns = surveys[0].columns
    twins = _copied_columns(surveys)
    filled = [n for n in range(len(columns)) if all(one.columns[n].finite_values.size for one in surveys)]
    parts = [] if clock is None else re.findall(r"`(.+?)`", str(columns[clock].key))  # of a clock that is computed
    own = [n for n in filled if n not in twins and n != clock and str(columns[n].key) not in parts]
    own = [n for n in own if not counts_rows(columns[n])]
    medians = {n: np.array([np.median(one.columns[n].finite_values) for one in surveys]) for n in own}
    found = {} if clock is None else {clock: ("time", *_clock_unit(surveys[0], clock))}
    found |= _driven_vessel(surveys[0], own) or _pressure(surveys, medians)
    if not any(signal == "p_supply" for signal, *_ in found.values()):
        found |= _position(surveys, [n for n in own if n not in found])
    found |= _force(medians, found)
    if len(own) == 1 and own[0] not in found:
        unit, note = guess_unit("p1", columns[own[0]].finite_values, angle=False)
        found = {**found, own[0]: ("p1", unit, f"the only reading; {note}")}
    guesses = []
    for n, column in enumerate(columns):
        signal, unit, note = found.get(n, ("", "", ""))
        note = f"column {columns[twins[n]].key} in other numbers" if n in twins else note
        guesses.append(Guess(column, signal, unit, False, "", note))
    return guesses


def _driven_vessel(found: Survey, own: Sequence[int]) -> dict[int, tuple[str, str, str]]:
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
    unit = guessed[pressure][0]
    return {
        n: (signal, unit if signal.startswith("p") else guessed[n][0], f"CHECK {why}; {guessed[n][1]}")
        for n, (signal, why) in roles.items()
    }


def _clock_unit(found: Survey, clock: int) -> tuple[str, str]:
    column = found.columns[clock]
    return (column.unit, "") if column.unit else guess_clock_unit(column, found.columns, found.scalars)


def _copied_columns(alike: Sequence[Survey]) -> dict[int, int]:
    """Return columns that are another, later one in other numbers, such as a sensor's volts.

    In all files together, or in most of them: a zero may be taken anew for each.
    """
    each = [[column.values for column in one.columns] for one in alike]
    pooled = [np.concatenate(same) for same in zip(*each, strict=True)]
    width = len(pooled)
    pairs = [(n, later) for n in range(width) for later in range(width - 1, n, -1)]
    return {
        n: later
        for n, later in reversed(pairs)
        if _is_linear_copy(pooled[n], pooled[later])
        or np.mean([_is_linear_copy(columns[n], columns[later]) for columns in each]) > MIN_COPY_SHARE
    }


def _is_linear_copy(first: Array, second: Array) -> bool:
    """Return whether two columns lie on one line, as far as their resolution lets tell."""
    both = np.isfinite(first) & np.isfinite(second)
    first, second = first[both], second[both]
    if (
        first.size < MIN_LINE_POINTS
        or not np.ptp(first) > MIN_RANGE_STEPS * _resolution(first)
        or not np.ptp(second) > MIN_RANGE_STEPS * _resolution(second)
    ):
        return False
    slope, offset = np.polyfit(first, second, 1)
    off = float(np.std(second - slope * first - offset))
    return bool(
        off
        <= max(0.5 * (abs(slope) * _resolution(first) + _resolution(second)), COPY_TOLERANCE * float(np.std(second)))
    )


def _resolution(values: Array) -> float:
    """Return the resolution of a column: the least difference between two of its values."""
    steps = np.diff(np.unique(values))
    return float(steps.min()) if steps.size else 0.0


def _pressure(alike: Sequence[Survey], medians: dict[int, Array]) -> dict[int, tuple[str, str, str]]:
    """Return the column whose median is the pressure in each file's name, such as 7 in O-ring_7bar."""
    pressures_in_names = [
        {unit: float(number.replace(",", ".")) for number, unit in _IN_NAME.findall(one.path.stem)} for one in alike
    ]
    for unit in pressures_in_names[0]:
        if not is_unit(unit) or not same_dimension(unit, "Pa") or not all(unit in one for one in pressures_in_names):
            continue
        wanted = np.array([one[unit] for one in pressures_in_names])
        for n, median in medians.items():
            if len(set(wanted)) > 1 and np.all(np.abs(median - wanted) <= PRESSURE_NAME_TOLERANCE * wanted):
                return {n: ("p1", unit, f"its medians are the numbers before {unit} in the files' names")}
    return {}


def _position(alike: Sequence[Survey], left: Sequence[int]) -> dict[int, tuple[str, str, str]]:
    """Return the smoothest of the columns that are left: the one that travels least for its range."""
    if len(left) < 2:
        return {}
    known = {n: alike[0].columns[n].finite_values for n in left}
    travel = {n: float(np.abs(np.diff(values)).sum() / max(np.ptp(values), 1e-30)) for n, values in known.items()}
    best = min(travel, key=lambda n: travel[n])
    unit, note = guess_unit("x", known[best], angle=False)
    return {best: ("x", unit, f"CHECK the smoothest reading; {note}")}


def _force(medians: dict[int, Array], found: dict[int, tuple[str, str, str]]) -> dict[int, tuple[str, str, str]]:
    """Return the column that grows in proportion with the pressure, as the force on a piston does."""
    pressure = next((medians[n] for n, (signal, _, _) in found.items() if signal == "p1"), None)
    if pressure is None or pressure.size < MIN_LINE_POINTS:
        return {}
    left = [n for n in medians if n not in found and np.ptp(medians[n]) > 0]
    grows = [n for n in left if np.corrcoef(medians[n], pressure)[0, 1] > MIN_FORCE_CORRELATION]
    note = "CHECK it grows in proportion with the pressure, as the force on a piston does; no unit is stated"
    return {grows[-1]: ("force", "N", note)} if grows else {}
