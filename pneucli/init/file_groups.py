"""Part of ``init``: which files are of one kind, what was tried in them, and which of them to hold out."""

from __future__ import annotations

import glob
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pneucli.arrays import Array
from pneucli.init.clock_columns import is_increasing
from pneucli.init.column_names import DOWNSTREAM, UPSTREAM, read_name
from pneucli.init.columns import guess_columns
from pneucli.init.survey_types import Column, Guess, Survey
from pneucli.init.units import Reference, pressure_reference, pressure_reference_from_force, to_si
from pneucli.io.clock import continuous_stamps
from pneucli.io.column_reader import stated_period
from pneucli.paths import archive_members, natural_order
from pneucli.quantities import SIGNALS
from pneucli.units import STANDARD_ATMOSPHERE, parse_unit, same_dimension

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
    note = "; ".join(filter(None, (first.note, note)))
    return {
        id(first): replace(first, signal="p_supply", note=note, rival=""),
        id(last): replace(last, signal="p1", rival=""),
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
    return {id(one): replace(one, signal="u", unit="V", scale=1.0, note=note, rival="")}


MIN_MOTION_STEPS = 20.0  # times the usual step between samples, that the range of what moves is
_NUMBER = re.compile(r"\d+(?:[.,]\d+)?")


@dataclass(frozen=True, eq=False)
class FileGroup:
    """Files that are read alike and are called alike: ``file`` is their path or glob, ``held_out`` those held out.

    ``unused`` are the columns that are no signal; ``further_files`` are further files of the same recording.
    """

    surveys: Sequence[Survey]
    file: str
    held_out: Sequence[Survey]
    guesses_by_signal: Mapping[str, Guess]
    unused: Sequence[Guess]
    further_files: Sequence[FileGroup] = ()

    @property
    def steady(self) -> bool:
        """Whether these are rows of a steady flow bench."""
        return not self.further_files and is_steady_bench(self.surveys, self.guesses_by_signal)

    @property
    def signals(self) -> dict[str, Guess]:
        """The signals of the recording, those of further files included."""
        found = {
            name: one for kind in (*reversed(self.further_files), self) for name, one in kind.guesses_by_signal.items()
        }
        return {name: found[name] for name in SIGNALS if name in found}

    def raw_numbers(self, signal: str) -> list[Array]:
        """Return the numbers of a signal as they stand in the files, a file each."""
        home = next(kind for kind in (self, *self.further_files) if signal in kind.guesses_by_signal)
        return [column_values(one, home.guesses_by_signal[signal]) for one in home.surveys]

    def pooled_values(self, signal: str) -> Array:
        """Return the values of a signal in SI, without references, of all files."""
        return np.concatenate(self.values_per_file(signal))

    def values_per_file(self, signal: str) -> list[Array]:
        """Return the values of a signal in SI, without references, a file each."""
        one = self.signals[signal]
        wanted = SIGNALS[signal].unit if same_dimension(one.unit, SIGNALS[signal].unit) else one.unit
        return [to_si(scaled(values, one), one.unit, wanted) for values in self.raw_numbers(signal)]


def column_values(found: Survey, one: Guess) -> Array:
    """Return the numbers of a guess in one of the files that it is made for; of others none."""
    same = (c.finite_values for c in found.columns if (c.key, c.where) == (one.column.key, one.column.where))
    values = next(same, np.zeros(0))
    if one.signal == "time":
        return continuous_stamps(values)
    return values[~np.isin(values, one.missing)] if one.missing else values


def scaled(values: Array, one: Guess) -> Array:
    """Return numbers of a column in the unit of a guess; as they are where people have to say the scale."""
    return values if one.scale == 1.0 or not np.isfinite(one.scale) else values * one.scale


def group_files(surveys: Sequence[Survey]) -> list[FileGroup]:
    """Return the kinds of files, in their order, each with one of them to hold out."""
    found = [kind for alike in _same_layout(surveys) for kind in _groups_of(alike)]
    return _hold_out(found)


def _same_layout(surveys: Sequence[Survey]) -> list[list[Survey]]:
    """Return files that are read alike: with the same signals in the same columns."""
    groups: dict[object, list[Survey]] = {}
    for one in surveys:
        layout = (one.is_text, one.raw.header, one.raw.skip_rows, one.raw.delimiter, one.raw.decimal, one.raw.part)
        taken = tuple((g.column.key, g.column.where, g.column.unit, g.signal) for g in guess_columns([one]) if g.signal)
        keys = tuple(column.key for column in one.columns)
        nameless = all(isinstance(key, int) for key in keys)
        groups.setdefault((layout, keys if nameless else taken), []).append(one)
    return list(groups.values())


def _groups_of(alike: list[Survey]) -> Iterator[FileGroup]:
    alike, extra = _common(alike)
    guesses = as_steady_bench(alike, guess_columns(alike))
    found = {one.signal: one for one in guesses}
    signals = {name: found[name] for name in SIGNALS if name in found}
    idle = [
        *(one for one in guesses if one.signal not in signals),
        *(Guess(column, "", column.unit) for column in extra),
    ]
    groups: dict[object, list[Survey]] = {}
    for one in alike:
        groups.setdefault((one.path.parent, _NUMBER.sub("#", one.path.stem), one.path.suffix), []).append(one)
    for files in groups.values():
        ordered = sorted(files, key=lambda one: natural_order(one.path))
        if file := _glob([one.path for one in ordered]):
            yield FileGroup(ordered, file, (), signals, idle)
        else:
            yield from (FileGroup([one], one.path.as_posix(), (), signals, idle) for one in ordered)


def _common(alike: list[Survey]) -> tuple[list[Survey], list[Column]]:
    """Return the files with the columns that all of them have, in one order, and one each of the others."""
    by_key = [{(column.key, column.where): column for column in one.columns} for one in alike]
    common = [key for key in by_key[0] if all(key in columns for columns in by_key)]
    extra = {key: column for columns in by_key for key, column in columns.items() if key not in common}
    same = zip(alike, by_key, strict=True)
    return [replace(one, columns=[columns[key] for key in common]) for one, columns in same], list(extra.values())


def _glob(paths: Sequence[Path]) -> str:
    """Return a glob that matches these files and no others; nothing where there is none."""
    if len(paths) == 1:
        return paths[0].as_posix()
    numbers = list(zip(*(_NUMBER.findall(path.stem) for path in paths), strict=True))
    texts = _NUMBER.split(paths[0].stem)
    slots = [glob.escape(same[0]) if len(set(same)) == 1 else "*" for same in numbers]
    stem = "".join(glob.escape(text) + slot for text, slot in zip(texts, [*slots, ""], strict=True))
    pattern = f"{glob.escape(paths[0].parent.as_posix())}/{stem}{glob.escape(paths[0].suffix)}"
    return pattern if {*map(Path, glob.glob(pattern)), *archive_members(Path(pattern))} == set(paths) else ""


def _hold_out(found: Sequence[FileGroup]) -> list[FileGroup]:
    """Hold out the middle one of each kind that moves; of files that are alone in theirs, one of each experiment."""
    moving: dict[object, list[Survey]] = {}
    for kind in found:
        alike = kind if len(kind.surveys) > 1 else tuple(sorted(kind.guesses_by_signal))
        moving.setdefault(alike, []).extend(one for one in kind.surveys if is_moving(kind, one))
    held = {id(own[len(own) // 2]) for own in moving.values() if len(own) > 1}
    return [replace(k, held_out=[one for one in k.surveys if id(one) in held]) for k in found]


def is_moving(kind: FileGroup, one: Survey) -> bool:
    """Return whether what a recording is about moves in it: the piston, else the pressure."""
    signal = next((name for name in ("x", "p1", "force") if name in kind.guesses_by_signal), "")
    values = column_values(one, kind.guesses_by_signal[signal]) if signal else np.zeros(0)
    if values.size < 2:
        return False
    steps = np.abs(np.diff(values))
    few = values.size < 5 * MIN_MOTION_STEPS
    return values.size > 1 and float(np.ptp(values)) > (2.0 if few else MIN_MOTION_STEPS) * float(np.median(steps))


def pressure_references(found: Sequence[FileGroup]) -> dict[str, Reference]:
    """Return gauge or absolute and the evidence for it, for the unit of each pressure, by unit.

    Sensors in one unit count alike unless their names say otherwise; what one of them tells holds for all.
    """
    references: dict[str, Reference] = {}
    for kind in found:
        for signal, one in kind.signals.items():
            if not signal.startswith("p"):
                continue
            is_asked = one.ask_unit or not np.isfinite(one.scale)  # such numbers tell no pressure
            columns = [] if is_asked else [scaled(values, one) for values in kind.raw_numbers(signal)]
            answer = pressure_reference(columns, one.unit, one.reference)
            if answer.certainty < 2 and signal == "p1" and "force" in kind.signals:
                answer = pressure_reference_from_force(columns, kind.raw_numbers("force"), one.unit) or answer
            if one.unit not in references or answer.certainty > references[one.unit].certainty:
                references[one.unit] = answer
    for kind in found:
        references |= _reference_of_supply(kind, references)
    return references


def _reference_of_supply(kind: FileGroup, references: Mapping[str, Reference]) -> dict[str, Reference]:
    """Return the reference of a supply that bounds a chamber of known reference, in a unit of its own, or a doubt."""
    own = [kind.signals.get(name) for name in ("p_supply", "p1")]
    if own[0] is None or own[1] is None or not parse_unit(own[0].unit).factor:
        return {}
    custom, known = references[own[0].unit], references[own[1].unit]
    supply = float(np.median(kind.pooled_values("p_supply"))) - float(np.quantile(kind.pooled_values("p1"), 0.99))
    if own[0].unit == own[1].unit:
        doubt = f"CHECK {known.why.removeprefix('CHECK ')}; p1 rises to 1 bar above p_supply: is one of them gauge?"
        doubted = not known.stated and abs(supply / STANDARD_ATMOSPHERE + 1) < 0.3
        return {own[0].unit: Reference(known.kind, doubt, min(known.certainty, 1))} if doubted else {}
    if custom.certainty or not known.certainty:
        return {}
    off = {
        one: abs(supply + STANDARD_ATMOSPHERE * ((one == "gauge") - (known.kind == "gauge")))
        for one in ("gauge", "absolute")
    }
    best = min(off, key=lambda one: off[one])
    told = Reference(best, f"CHECK {best}: so p1 comes up to it", certainty=0)
    return {own[0].unit: told} if off[best] < 0.3 * STANDARD_ATMOSPHERE else {}


def join_files_of_one_recording(surveys: Sequence[Survey]) -> FileGroup | None:
    """Return one kind for all files, if each holds a clock and readings, no two of them the same signal.

    Either each holds one reading, or one of them holds nothing that makes a recording by itself. A single reading is
    called what its column is called, or its file where all columns are called alike.
    """
    guesses = [guess_columns([one]) for one in surveys]
    pairs = [_clock_and_readings(own) for own in guesses]
    if len(surveys) < 2 or None in pairs:
        return None
    found = [pair for pair in pairs if pair is not None]
    owners = [n for n, (_, own) in enumerate(found) for _ in own]
    readings = [column for _, own in found for column in own]
    single = len(owners) == len(surveys)
    if len({one.name for one in readings}) < len(readings):
        stems = zip(owners, readings, strict=True)
        readings = [replace(one, name=surveys[n].path.stem) for n, one in stems] if single else []
    clocks = [clock for clock, _ in found]
    together = guess_columns([Survey(surveys[0].raw, surveys[0].is_text, [clocks[0].column, *readings], {})])[1:]
    signals = [one.signal for one in together]
    by_file: list[dict[str, Guess]] = [{"time": clock} for clock in clocks]
    for n, one, column in zip(owners, together, (own for _, each in found for own in each), strict=False):
        by_file[n] |= {one.signal: replace(one, column=column)}
    alone = [any(g.signal in _RECORDED and not g.only_pressure for g in own) for own in guesses]
    distinct = "" not in signals and len(set(signals)) == len(owners)
    if not distinct or not (single or not all(alone)) or not _overlap_in_time(clocks):
        return None
    kinds = [
        FileGroup([survey], survey.path.as_posix(), (), own, ()) for survey, own in zip(surveys, by_file, strict=True)
    ]
    kinds.sort(key=lambda kind: [*SIGNALS].index([*kind.guesses_by_signal][1]))
    return replace(kinds[0], further_files=kinds[1:])


_RECORDED = {"p1", "p2", "force", "flow"}  # of which a recording has one


def _clock_and_readings(guesses: Sequence[Guess]) -> tuple[Guess, list[Column]] | None:
    """Return the clock of a file and its readings, beside counters, further stamps and what never changes."""
    clock = [g for g in guesses if g.signal == "time"]
    rest = [g.column for g in guesses if g.signal != "time"]
    moving = [one for one in rest if len(rest) > 1 and one.finite_values.size and np.ptp(one.finite_values) > 0]
    rest = [one for one in moving if not is_increasing(one.finite_values)] or rest
    return (clock[0], rest) if len(clock) == 1 and rest and all(one.where is None for one in rest) else None


def _overlap_in_time(clocks: Sequence[Guess]) -> bool:
    """Return whether all files have a time in common."""
    times = [parse_unit(one.unit).factor * one.column.finite_values for one in clocks]
    if any(values.size == 0 for values in times):
        return False
    return bool(max(float(np.min(t)) for t in times) < min(float(np.max(t)) for t in times))
