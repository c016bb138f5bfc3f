"""Part of ``init``: the pipeline file, with the evidence for each line, and a ``?`` where people have to fill in."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path, PurePath

import numpy as np
import tomlkit

from pneucli.experiments import EXPERIMENT_KINDS
from pneucli.init.experiments import GuessedExperiment, Line, rig_tables, sign_conventions
from pneucli.init.file_groups import FileGroup
from pneucli.init.survey_types import Guess
from pneucli.init.units import Reference
from pneucli.io.column_reader import is_rate, stated_period
from pneucli.io.raw_file import ColumnKey, RawFile
from pneucli.messages.formatting import format_plain
from pneucli.units import parse_unit

References = Mapping[str, Reference]
MAX_DEFAULT_PERIOD = 0.02  # s between samples that the usual horizon is made for
MIN_HORIZON_SAMPLES = 20  # samples within another one
PLACEHOLDER = re.compile(r'"[^"#]*\?[^"]*"')


def pipeline_text(
    directory: Path, groups: Sequence[FileGroup], experiments: Sequence[GuessedExperiment], references: References
) -> str:
    """Return the pipeline file."""
    shared = _shared(groups, references)
    lines = [
        "# Guessed from the raw files: look at every line; what says CHECK the data alone cannot tell.",
        "[pipeline]",
    ]
    lines += [f"name = {toml_string(directory.resolve().name)}"]
    for table, keys in rig_tables(groups, experiments):
        lines += ["", f"[{table}]", *map(_line, keys)]
    lines += ["", "[signals]  # least, median and most of each, in its column's unit", *shared.values()]
    lines += [*_unused_columns(groups)]
    names = _names(groups)
    for kind, one, name in zip(groups, experiments, names, strict=True):
        lines += ["", *_recording(directory, kind, one, name), *_take(kind, one, groups)]
        lines += _own_signals(kind, references, shared, "recordings.signals")
        for further in kind.further_files:
            lines += ["", "[[recordings.more]]  # of the same recording, its clock as it is; or offset"]
            lines += [f"file = {toml_string(relative_path(further.file, directory))}", *_layout(further)]
            lines += _own_signals(further, references, shared, "recordings.more.signals")
    return "\n".join([*lines, "", "[model]", "effects = []", "", *_compare(groups)])


def fields_to_fill_in(text: str) -> list[tuple[int, str]]:
    """Return line (from 1) and dotted key of all that waits for people to fill it in."""
    table, found = "", []
    for number, line in enumerate(text.splitlines(), 1):
        if header := re.match(r"\[+([\w.]+)\]+", line):
            table = header[1]
        elif not line.startswith("#") and PLACEHOLDER.search(line.split("  #")[0]):
            found.append((number, f"{table}.{line.split('=')[0].strip()}"))
    return found


def toml_string(text: str) -> str:
    """Return a text as TOML has it."""
    return tomlkit.item(text).as_string()


def _shared(kinds: Sequence[FileGroup], references: References) -> dict[str, str]:
    """Return the line of each signal that holds for most files; the others have a line of their own."""
    candidates: dict[str, list[str]] = {}
    for kind in kinds:
        for name, guess in kind.signals.items():
            if name == "time" or not _columns_share_names(kind):
                candidates.setdefault(name, []).extend([_signal(kind, guess, references)] * len(kind.surveys))
    shared = {name: _most_common_line(lines) for name, lines in candidates.items()}
    if "time" not in shared and not all(kind.steady for kind in kinds):
        shared = {"time": _clock(kinds), **shared}
    if not any(kind.signals.keys() & {"p1", "x"} or kind.steady for kind in kinds):
        shared["p1"] = (
            'p1 = { column = "?", unit = "bar" }  # no column looks like a pressure or a position: see those below'
        )
    if any("x" in kind.signals and not kind.signals.keys() & {"p1", "force", "u"} for kind in kinds):
        shared["force"] = (
            'force = { column = "?", unit = "N" }  # no pressure and no force is recognised: one is needed'
        )
    return shared


def _most_common_line(lines: Sequence[str]) -> str:
    """Return the first of the lines that are the most alike, their comments aside."""
    ((most_common, _),) = Counter(map(_without_comment, lines)).most_common(1)
    return next(line for line in lines if _without_comment(line) == most_common)


def _take(kind: FileGroup, one: GuessedExperiment, groups: Sequence[FileGroup]) -> Iterator[str]:
    """Yield the line that says which signals files have, where their experiment would use those of others too."""
    elsewhere = {name for other in groups for name in other.signals} - kind.signals.keys()
    if elsewhere & (EXPERIMENT_KINDS[one.experiment].used_signals | {"u2"}):
        yield f"take = [{', '.join(map(toml_string, kind.signals))}]  # the files have no column of the others"


def _signal(kind: FileGroup, one: Guess, references: References) -> str:
    column = one.column
    source = "expression" if column.computed else "column"
    parts = [f"{source} = {_key(column.key)}", f"unit = {toml_string('?' if one.ask_unit else one.unit)}"]
    if one.scale != 1.0:
        parts.append(f"scale = {one.scale:.10g}" if np.isfinite(one.scale) else 'scale = "?"')
    if column.clock is not None:
        parts.append(f"time = {_key(column.clock)}")
    if one.missing:
        parts.append(f"missing = [{', '.join(f'{mark:.10g}' for mark in one.missing)}]")
    if column.thousands:
        parts.append(f"thousands = {toml_string(column.thousands)}")
    if column.where:
        label, channel = column.where
        parts.append(f"where = {{ column = {toml_string(str(label))}, equals = {toml_string(channel)} }}")
    notes = [_value_range(kind, one), one.why]
    if one.signal in ("p1", "p2", "p_supply", "p_ref"):
        reference, unit = references[one.unit], parse_unit(one.unit)
        parts += [f'reference = "{reference.kind}"'] * (not unit.gauge and not unit.absolute)
        notes.append(reference.why)
    if one.signal in (flip := sign_conventions(kind)):
        parts = [part for part in parts if not part.startswith("scale")]
        parts.append(f"scale = {-one.scale:.10g}" if one.scale != 1.0 else "scale = -1.0")
        notes.append(flip[one.signal])
    return f"{one.signal} = {{ {', '.join(parts)} }}  # {'; '.join(filter(None, notes))}"


def _key(key: ColumnKey) -> str:
    return str(key) if isinstance(key, int) else toml_string(key)


def _value_range(kind: FileGroup, one: Guess) -> str:
    each = kind.raw_numbers(one.signal)
    if one.signal == "time":
        factor = parse_unit(one.unit).factor * one.scale
        steps = np.concatenate([np.diff(values) for values in each])
        steps = steps[steps > 0]
        if not steps.size:
            return "CHECK its stamps do not go on"
        longest = max(float(np.ptp(values)) for values in each if values.size) * factor
        return f"{format_plain(1 / (float(np.median(steps)) * factor), 4)} Hz, up to {format_plain(longest, 4)} s"
    values = np.concatenate(each)
    if not values.size:
        return "no numbers"
    return f"{format_plain(values.min(), 4)}, {format_plain(np.median(values), 4)}, {format_plain(values.max(), 4)}"


def _compare(kinds: Sequence[FileGroup]) -> list[str]:
    """Return the horizon of slow recordings: a fifth of the longest, of samples enough."""
    clocks = [
        values for kind in kinds if "time" in kind.signals for values in kind.values_per_file("time") if values.size > 1
    ]
    period = max((float(np.median(np.diff(values))) for values in clocks), default=0.0)
    longest = max((float(np.ptp(values)) for values in clocks), default=0.0)
    if period <= MAX_DEFAULT_PERIOD or not 0.0 < longest < np.inf:
        return []
    horizon = min(longest, max(longest / 5, MIN_HORIZON_SAMPLES * period))
    tens = 10.0 ** np.floor(np.log10(horizon))
    horizon = float(np.ceil(horizon / tens) * tens)
    return [
        "[compare]",
        f'horizon = "{horizon:g} s"  # the model starts anew so often; samples come every {period:.3g} s',
        "",
    ]


def _without_comment(line: str) -> str:
    return line.split("  #", maxsplit=1)[0]


def _clock(kinds: Sequence[FileGroup]) -> str:
    """Return the clock of files that have none: the number of the row over the sampling rate."""
    scalars = {name: value for kind in kinds for name, value in kind.surveys[0].scalars.items()}
    if (entry := stated_period(scalars)) is not None:
        name, period = entry
        text = f"row / {1 / period:.9g}" if is_rate(name) else f"row * {period:.9g}"
        return f'time = {{ expression = "{text}" }}  # CHECK no column rises like a clock; {name} = {scalars[name]:.9g}'
    return 'time = { expression = "row / ?" }  # no column rises like a clock: put in the samples per second'


def _columns_share_names(kind: FileGroup) -> bool:
    """Return whether several files of one recording call different signals alike: each then describes its own."""
    keys = [one.column.key for name, one in kind.signals.items() if name != "time"]
    return bool(kind.further_files) and len(set(keys)) < len(keys)


def _own_signals(kind: FileGroup, references: References, shared: Mapping[str, str], table: str) -> list[str]:
    """Return the table of the signals that a file has in other columns, or writes in another way."""
    own = {name: _signal(kind, guess, references) for name, guess in kind.guesses_by_signal.items()}
    differ = [line for name, line in own.items() if _without_comment(line) != _without_comment(shared.get(name, ""))]
    return [f"[{table}]", *differ] if differ else []


def _unused_columns(kinds: Sequence[FileGroup]) -> Iterator[str]:
    """Yield comments with the columns that are not taken, and with single values."""
    written: set[object] = set()
    for kind in kinds:
        for one in kind.unused:
            if (key := (one.column.key, one.column.where)) in written:
                continue
            written.add(key)
            known = one.column.finite_values
            seen = (
                f"{format_plain(known.min(), 4)} to {format_plain(known.max(), 4)} {one.unit}".strip()
                if known.size
                else "no numbers"
            )
            name = one.column.key if isinstance(one.column.key, int) else toml_string(one.column.name)
            yield f"# not taken: column {name}, {seen}" + (f"; {one.why}" if one.why else "")
    for kind in kinds:
        yield from (f"# not taken: {reason}" for one in kind.surveys for reason in one.unused if reason not in written)
        written |= {reason for one in kind.surveys for reason in one.unused}
    scalars = {f"{n} = {format_plain(v, 9)}": None for kind in kinds for n, v in kind.surveys[0].scalars.items()}
    if scalars:
        yield f"# single values: {', '.join(scalars)}"


def _names(groups: Sequence[FileGroup]) -> list[str]:
    """Return a name for each group whose files are called like those of another one; empty for the others."""
    stems = [{(survey.path.stem, survey.raw.part) for survey in kind.surveys} for kind in groups]
    runs = [kind.surveys[0].run for kind in groups]
    often = Counter(stem for own in stems for stem in own)
    names = []
    for kind, own, run in zip(groups, stems, runs, strict=True):
        path, part = kind.surveys[0].path, kind.surveys[0].raw.part
        plain = f"{path.parent.name}_{path.name}".replace(".", "_") + (f"_{part}" if part else "")
        plain = f"{path.stem}_{run}" if run else plain
        names.append(plain if any(often[stem] > 1 for stem in own) else "")
    return names


def _recording(directory: Path, kind: FileGroup, one: GuessedExperiment, name: str) -> list[str]:
    many = len(kind.surveys) > 1
    alone_held = not many and bool(kind.held_out)
    lines = ["[[recordings]]" + f"  # {len(kind.surveys)} files" * many]
    lines += [f"name = {toml_string(name)}"] if name else []
    lines += [f"file = {toml_string(relative_path(kind.file, directory))}", f'experiment = "{one.experiment}"']
    lines += [f'use = "{"test" if alone_held else "train"}"']
    if many and kind.held_out:
        lines.append(
            f"test = {toml_string(kind.held_out[0].path.name)}  # of these files, the one that is never fitted to"
        )
    return [*lines, *_layout(kind), *map(_line, one.keys)]


def _layout(kind: FileGroup) -> list[str]:
    """Return how the text has to be read, as far as reading does not find it by itself."""
    raw = kind.surveys[0].raw
    keys = ("header", "skip_rows", "part", "delimiter", "decimal")
    usual, stated = RawFile(raw.path, {}), {key: getattr(raw, key) for key in keys}
    return [f"{key} = {tomlkit.item(own).as_string()}" for key, own in stated.items() if own != getattr(usual, key)]


def _line(line: Line) -> str:
    key, value, comment = line
    return f"{key} = {value}" + (f"  # {comment}" if comment else "")


def relative_path(file: str, directory: Path) -> str:
    """Return a path or glob as seen from ``directory``, with slashes on every system; whole where there is no way."""
    try:
        found = os.path.relpath(file, directory.resolve())
    except ValueError:  # another drive of Windows
        found = file
    return PurePath(found).as_posix()
