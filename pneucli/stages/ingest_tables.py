"""The noise of each sensor: stated, or estimated from the recordings."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from pneucli.config import RecordingSource
from pneucli.experiments import EXPERIMENT_KINDS
from pneucli.io.artifacts import Provenance, write_table
from pneucli.io.raw_file import Repair
from pneucli.io.recordings import NOISE_FILE, RECORDINGS_FILE, REPAIRS_FILE, load_recordings
from pneucli.io.timestamp_order import LOSS_MESSAGES
from pneucli.noise import NoiseModel, detect_jumps, estimate_noise, jump_free_segments, pool_noise
from pneucli.pipeline.context import Context
from pneucli.plausibility import findings, summarize_signal, without_empty_signals
from pneucli.plausibility.rig_check import Weight
from pneucli.plausibility.weights import rank, repair_findings
from pneucli.quantities import SIGNALS

UNKNOWN = (np.nan, np.nan)  # interval of a noise that is stated


@dataclass
class IngestedRecording:
    """What came of one raw file."""

    source: RecordingSource
    signals: list[str]
    empty: set[str]  # of the signals that have columns, those without any value so far
    sha256: str = ""
    samples: int = 0
    period: float = float("nan")
    start: float = float("nan")
    end: float = float("nan")
    noise: dict[str, NoiseModel] = field(default_factory=dict)
    command_always_jumps: bool = False  # a command jumps all the time: what it drives is nowhere quiet
    repairs: list[Repair] = field(default_factory=list)
    rows: int = 0
    losses: Counter[str] = field(default_factory=Counter)


Array = NDArray[np.float64]
MAX_NOISE_SAMPLES = 200_000  # of a long recording, its start stands for the whole
MIN_NOISE_SAMPLES = 8  # samples that noise is estimated from


def stated_noise(source: RecordingSource) -> dict[str, float]:
    """Return the noise of signals that the pipeline file states."""
    return {name: float(signal.noise) for name, signal in source.signals.items() if signal.noise is not None}


def noise_of(
    one: IngestedRecording, heads: list[dict[str, Array]], threads: ThreadPoolExecutor
) -> dict[str, NoiseModel]:
    """Return the noise of each signal: 0 for constants, as stated, else estimated, side by side in ``threads``."""
    stated = stated_noise(one.source)
    if EXPERIMENT_KINDS[one.source.table.experiment].steady:  # neighbouring rows are different settings of the bench
        known = dict.fromkeys(one.source.table.held_constant, 0.0) | {
            n: s for n, s in stated.items() if n in one.signals
        }
        return {name: NoiseModel(white=rms, period=one.period) for name, rms in known.items()}
    time = np.concatenate([head["time"] for head in heads])
    commands = [np.concatenate([head[u] for head in heads]) for u in ("u", "u2") if u in heads[0]]
    jumps = detect_jumps(commands, time.size)
    one.command_always_jumps = jump_free_segments(jumps, one.period) is None and bool(jumps.any())
    models = {name: NoiseModel(white=0.0, period=one.period) for name in one.source.table.held_constant}
    estimates: dict[str, Future[NoiseModel]] = {}
    for name in one.signals:
        if name == "time" or name in models:
            continue
        values = np.concatenate([head[name] for head in heads])
        if name in stated:
            models[name] = NoiseModel(white=stated[name], period=one.period)
        elif np.isfinite(values).sum() >= MIN_NOISE_SAMPLES:
            measured = _sample_mask(values)
            own = detect_jumps([values], time.size)[measured] if _has_friction_jumps(name, one.source) else None
            is_lone_position = name == "x" and "a" not in one.signals
            estimates[name] = threads.submit(
                estimate_noise, time[measured], values[measured], jumps[measured], own, is_motion=is_lone_position
            )
    models |= {name: estimate.result() for name, estimate in estimates.items()}
    for name in models.keys() & one.source.signals.keys():
        step = float(one.source.signals[name].resolution or 0.0)
        models[name] = replace(models[name], step=max(models[name].step, step))
    return {name: models[name] for name in (*one.source.table.held_constant, *one.signals) if name in models}


def _has_friction_jumps(name: str, source: RecordingSource) -> bool:
    """Whether dry friction makes a signal jump: the force of a motion that is imposed and turns, and the acceleration
    of a piston that breaks away or stops. Over such jumps its spectrum would be that of slow noise.
    """
    return name == "a" or (name == "force" and source.table.imposed is not None)


def _sample_mask(values: Array) -> NDArray[np.bool_]:
    """Return which samples count: all but those that were not measured, where a signal has a clock of its own."""
    finite = np.isfinite(values)
    return np.asarray(finite if finite.mean() <= 0.8 else np.ones_like(finite))


def pool_noise_by_sensor(done: list[IngestedRecording]) -> None:
    """Share the noise model of a sensor at one rate; recordings with jumping commands count only if all have them."""
    groups: dict[tuple[str, str, int], list[IngestedRecording]] = {}
    for one in done:
        for name in one.noise.keys() & one.source.signals.keys():
            rate = round(float(np.log(one.period)) / 0.1)
            groups.setdefault((name, repr(one.source.signals[name]), rate), []).append(one)
    for (name, _, _), members in groups.items():
        shared = pool_noise(
            [one.noise[name] for one in members if not one.command_always_jumps] or [one.noise[name] for one in members]
        )
        for one in members:
            one.noise[name] = shared


def write_tables(out: Path, done: list[IngestedRecording], about: Provenance) -> None:
    """Write all tables but the signals."""
    recordings = [recording_row(one) for one in done]
    columns = {key: [row[key] for row in recordings] for key in recordings[0]}
    units = {"period": "s", "chamber": "1", "added_mass": "kg"} | dict.fromkeys(
        ("rows_read", "samples", *map(loss_column, LOSS_MESSAGES)), "1"
    )
    write_table(out / RECORDINGS_FILE, columns, units=units, schema="pneucli/ingest/recordings/1", provenance=about)
    _write_noise(out, done, about)
    repairs = [(one.source.name, r.signal, r.kind, r.count, r.message) for one in done for r in one.repairs]
    names = ("recording", "signal", "kind", "count", "message")
    listed = dict(zip(names, zip(*repairs, strict=True), strict=True)) if repairs else dict.fromkeys(names, ())
    table = {name: np.array(values, np.int64) if name == "count" else list(values) for name, values in listed.items()}
    write_table(out / REPAIRS_FILE, table, units={"count": "1"}, schema="pneucli/ingest/repairs/1", provenance=about)


def recording_row(one: IngestedRecording) -> dict[str, Any]:
    """Return a recording's row of ``recordings.parquet``."""
    table = one.source.table
    return {
        "name": one.source.name,
        "experiment": table.experiment,
        "use": table.use,
        "chamber_2": table.chamber_2 or "",
        "imposed": table.imposed or "",
        "valve_shut": table.valve == "shut",
        "chamber": table.chamber,
        "added_mass": table.added_mass or 0.0,
        "file": str(one.source.path),
        "sha256": one.sha256,
        "rows_read": one.rows,
        "samples": one.samples,
        **{loss_column(kind): one.losses[kind] for kind in LOSS_MESSAGES},
        "period": one.period,
    }


def _write_noise(out: Path, done: list[IngestedRecording], about: Provenance) -> None:
    """Write a long table, its quantities mixed: the column ``unit`` says what each row is in."""
    rows = [(one.source.name, name, model) for one in done for name, model in one.noise.items()]
    numbers = ("white", "coloured", "pole", "period", "step")
    columns: dict[str, Any] = {
        "recording": [row[0] for row in rows],
        "signal": [row[1] for row in rows],
        "unit": [SIGNALS[row[1]].unit for row in rows],
        **{key: np.array([getattr(row[2], key) for row in rows], np.float64) for key in numbers},
        **{
            key: np.array([(row[2].interval or UNKNOWN)[at] for row in rows])
            for at, key in enumerate(("least", "most"))
        },
        "lines": [json.dumps(row[2].lines) for row in rows],
    }
    units = dict.fromkeys(("white", "coloured", "step", "least", "most"), "column unit") | {"pole": "1", "period": "s"}
    write_table(out / NOISE_FILE, columns, units=units, schema="pneucli/ingest/noise/1", provenance=about)


def loss_column(kind: str) -> str:
    """Return the column that counts a kind of loss."""
    return kind.replace("-", "_")


def inspect_signals(context: Context, done: Sequence[IngestedRecording]) -> dict[str, Any]:
    """Return ``looks``, ``plausibility`` and the counts of its ``findings``, of the answer.

    What signals look like, what is odd or cannot be true of them, and what was repaired that bears on what they say.
    """
    context.progress("looking at what was read")
    recordings = load_recordings(context.out)
    stated = {one.source.name: one.source.table.held_constant.keys() for one in done}
    repairs = [
        (one.source.name, r.signal, r.kind, r.message, r.count, r.count / max(one.samples, 1))
        for one in done
        for r in one.repairs
    ]
    with ThreadPoolExecutor(1) as threads:
        summaries = {
            one.name: {n: threads.submit(summarize_signal, one, n) for n in without_empty_signals(one).signals}
            for one in recordings
        }
        odd = findings(recordings, context.config.to_rig(), stated, context.config.calibrations)
        found = sorted(map(asdict, [*odd, *repair_findings(repairs)]), key=rank)
    looks = {name: {n: asdict(summary.result()) for n, summary in own.items()} for name, own in summaries.items()}
    counts = Counter(one["weight"] for one in found)
    return {
        "looks": looks,
        "plausibility": found,
        "findings": {f"{weight}s": counts[weight] for weight in get_args(Weight)},
    }
