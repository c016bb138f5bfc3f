"""From the recordings of a pipeline file to the files on disk: environment variables, globs, names."""

import os
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from pneucli import paths
from pneucli.arrangements import ARRANGEMENTS
from pneucli.config.load import line_of
from pneucli.config.pipeline_tables import MoreTable, PipelineConfig, RecordingTable
from pneucli.config.signal_tables import SignalTable
from pneucli.errors import InputError, did_you_mean, require_known
from pneucli.experiments import EXPERIMENT_KINDS


@dataclass(frozen=True)
class AdditionalFile:
    """A further file of a recording, with the signals that it may hold."""

    path: Path
    table: MoreTable
    signals: dict[str, SignalTable]


@dataclass(frozen=True)
class RecordingSource:
    """One raw file as one recording; ``where`` names the place in the pipeline file that asks for it.

    ``signals`` holds ``[recordings.signals]`` over ``[signals]`` (an entry replaces the whole entry below it),
    narrowed to ``take``; those in ``required`` were asked for by this recording itself. ``commands`` are those of the
    valves where they drive both chambers.
    """

    name: str
    path: Path
    table: RecordingTable
    signals: dict[str, SignalTable]
    required: frozenset[str]
    where: str
    commands: tuple[str, ...] = ()
    additional_files: tuple[AdditionalFile, ...] = ()

    @property
    def paths(self) -> tuple[Path, ...]:
        """All files of the recording."""
        return (self.path, *(one.path for one in self.additional_files))


def recording_sources(config: PipelineConfig) -> list[RecordingSource]:
    """Return all recordings in the file's order.

    A glob that matches several files makes several recordings: ``name_1``, ``name_2``, ... in natural order, or the
    files' stems where there is no name. Raises :class:`InputError` where a file or an environment variable is missing,
    or where two recordings share a name.
    """
    text = config.path.read_text(encoding="utf-8-sig")
    found = [source for index in range(len(config.recordings)) for source in _sources_of(config, index, text)]
    twice = [name for name, count in Counter(source.name for source in found).items() if count > 1]
    if twice:
        where = next(source.where for source in reversed(found) if source.name == twice[0])
        raise InputError(
            where, f'two recordings are called "{twice[0]}"', "a name for each", "rename one of them", code="E026"
        )
    return found


def plugin_files(config: PipelineConfig) -> list[Path]:
    """Return the Python files of ``[model] plugins``; one that is not there stands for itself."""
    where, folder = f"{config.path}, key model.plugins", config.path.parent
    return [path for plugin in config.model.plugins for path in paths.matching_files_or_path(plugin, folder, where)]


def _sources_of(config: PipelineConfig, index: int, text: str) -> list[RecordingSource]:
    table = config.recordings[index]
    where = f"{config.path}, line {line_of(text, ('recordings', index, 'file'))}, recording {index + 1}"
    signals = {**config.signals.present(), **table.signals.present()}
    required = {"time", *table.signals.present(), *(table.take or [])} - table.held_constant.keys()
    if table.take is not None:
        further = {name: one for more in table.more for name, one in more.signals.present().items()}
        _check_take(table, {**signals, **further}, where)
        signals = {name: signal for name, signal in signals.items() if name in {"time", *table.take}}
    if EXPERIMENT_KINDS[table.experiment].steady:
        signals = _without_clock(signals)
    if "time" not in signals:
        mend = 'add to [signals]: time = { column = "...", unit = "s" }'
        raise InputError(where, "no signal is called time", "a column of time stamps", mend, code="E022")
    signals = {name: signal for name, signal in signals.items() if name not in table.held_constant}
    found = _paths(config.path, table.file, where)
    names = _names(table.name, found, table.part)
    required = {name for name in required & signals.keys() if name == "time" or not signals[name].optional}
    is_driven = table.chamber_2 == "valve" and EXPERIMENT_KINDS[table.experiment].axis
    commands = ARRANGEMENTS[config.arrangement].commands if is_driven else ()
    tables = _tables_by_use(table, found, where)
    more = _additional_files(config, table, len(found), where)
    return [
        RecordingSource(name, path, own, signals, frozenset(required), where, commands, further)
        for name, path, own, further in zip(names, found, tables, more, strict=True)
    ]


def _without_clock(signals: dict[str, SignalTable]) -> dict[str, SignalTable]:
    """Return the signals of rows without a clock: the number of the row takes the place of time.

    A reading that is like the one before it was measured, not held; an empty field of a command holds as in any table.
    """
    readings = {
        name: signal.model_copy(
            update={"time": None, "hold": False if signal.hold is None and name not in ("u", "u2") else signal.hold}
        )
        for name, signal in signals.items()
        if name != "time"
    }
    return {"time": SignalTable(expression="row"), **readings}


def _additional_files(
    config: PipelineConfig, table: RecordingTable, count: int, where: str
) -> list[tuple[AdditionalFile, ...]]:
    """Return the further files of each of ``count`` recordings: of globs, the first, the second, ... of each.

    A further file holds signals of ``[signals]`` and its own, as far as they are taken and not held constant.
    """
    columns = []
    for number, one in enumerate(table.more, 1):
        found = _paths(config.path, one.file, f"{where}, key more.{number}")
        if len(found) != count:
            wanted = f"{count}, one for each file of the recording"
            raise InputError(
                f"{where}, key more.{number}", f"{len(found)} files", wanted, "change the glob", code="E049"
            )
        own = {**config.signals.present(), **one.signals.present()}
        taken = {"time", *(table.take or own)} - table.held_constant.keys()
        own = {name: signal for name, signal in own.items() if name in taken}
        columns.append([AdditionalFile(path, one, own) for path in found])
    return list(zip(*columns, strict=True)) if columns else [()] * count


def _tables_by_use(table: RecordingTable, found: list[Path], where: str) -> list[RecordingTable]:
    """Return the table of each file: those that ``test`` names are held out."""
    if table.test is None:
        return [table] * len(found)
    held: set[Path] = set()
    for pattern in [table.test] if isinstance(table.test, str) else table.test:
        hits = {path for path in found if path.match(pattern)}
        if not hits:
            wanted = "a file, or a glob, of those of this recording"
            raise InputError(
                f"{where}, key test",
                f'no file "{pattern}"',
                wanted,
                did_you_mean(pattern, [p.name for p in found]),
                code="E002",
            )
        held |= hits
    test = table.model_copy(update={"use": "test"})
    return [test if path in held else table for path in found]


def _check_take(table: RecordingTable, signals: dict[str, SignalTable], where: str) -> None:
    read = [name for name in table.take or [] if name not in table.held_constant]
    require_known(read, signals, f"{where}, key take", '"{}" is not described', "a signal of [signals]", code="E091")


def _names(name: str | None, found: list[Path], part: int | None) -> list[str]:
    if name is None:
        return [path.stem if part is None else f"{path.stem}_{part}" for path in found]
    return [name] if len(found) == 1 else [f"{name}_{number}" for number in range(1, len(found) + 1)]


def _paths(pipeline: Path, file: str, where: str) -> list[Path]:
    if found := paths.matching_files(file, pipeline.parent, where):
        return found
    pattern = paths.expand_path(file, pipeline.parent, where)
    if os.path.exists(pattern):
        raise InputError(
            where, f"{pattern} is a folder, a pipe or a device", "a raw file", 'such as file = "raw/*.csv"', code="E003"
        )
    neighbours = os.listdir(pattern.parent) if os.path.isdir(pattern.parent) else []
    if archive := paths.archive_and_member(pattern):
        neighbours = paths.member_names(archive[0])
    mend = (
        did_you_mean(pattern.name, neighbours) if neighbours else f"the folder {pattern.parent} is empty or not there"
    )
    raise InputError(where, f"no file {pattern}", "a raw file, or a glob that matches some", mend, code="E002")
