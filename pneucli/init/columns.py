"""Part of ``init``: what the columns of an unknown raw file may be, by name, unit and values, for people to correct.

Each signal is given out once, to the column whose name fits best.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pneucli.arrays import Array
from pneucli.errors import InputError
from pneucli.init.clock_columns import (
    counts_rows,
    epoch_counter,
    goes_on_evenly,
    guess_clock_unit,
    is_increasing,
    may_be_clock,
    repeated_clocks,
    suits_a_clock,
    unusual_rate,
)
from pneucli.init.column_names import (
    ABSOLUTE,
    ANGLES,
    GAUGE,
    MEANT,
    NOUNS,
    SUPPLY,
    UPSTREAM,
    ColumnName,
    is_angle,
    is_spread,
    quantity_kind,
    read_names,
    signal_scores,
    variants,
)
from pneucli.init.role_evidence import (
    guess_unnamed_columns,
    is_copy,
    moves_against,
    pressures_in_name,
    rivals,
    role_evidence,
    without_alike,
)
from pneucli.init.survey_types import Column, Guess, Survey
from pneucli.init.units import guess_unit, implausibility, read_state
from pneucli.io.clock import continuous_stamps
from pneucli.io.column_reader import stated_period, tells_ticks
from pneucli.io.signal_repairs import COMMANDS, MarkDetector
from pneucli.io.timestamp_order import TimestampCheck
from pneucli.quantities import ROTARY_UNITS, SIGNALS
from pneucli.units import ANR, ReferenceState, is_count, parse_unit, same_dimension

MIN_SWITCHED_SAMPLES, MAX_SWITCHED_LEVELS = 100, 3  # samples of one that was surely read, values of one that was not
_DEGREES = {"C": "degC", "F": "degF"}  # letters that mean something else where no temperature is measured
SET = ("u", "u2", "x_ref", "p_ref", "p_supply")  # signals that may change between a few values
SPREAD_ALONE = "CHECK the least or the most of each interval, as its name says, and no reading: export the mean"
MAX_MISSED = 3.8  # factor by which a name's number may miss a reading: bar and psi, the nearest units, are 14.5 apart
MOTION = ("v", "a")  # of which a column that never changes tells nothing; an x that does not is a place


def guess_columns(surveys: Sequence[Survey]) -> list[Guess]:
    """Return a guess for every column of files that are alike, in their order.

    The columns are those of the first file; what only numbers tell, those of all files tell.
    """
    found = surveys[0]
    names = read_names(found.columns, found.is_text)
    clock = _clock(found.columns, names, is_rated=stated_period(found.scalars) is not None)
    if not any(name.words for name in names) or _differ_by_number(found.columns, names, clock):
        return guess_unnamed_columns(found, clock)
    taken = {clock: "time"} if clock is not None else {}
    clocks = {column.clock for column in found.columns}
    still = {n for n in _constant_columns(surveys, names) if clock is not None or names[n].kind != "pressure"}
    still |= repeated_clocks(found.columns) | variants(names)
    usable = [n for n in range(len(names)) if found.columns[n].finite_values.size > 1]
    clock_name = None if clock is None else found.columns[clock].name
    still |= {n for n in usable if counts_rows(found.columns[n]) and found.columns[n].finite_values[0] in (0, 1)}
    still |= {n for n in usable if found.columns[n].name == clock_name}
    free = [n for n in usable if n not in taken and n not in still and found.columns[n].key not in clocks]
    free = [n for n in free if not (names[n].is_voltage and implausibility("u", "V", found.columns[n].finite_values))]
    switched = {n for n in free if _is_switched(found.columns[n])}
    named = ((n, *own) for n in free for own in signal_scores(names[n]))
    scores = {(n, signal): score for n, signal, score in named if signal in SET or n not in switched}
    seen = [*role_evidence(found.columns, names, free)]
    for one in seen:
        scores[one.position, one.signal] = scores.get((one.position, one.signal), 0.0) + one.weight
    scores = without_alike(scores, found.columns)
    for (n, signal), _ in sorted(scores.items(), key=lambda item: (item[1], -item[0][0], item[0][1]), reverse=True):
        # what follows a reference well is no copy
        followed = [m for m, one in taken.items() if "_ref" not in one + signal]
        kin = (m for m in followed if m != clock and len({names[m].kind, names[n].kind} - {""}) < 2)
        again = (is_copy(found.columns[m].values, found.columns[n].values) for m in kin)
        if n not in taken and signal not in taken.values() and not any(again):
            taken[n] = signal
    rival = rivals(taken, scores, found.columns)
    why = {one.position: one.why for one in seen if taken.get(one.position) == one.signal}
    taken = {n: one for n, one in taken.items() if one not in MOTION or np.ptp(found.columns[n].finite_values) > 0}
    taken = {n: "u" if one == "u2" and "u" not in taken.values() else one for n, one in taken.items()}
    other = _of_another_axis(found.columns, names, taken)
    taken = {n: one for n, one in taken.items() if n not in other}
    why |= {n: SPREAD_ALONE for n, one in taken.items() if one != "time" and is_spread(names[n])}
    single = _assign_single_pressure(taken, names)
    why |= single | moves_against(taken, found.columns)
    guesses = _motion_of_x(
        _pressures_in_one_unit([_column_guess(surveys, n, taken.get(n, ""), names[n]) for n in range(len(names))])
    )
    return [_with_reasons(one, why.get(n, ""), rival.get(n, ""), n in single) for n, one in enumerate(guesses)]


def _with_reasons(one: Guess, why: str, rival: str, only_pressure: bool) -> Guess:
    """Return a guess with what else speaks for it; a rival counts where nothing else does."""
    if not one.signal:
        return one
    note = "; ".join(filter(None, (why, one.note)))
    return replace(one, note=note, rival="" if why else rival, only_pressure=only_pressure)


def _pressures_in_one_unit(guesses: Sequence[Guess]) -> list[Guess]:
    """Return the guesses with pressures that say no unit in that of the one which rests at ambient, or reaches most."""
    mute = {
        id(g): g
        for g in guesses
        if g.signal.startswith("p") and not (g.unit_stated or g.column.unit or g.column.written)
    }
    if not mute:
        return list(guesses)
    reach = max(mute.values(), key=lambda one: float(np.abs(one.column.finite_values).max(initial=0.0)))
    told = next((one for one in mute.values() if one.at_ambient), reach)
    note = f"CHECK no unit is stated: taken for {told.unit}, as {told.signal} is"
    as_told = (told.unit, told.ask_unit)
    return [
        replace(g, unit=told.unit, note=note, ask_unit=told.ask_unit)
        if id(g) in mute and (g.unit, g.ask_unit) != as_told
        else g
        for g in guesses
    ]


def _motion_of_x(guesses: Sequence[Guess]) -> list[Guess]:
    """Return the guesses with what moves x in its kind of unit: of an angle turns; others are left out."""
    place = next((g.unit for g in guesses if g.signal in ("x", "x_ref")), "mm")
    found = []
    for g in guesses:
        wanted = SIGNALS[g.signal].unit if g.signal in (*MOTION, "force") else ""
        wanted = ROTARY_UNITS[wanted] if wanted and is_angle(place) else wanted
        if not wanted or same_dimension(g.unit, wanted):
            found.append(g)
        elif g.unit_stated or not is_angle(place):
            moved = "an angle" if is_angle(place) else "no angle"
            found.append(Guess(g.column, "", g.unit, note=f"{g.unit} is no unit of {g.signal}, as x is {moved}"))
        else:
            note = f"CHECK no unit is stated: taken for {wanted}, as x is an angle"
            found.append(replace(g, unit=wanted, note=note, ask_unit=False))
    return found


def _differ_by_number(columns: Sequence[Column], names: Sequence[ColumnName], clock: int | None) -> bool:
    """Return whether all names but the clock's are one and a number, and say neither quantity nor unit."""
    rest = [n for n in range(len(columns)) if n != clock]
    stems = {re.sub(r"\d+", "", columns[n].name) for n in rest}
    return len(rest) > 1 and len(stems) == 1 and not any(names[n].nouns or names[n].unit for n in rest)


def _of_another_axis(columns: Sequence[Column], names: Sequence[ColumnName], taken: Mapping[int, str]) -> set[int]:
    """Return the taken columns of a group that has a position, and is not that of x: those of another axis."""
    groups = [one.name.replace(".", "/").rpartition("/")[::2] for one in columns]
    own = next((groups[n] for n, one in taken.items() if one == "x"), ("", ""))
    places = {
        group for (group, last), name in zip(groups, names, strict=True) if name.kind == "position" and last == own[1]
    }
    return {n for n in taken if groups[n][0] in places - {own[0]}}


def _constant_columns(surveys: Sequence[Survey], names: Sequence[ColumnName]) -> set[int]:
    """Return the columns that never change where another one of the same quantity does: they are not its signal."""
    moving: dict[str, bool] = {}
    still = set()
    for n, name in enumerate(names):
        pooled = np.concatenate([one.columns[n].finite_values for one in surveys])
        changes = bool(pooled.size) and float(np.ptp(pooled)) > 0.0
        moving[name.kind] = moving.get(name.kind, False) or changes
        still |= set() if changes else {n}
    return {n for n in still if moving[names[n].kind] and not names[n].has(f"{SUPPLY} {UPSTREAM}")}


def _column_guess(alike: Sequence[Survey], n: int, signal: str, name: ColumnName) -> Guess:
    column = alike[0].columns[n]
    if not signal:
        return Guess(column, "", name.unit, note=f'its unit "{column.written}" is not known' * bool(column.written))
    if signal == "time":
        return _clock_guess(alike[0], column, name)
    missing = _marks(alike, n, signal)
    known = np.concatenate([one.columns[n].finite_values for one in alike])
    known = known[~np.isin(known, missing)]
    found = _in_unit_of_files(alike, replace(_unit_guess(column, signal, name, known), missing=missing), known)
    found = _in_told_state(found, read_state(column.name) or alike[0].state)
    doubt = implausibility(signal, found.unit, found.scale * known) if np.isfinite(found.scale) else ""
    if doubt and not found.unit_stated and signal not in COMMANDS:  # a command counts in whatever the bench takes
        written = f'the unit "{column.written}" is not known' if column.written else "no unit is stated"
        note = f"CHECK {written}, and in {found.unit} this cannot be: {doubt}"
        return replace(found, note=note, ask_unit=True)
    doubt = f"CHECK unit and column: {doubt}" if doubt else ""
    return replace(found, note="; ".join(filter(None, (found.note, _marks_note(missing), doubt))))


def _in_unit_of_files(alike: Sequence[Survey], guess: Guess, known: Array) -> Guess:
    """Return a pressure that says no unit in the one behind a number of the files' names, such as ``0-9psi``.

    Only where it reaches about that number: a name may say the supply, in another unit than the columns have.
    """
    named = [pressures_in_name(one.path) for one in alike]
    mute = not (guess.unit_stated or guess.column.written or guess.at_ambient) and np.isfinite(guess.scale)
    if not mute or not guess.signal.startswith("p") or len(units := set().union(*named)) != 1 or not known.size:
        return guess
    unit = units.pop()
    most, reached = max(one.get(unit, 0.0) for one in named), float(np.abs(known).max())
    if not most < MAX_MISSED * reached < MAX_MISSED**2 * most:
        return guess
    note = f"CHECK no unit is stated: taken for {unit}, which the file's name says"
    return replace(guess, unit=unit, note=note, ask_unit=False)


def _unit_guess(column: Column, signal: str, name: ColumnName, known: Array) -> Guess:
    reference = "absolute" if name.has(ABSOLUTE) else "gauge" if name.has(GAUGE) else ""
    reference = reference if name.kind == "pressure" else ""
    column = replace(column, written=column.written or _counts_in_name(column.name))
    if what := _what_to_scale(column, signal, name):
        unit = _SENSED_IN.get(signal[0], SIGNALS[signal].unit)
        return Guess(column, signal, unit, False, reference, f"CHECK the file says {what} in {unit}", scale=np.nan)
    if signal in ("u", "u2") and name.unit and not same_dimension(name.unit, SIGNALS[signal].unit):
        return Guess(column, signal, "V", False, "", f"CHECK {name.unit} taken for volts, one for one")
    if name.unit:
        if signal == "flow":
            return Guess(column, signal, name.unit, True, "", _reference_state(name.unit), scale=column.scale)
        doubt = f"CHECK the file writes {column.written}: larger or smaller by that factor" if column.written else ""
        doubt = "CHECK taken for a share of the stroke" if name.unit == "%" else doubt
        meant = MEANT.get((name.kind, name.unit), name.unit)
        doubt = f"CHECK {name.unit} taken for {meant}" if meant != name.unit else doubt
        return Guess(column, signal, meant, meant == name.unit, reference, doubt, scale=column.scale)
    if signal == "temperature" and column.written in _DEGREES:
        return Guess(column, signal, _DEGREES[column.written], True)
    unit, why, asked, at_ambient = guess_unit(signal, known, angle=name.has(ANGLES), written=column.written)
    return Guess(column, signal, unit, False, reference, why, ask_unit=asked, at_ambient=at_ambient)


_SENSED_IN = {"p": "bar", "x": "mm", "v": "mm/s", "f": "N"}  # what people state a sensor's scale in, by signal


def _what_to_scale(column: Column, signal: str, name: ColumnName) -> str:
    """Return what people have to say of a column in counts, volts, milliamperes or percent of a sensor; else empty."""
    if column.written and is_count(column.written):
        return f"{column.written}, which is no unit: what one count is"
    is_share = name.unit == "%" and signal not in ("x", "x_ref")
    scaled = signal not in ("u", "u2", "time") and (is_share or quantity_kind(name.unit) == "command")
    return f"{name.unit}, of a sensor: add offset, and what one {name.unit} is" if scaled else ""


def _reference_state(unit: str) -> str:
    """Return the state at which a flow in a unit of volume is taken, in words; empty for a flow of mass."""
    if same_dimension(unit, "m^3/s"):
        return f"CHECK no reference state is stated: taken at {ANR.words}; N{unit} is at 0 °C and 1.01325 bar"
    state = parse_unit(unit).state
    if state is None:
        return ""
    return f"CHECK taken at {state.words}; others mean {state.others}" if state.others else f"taken at {state.words}"


def _in_told_state(guess: Guess, state: ReferenceState | None) -> Guess:
    """Return a flow of a volume of air by the state that the file tells; others as they are."""
    if guess.signal != "flow" or state is None or not guess.unit_stated:
        return guess
    own = ANR if same_dimension(guess.unit, "m^3/s") else parse_unit(guess.unit).state
    if own is None:
        return guess
    return replace(
        guess, scale=guess.scale * state.density / own.density, note=f"scaled to {state.words}, as the file says"
    )


def _counts_in_name(name: str) -> str:
    """Return the word for counts that a name ends with, such as in ``pos_counts``; empty where there is none."""
    last = re.split(r"[_\s/]", name.strip())[-1]
    return last if len(last) > 2 and is_count(last) else ""


def _clock_guess(found: Survey, column: Column, name: ColumnName) -> Guess:
    """Return the clock with its unit, and a doubt where it runs back, which reading refuses."""
    guess = _clock_in_its_unit(found, column, name)
    seconds = continuous_stamps(column.values) * guess.scale * parse_unit(guess.unit).factor
    try:
        TimestampCheck(lambda row: f"row {row + 1}").classify_rows(seconds, seconds.size)
    except InputError as error:
        doubt = f"CHECK {error.where}: {error.found}; {error.mend}"
        return replace(guess, note="; ".join(filter(None, (guess.note, doubt))))
    return guess


def _clock_in_its_unit(found: Survey, column: Column, name: ColumnName) -> Guess:
    ticks = next((own for told, own in found.scalars.items() if tells_ticks(told) and own > 0), 0.0)
    if ticks and not name.unit and not np.any(column.finite_values % 1):
        return Guess(column, "time", "s", False, "", "ticks, as many a second as the file says", scale=1.0 / ticks)
    if name.unit in ("", "ms") and (counter := epoch_counter(column.finite_values)):
        unit, scale, what = counter
        return Guess(column, "time", unit, False, "", f"CHECK {what}", scale=scale)
    if name.unit and same_dimension(name.unit, "s"):
        note = "CHECK the sum of the steps" if column.computed and "cumsum" in str(column.key) else ""
        note = note or unusual_rate(column.finite_values * column.scale * parse_unit(name.unit).factor)
        return Guess(column, "time", name.unit, True, "", note, scale=column.scale)
    unit, why, asked, _ = guess_clock_unit(column, found.columns, found.scalars)
    return Guess(column, "time", unit, False, "", why, ask_unit=asked)


def _marks(alike: Sequence[Survey], n: int, signal: str) -> tuple[float, ...]:
    """Return the numbers that mark no value in a column of all files."""
    counts: Counter[float] = Counter()
    for one in alike:
        detector = MarkDetector(command=signal in COMMANDS)
        detector.replace(one.columns[n].values)
        counts += detector.counts
    return tuple(sorted(counts))


def _marks_note(missing: Sequence[float]) -> str:
    listed = ", ".join(f"{mark:.10g}" for mark in missing)
    return f"{listed} marks no value, as it jumps there and back" if missing else ""


def _clock(columns: Sequence[Column], names: Sequence[ColumnName], *, is_rated: bool) -> int | None:
    """Return the column that is the clock: one that rises, and is called so, or comes first and is called nothing.

    Of several that are called so, one that is computed or says its unit; a clock of single channels is none of all.
    ``is_rated``: the file says its rate, so that a column which counts rows is no clock.
    """
    own = [n for n, one in enumerate(columns) if one.where is None]
    rising = [n for n in own if is_increasing(columns[n].finite_values, named=may_be_clock(columns[n]))]
    called = [n for n in rising if names[n].has(NOUNS["time"]) or quantity_kind(names[n].unit) == "time"]
    certain = [n for n in called if columns[n].computed or quantity_kind(names[n].unit) == "time"]
    certain = [*(n for n in rising if columns[n].is_clock), *certain]
    first = (
        [*certain, *called][:1] if columns and any(one.clock is not None for one in columns) else [*certain, *called]
    )
    labview = [n for n in rising if names[n].words == ("x", "value")]  # LabVIEW's own clock
    index = [n for n in rising if names[n].words[-1:] == ("index",) and not counts_rows(columns[n])]
    nameless = [n for n in rising if not names[n].words and suits_a_clock(columns[n])]
    nameless = [n for n in nameless if not (is_rated and counts_rows(columns[n]))]
    even = [n for n in rising if not names[n].unit and goes_on_evenly(columns[n])]
    even = [n for n in even if not any(len(word) > 1 for word in names[n].noun_words)]  # s, for one, is a second, too
    return next(iter([*labview, *first, *index, *sorted(nameless, key=lambda n: counts_rows(columns[n])), *even]), None)


def _is_switched(column: Column) -> bool:
    """Return whether a column changes between a few values, as something that is set and no sensor."""
    return (
        column.finite_values.size > MIN_SWITCHED_SAMPLES
        and 1 < np.unique(column.finite_values).size <= MAX_SWITCHED_LEVELS
    )


def _assign_single_pressure(taken: dict[int, str], names: Sequence[ColumnName]) -> dict[int, str]:
    """Take a pressure that stands alone for that of chamber 1, whatever it is called; return what is to say of it."""
    for n in [n for signal in ("p2", "p_supply") for n, given in taken.items() if given == signal][:1]:
        if "p1" not in taken.values():
            doubtful = names[n].has(SUPPLY) if taken[n] == "p_supply" else "x" in taken.values()
            taken[n] = "p1"
            return {n: "CHECK taken for p1, as no other pressure is recorded"} if doubtful else {}
    return {}
