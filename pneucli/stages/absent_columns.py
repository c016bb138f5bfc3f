"""Signals as a pipeline states them: columns that the raw files lack, and reference states of flows."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from pneucli.config import PipelineConfig, RecordingSource, SignalTable, line_of
from pneucli.errors import MAX_LISTED, InputError
from pneucli.experiments import EXPERIMENT_KINDS
from pneucli.io.expression import ROW, Expression
from pneucli.io.multi_file import MultiFileRecording
from pneucli.io.raw_file import ColumnKey, column_position, nearest_column
from pneucli.io.signal_reader import SignalReader
from pneucli.messages.identify import Assumption
from pneucli.units import parse_unit, same_dimension

STANDARD_STATE = "ANR"


def is_plain_volume_flow(unit: str | None) -> bool:
    """Return whether a unit measures a volume per time and says no state of the gas.

    >>> is_plain_volume_flow("m3/h"), is_plain_volume_flow("Nm3/h"), is_plain_volume_flow("kg/s")
    (True, False, False)
    """
    return unit is not None and same_dimension(unit, "m^3/s")


def flow_unit(unit: str) -> str:
    """Return a unit of flow with the reference atmosphere of ISO 8778 where it names no state.

    >>> flow_unit("l/min"), flow_unit("Nl/min")
    ('l/min ANR', 'Nl/min')
    """
    return f"{unit} {STANDARD_STATE}" if is_plain_volume_flow(unit) else unit


def flow_unit_assumptions(config: PipelineConfig) -> Iterator[Assumption]:
    """Yield the reference state in which each volume flow of the pipeline is taken, where its unit leaves a doubt."""
    tables = [config.signals, *(one.signals for one in config.recordings)]
    units = (table.flow.unit for table in tables if table is not None and table.flow is not None)
    for unit in dict.fromkeys(one for one in units if one is not None):
        state = parse_unit(flow_unit(unit)).state
        if state is None or unit.rstrip(")").endswith(STANDARD_STATE):
            continue
        others = "0 °C and 1.01325 bar" if is_plain_volume_flow(unit) else state.others
        what = f"flow in {unit} is a volume of air at {state.words}" + (f", not {others}" if others else "")
        yield Assumption(what, 'unit = "l/min ANR" (20 °C, 1 bar) or "Nl/min" (0 °C, 1.01325 bar), in [signals] flow')


class Opened(NamedTuple):
    """A recording and its opened files."""

    source: RecordingSource
    file: SignalReader | MultiFileRecording


def absent_column_faults(
    config: PipelineConfig, opened: Sequence[Opened], *, complete: bool = True
) -> list[InputError]:
    """Return a fault for each signal of ``[signals]`` whose column is stated and absent.

    A column is wrong where no recording has it, or where a recording lacks it whose experiment uses the signal.
    ``optional = true``, ``take`` and a constant in its place allow its absence.

    Args:
        config: The pipeline.
        opened: Recordings with their opened files.
        complete: Whether these are all recordings. Another one may have the column otherwise.

    """
    faults = []
    for name, table in config.signals.present().items():
        lacking = [] if table.optional else _without(name, opened)
        using = [one for one in lacking if name in _used_signals(one.source)]
        is_somewhere = not complete or any(_missing_keys(table, one) == [] for one in opened)
        if wrong := using if is_somewhere else (using or lacking):
            faults.append(_fault(config, name, table, wrong))
    return faults


def absence_notes(config: PipelineConfig, opened: Sequence[Opened]) -> list[str]:
    """Return a line for each signal of ``[signals]`` that some recordings may lack, and do, or that none takes."""
    notes = []
    for name, table in config.signals.present().items():
        lacking = _without(name, opened)
        if lacking:
            experiments = dict.fromkeys(one.source.table.experiment for one in lacking)
            reason = "optional" if table.optional else f"not needed for {' and '.join(experiments)}"
            notes.append(f"[signals] {name}: absent from {len(lacking)} of {len(opened)} recordings; {reason}")
        elif not any(_takes(one.source, name, table) for one in opened):
            notes.append(f"[signals] {name}: no recording takes it")
    return notes


def _without(name: str, opened: Sequence[Opened]) -> list[Opened]:
    """Return the recordings that are asked for a signal by ``[signals]`` alone, and whose files lack its column."""
    return [
        one for one in opened if name in one.source.signals.keys() - one.source.required - one.file.positions.keys()
    ]


def _takes(source: RecordingSource, name: str, table: SignalTable) -> bool:
    """Return whether a recording has a signal, under this name or the one that its experiment gives it."""
    return name in source.signals or name in source.table.held_constant or table in source.signals.values()


def _missing_keys(table: SignalTable, one: Opened) -> list[ColumnKey]:
    """Return the columns of a signal that a recording's files lack; columns that share a name are not missing."""
    return [key for key in _keys(table) if key != ROW and not _is_column(key, one)]


def _keys(table: SignalTable) -> Sequence[ColumnKey]:
    return Expression(table.expression).columns if table.expression is not None else (table.column or 0,)


def _is_column(key: ColumnKey, one: Opened) -> bool:
    try:
        return column_position(one.source.path, "", key, one.file.names) is not None
    except InputError:
        return True


def _taken(one: Opened) -> set[int]:
    """Return the positions of the columns that the signals of a recording are read from."""
    signals = [own for name, own in one.source.signals.items() if name in one.file.positions]
    keys = [key for own in signals for key in _keys(own)]
    places = (column_position(one.source.path, "", key, one.file.names) for key in keys)
    return {place for place in places if place is not None}


def _used_signals(source: RecordingSource) -> set[str]:
    """Return the signals by which a recording's model is driven, and those that are compared."""
    table = source.table
    shut, still = {"u"} if table.valve == "shut" else set(), {"p2"} if table.chamber_2 == "open" else set()
    return {*EXPERIMENT_KINDS[table.experiment].used_signals, *source.commands} - shut - still


def _fault(config: PipelineConfig, name: str, table: SignalTable, lacking: Sequence[Opened]) -> InputError:
    first, *others = lacking
    column = (_missing_keys(table, first) or [table.column or 0])[0]
    key = "column" if table.expression is None else "expression"
    line = line_of(config.path.read_text(encoding="utf-8-sig"), ("signals", name, key))
    more = f" and {len(others)} more" if others else ""
    shown = f'"{column}"' if isinstance(column, str) else str(column)
    nearest = nearest_column(str(column), first.file.names, _taken(first))
    listed = ", ".join(f'"{one}"' for one in first.file.names[:MAX_LISTED])
    allowed = f"where recordings are without {name}: optional = true in [signals] {name}, or take in [[recordings]]"
    return InputError(
        f"{config.path}, line {line}, key signals.{name}.{key}",
        f"{first.source.path}{more}: no column {shown}",
        f"one of {listed}",
        f"{nearest}; {allowed}" if isinstance(column, str) else allowed,
        code="E042",
    )
