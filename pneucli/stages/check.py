"""``check``: a pipeline without running it: its file, its raw files, their signals, the rig."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.config import PipelineConfig, RecordingSource, load, recording_sources
from pneucli.errors import InputError
from pneucli.io.multi_file import MultiFileRecording
from pneucli.io.signal_reader import SignalReader
from pneucli.physics.effects import all_effects, select_effects
from pneucli.plausibility.required_inputs import assumptions, required_inputs
from pneucli.recording import Recording
from pneucli.stages.flow_units import flow_unit_assumptions
from pneucli.stages.ingest import open_recording, recorded_signals

Answer = dict[str, Any]


def check_pipeline(path: Path) -> Answer:
    """Return what is recorded, what is missing, what is assumed, and every fault that is found without running.

    The beginning of each raw file is read. Raises InputError where the pipeline file itself is at fault.
    """
    config = load(path)
    faults: list[InputError] = []
    sources = _attempt(lambda: recording_sources(config), faults) or []
    rows = [(source, _attempt(partial(_beginning, source, config), faults)) for source in sources]
    if not config.model.plugins:  # which would be run to tell the names of their effects
        where = f"{path}, key model.effects"
        _attempt(lambda: select_effects(config.model.effects, all_effects(), where), faults)
    recordings = [found[0] for _, found in rows if found is not None]
    rig = config.to_rig()
    missing = [asdict(need) for need in required_inputs(recordings, rig)] if recordings else []
    return {
        "schema": "pneucli/check/1",
        "pipeline": config.name,
        "recordings": [_row(source, found[1]) for source, found in rows if found is not None],
        "missing": missing,
        "assumed": [
            asdict(one)
            for one in (*flow_unit_assumptions(config), *(assumptions(recordings, rig) if recordings else []))
        ],
        "faults": [{key: getattr(one, key) for key in ("where", "found", "wanted", "mend")} for one in _each(faults)],
    }


def _attempt(work: Any, faults: list[InputError]) -> Any:
    """Return what ``work`` returns; None where it is refused, which is noted."""
    try:
        return work()
    except InputError as error:
        faults.append(error)
        return None


def _each(faults: Iterable[InputError]) -> list[InputError]:
    return [inner for one in faults for inner in (one.faults or [one])]


def _beginning(source: RecordingSource, config: PipelineConfig) -> tuple[Recording, list[dict[str, str]]]:
    """Return the first batch of a recording, and its signals with their columns and units."""
    file = open_recording(source, config)
    names, _ = recorded_signals(source, file)
    batch = next(iter(file.batches()))
    if batch["time"].size < 2:
        raise InputError(str(source.path), f"{batch['time'].size} rows", "a recording of at least 2", "check the file")
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
    )
    return recording, [_signal(name, source, file) for name in names]


def _signal(name: str, source: RecordingSource, file: SignalReader | MultiFileRecording) -> dict[str, str]:
    """Return how a signal is read: from which column, in which unit, and what of it was repaired."""
    asked = source.signals.get(name)
    column = "" if asked is None else str(asked.column or asked.expression)
    notes = "; ".join(one.message for one in file.repairs if one.signal == name)
    held = "held" if name in source.table.held_constant else column
    return {"signal": name, "column": held, "unit": (asked.unit or "") if asked is not None else "", "told": notes}


def _row(source: RecordingSource, signals: list[dict[str, str]]) -> dict[str, Any]:
    table = source.table
    about = {"name": source.name, "file": str(source.path), "experiment": table.experiment, "use": table.use}
    return {**about, "signals": signals}
