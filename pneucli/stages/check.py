"""``check``: a pipeline without running it: its file, its raw files, their signals, the rig."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from pneucli.config import PipelineConfig, RecordingSource, recording_sources, validate
from pneucli.document import read_toml
from pneucli.errors import InputError
from pneucli.io.multi_file import MultiFileRecording
from pneucli.io.signal_reader import SignalReader
from pneucli.messages import StageAnswer, each, labelled, table
from pneucli.messages.identify import Assumption
from pneucli.physics.effects import all_effects, select_effects
from pneucli.plausibility.required_inputs import RequiredInput, assumptions, required_inputs
from pneucli.recording import Recording
from pneucli.stages.absent_columns import Opened, absence_notes, absent_column_faults, flow_unit_assumptions
from pneucli.stages.ingest import open_recording, recorded_signals
from pneucli.stages.pipeline_file import parameter_priors, with_started_supply

TO_FILL_IN = "is to be filled in"  # ends what is said of a value with a "?"
NAMES = ("file", "test", "column", "expression")  # in which a "?" stands for a letter, or is one


@dataclass(frozen=True)
class CheckedSignal:
    """How a signal is read: from which column, in which unit, and what of it was repaired."""

    signal: str
    column: str
    unit: str
    told: str


@dataclass(frozen=True)
class CheckedRecording:
    """A recording and its signals; ``told`` is what was repaired of its file."""

    name: str
    file: str
    experiment: str
    use: str
    signals: Sequence[CheckedSignal]
    told: Sequence[str]


@dataclass(frozen=True)
class Fault:
    """What is at fault, as an InputError has it."""

    where: str
    found: str
    wanted: str
    mend: str


@dataclass(frozen=True)
class Checked(StageAnswer):
    """The answer of ``check``."""

    recordings: Sequence[CheckedRecording]
    missing: Sequence[RequiredInput]
    assumed: Sequence[Assumption]
    left_out: Sequence[str]
    faults: Sequence[Fault]

    def lines(self, file: str, verbose: bool) -> Iterator[str]:
        """Yield each recording with its signals, then what is missing, assumed and at fault."""
        for one in self.recordings:
            yield from labelled("reads", f"{one.name}: {PurePath(one.file).name}, {one.experiment}, {one.use}")
            rows = [(row.signal, row.column, row.unit or "as the file says, else SI") for row in one.signals]
            yield from table(("signal", "column", "unit"), rows, texts=3)
            for row in one.signals:
                if row.told:
                    yield from labelled("", f"{row.signal}: {row.told}")
            yield from each("", one.told)
            yield ""
        for need in self.missing:
            yield from labelled("missing", f"[{need.table}] {need.key} = {need.example}: {need.wanted}")
        for guess in self.assumed:
            yield from labelled("assumed", f"{guess.what}; {guess.instead} would say it")
        yield from each("left out", self.left_out)
        for fault in self.faults:
            more = {"wanted": fault.wanted, "mend": fault.mend}
            parts = [fault.found, *(f"{key}: {text}" for key, text in more.items() if text)]
            yield from labelled("fault", f"{fault.where}: {'; '.join(parts)}")
        if not self.missing and not self.faults:
            yield from labelled("do", f"pneucli run {file}")


def check_pipeline(path: Path) -> Checked:
    """Return what is recorded, what is missing, what is assumed, and every fault that is found without running.

    The beginning of each raw file is read. Raises InputError where the pipeline file itself is at fault.
    """
    config, faults = _loaded(path)
    waiting = {fault.where.rpartition("key ")[2] for fault in faults}
    known = _attempt(lambda: recording_sources(config), faults)
    sources = known or []
    tried = [_attempt(partial(open_recording, source, config), faults) for source in sources]
    opened = [one for one in tried if one is not None]
    # otherwise a file that is at fault may have what others lack
    complete = known is not None and len(opened) == len(sources)
    faults += absent_column_faults(config, opened, complete=complete)
    begun = [found for one in opened if (found := _attempt(partial(_beginning, one), faults)) is not None]
    if not config.model.plugins:  # which would be run to tell the names of their effects
        where = f"{path}, key model.effects"
        _attempt(lambda: select_effects(config.model.effects, all_effects(), where), faults)
        _attempt(lambda: parameter_priors(config, all_effects()), faults)
    recordings = [recording for recording, _ in begun]
    rig = _attempt(lambda: with_started_supply(config.to_rig(), config), faults) or config.to_rig()
    needs = required_inputs(recordings, rig) if recordings else []
    return Checked(
        schema="pneucli/check/1",
        pipeline=config.name,
        recordings=[checked for _, checked in begun],
        missing=[need for need in needs if f"{need.table}.{need.key}" not in waiting],
        assumed=[*flow_unit_assumptions(config), *(assumptions(recordings, rig) if recordings else [])],
        left_out=absence_notes(config, opened) if complete else [],
        faults=[Fault(one.where, one.found, one.wanted, one.mend) for one in _each(faults)],
    )


def _loaded(path: Path) -> tuple[PipelineConfig, list[InputError]]:
    """Return the pipeline without what waits to be filled in, and what waits, as faults.

    Raises InputError where the pipeline file has any other fault.
    """
    text, document = read_toml(path)
    try:
        return validate(path, document, text), []
    except InputError as error:
        waiting = [one for one in _each([error]) if one.found.endswith(TO_FILL_IN)]
        if len(waiting) < len(_each([error])):
            raise
        try:
            return validate(path, _without_waiting(document), text), waiting
        except InputError:
            raise error from None


def _without_waiting(table: dict[str, Any]) -> dict[str, Any]:
    """Return tables without the keys that wait with a ``?``; a signal whose column waits is left out."""
    kept: dict[str, Any] = {}
    for key, value in table.items():
        if isinstance(value, dict) and key != "signals":
            kept[key] = _without_waiting(value)
        elif isinstance(value, dict):
            kept[key] = {
                n: _without_waiting(one) for n, one in value.items() if isinstance(one, dict) and _is_read(one)
            }
        elif isinstance(value, list):
            kept[key] = [_without_waiting(one) if isinstance(one, dict) else one for one in value]
        elif not isinstance(value, str) or "?" not in value or key in NAMES:
            kept[key] = value
    return kept


def _is_read(signal: dict[str, Any]) -> bool:
    """Return whether the column of a signal is filled in."""
    return signal.get("column") != "?" and "?" not in str(signal.get("expression", ""))


def _attempt(work: Any, faults: list[InputError]) -> Any:
    """Return what ``work`` returns; None where it is refused, which is noted."""
    try:
        return work()
    except InputError as error:
        faults.append(error)
        return None


def _each(faults: Iterable[InputError]) -> list[InputError]:
    return [inner for one in faults for inner in (one.faults or [one])]


def _beginning(opened: Opened) -> tuple[Recording, CheckedRecording]:
    """Return the first batch of a recording, and how it is read."""
    source, file = opened
    names, _ = recorded_signals(opened)
    batch = next(iter(file.batches()))
    if batch["time"].size < 2:
        raise InputError(
            str(source.path), f"{batch['time'].size} rows", "a recording of at least 2", "check the file", code="E050"
        )
    signals = {name: values for name, values in batch.items() if name != "time" and np.isfinite(values).any()}
    signals |= {name: np.full(batch["time"].size, value) for name, value in source.table.held_constant.items()}
    table = source.table
    recording = Recording(
        name=source.name,
        experiment=table.experiment,
        use=table.use,
        time=batch["time"],
        signals=signals,
        chamber_2=table.chamber_2,
        imposed=table.imposed,
        valve_shut=table.valve == "shut",
        chamber=table.chamber,
        added_mass=table.added_mass or 0.0,
    )
    told = [one.message for one in file.repairs if not one.signal]
    read = [_signal(name, source, file) for name in names]
    return recording, CheckedRecording(source.name, str(source.path), table.experiment, table.use, read, told)


def _signal(name: str, source: RecordingSource, file: SignalReader | MultiFileRecording) -> CheckedSignal:
    asked = source.signals.get(name)
    column = "" if asked is None else str(asked.column or asked.expression)
    notes = "; ".join(one.message for one in file.repairs if one.signal == name)
    held = "held" if name in source.table.held_constant else column
    return CheckedSignal(name, held, (asked.unit or "") if asked is not None else "", notes)
