"""``ingest``: raw files -> checked signals in SI, with their noise, and a list of everything that was repaired."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import astuple, dataclass, field, fields, replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.config import PipelineConfig, RecordingSource, SignalTable, TextTable, join_faults, recording_sources
from pneucli.errors import InputError
from pneucli.experiments import EXPERIMENT_KINDS
from pneucli.figure import named, to_answer, to_json
from pneucli.gases import AIR
from pneucli.io.artifacts import Provenance, Tables, TableWriter, sha256_of, write_table
from pneucli.io.cleaning import Cleaner
from pneucli.io.multi_file import AdditionalFile, MultiFileRecording
from pneucli.io.raw_file import Channel, RawFile, Repair, missing_column
from pneucli.io.recordings import REPAIRS_FILE, SIGNALS_FILE, load_recordings, signals_schema
from pneucli.io.signal_reader import SignalReader, open_signals
from pneucli.io.timestamp_order import LOSS_MESSAGES, loss_message
from pneucli.messages.formatting import format_plain
from pneucli.messages.ingest import Answer, Implausible, NoiseAnswer, Recording, SignalSummary, Weight
from pneucli.messages.ingest import Repair as RepairAnswer
from pneucli.noise import NoiseModel, detect_jumps, estimate_noise, jump_free_segments, pool_noise
from pneucli.paths import file_on_disk
from pneucli.pipeline.graph import Context, Progress
from pneucli.plausibility import findings, summarize_signal, without_empty_signals
from pneucli.plausibility.rig_check import rank, repair_findings
from pneucli.quantities import SIGNALS
from pneucli.recording import Rig
from pneucli.stages.absent_columns import Opened, absence_notes, absent_column_faults, flow_unit, flow_unit_assumptions
from pneucli.units import factor_and_offset, parse_unit_as

UNMEASURED_PRESSURE = (
    "record p1: a command alone tells nothing of the valve; "
    'where a piston moves and x is recorded, experiment = "axis" needs no pressure'
)
SPOOL_VALVE_HINT = '; where one valve drives both chambers, say [rig.valve] arrangement = "5/3"'
MIN_PERIOD, MAX_PERIOD = 1e-9, 1e6  # s, of a sampling period
FLOW_UNIT = SIGNALS["flow"].unit
NOT_IN_TABLE = ("signals", "from", "to", "noise")  # of a recording, whose other keys are columns
WARNING_REPAIRS = (
    *("frozen", "saturated", "plateau", "spike", "stale", "gap", "no-stamp", "backward", "duplicate", "truncated"),
    *("vacuum", "cut-number", "empty", "reader", "unit"),
    *("mark", "roll-over", "jumps", "held", "spread", "counter", "matlab-object", "header-again", "event", "trailer"),
)


def run(context: Context) -> dict[str, Any]:
    """Read, clean and write all recordings of the pipeline; return the answer that ``--json`` prints.

    Raises InputError with file, line, what was found, what was wanted, and the mend.
    """
    config = context.config
    recordings = [open_recording(source, config) for source in recording_sources(config)]
    if faults := absent_column_faults(config, recordings):
        raise join_faults(config.path, faults)
    found, opened = [source for source, _ in recordings], [file for _, file in recordings]
    done = [IngestedRecording(one.source, *recorded_signals(one)) for one in recordings]
    names = {name for one in done for name in one.signals}
    with ThreadPoolExecutor(2) as threads:
        hashes = {
            path: threads.submit(sha256_of, file_on_disk(path))
            for path in dict.fromkeys(path for source in found for path in source.paths)
        }
        about = Provenance(None, {"pipeline": config.document})
        with TableWriter(context.out / SIGNALS_FILE, signals_schema(names, about)) as writer:
            for number, (one, file) in enumerate(zip(done, opened, strict=True)):
                _ingest(one, file, writer, threads, _progress_at(context.progress, number / len(done)))
                one.sha256 = hashes[one.source.path].result()
            about = Provenance({str(path): hashed.result() for path, hashed in hashes.items()}, about.parameters)
            writer.add_inputs(about)
    pool_noise_by_sensor(done)
    write_tables(context.out, done, about)
    return to_answer(_answer(context, done, absence_notes(config, recordings)))


def _progress_at(progress: Progress, fraction: float) -> Callable[[str], None]:
    return lambda message: progress(message, fraction)


def _dropped_rows_message(one: IngestedRecording) -> str:
    kinds = ", ".join(loss_message(kind, one.losses[kind]) for kind in LOSS_MESSAGES if one.losses[kind])
    return f"{one.source.name}: of {one.rows} rows {one.samples} became samples: {kinds}"


def open_recording(source: RecordingSource, config: PipelineConfig) -> Opened:
    """Open the files of a recording; return its source, with the signals by what they are in its experiment.

    A test of the valve of chamber 2 has the one command and the one pressure of a valve test, u and p1. Where its file
    has only u2 and p2, as the axis calls them, they are these.

    Raises InputError where a file, or a required signal, is not there.
    """
    file = _open_files(source, config)
    tests_valve_2 = source.table.experiment == "valve" and source.table.chamber == 2
    if not tests_valve_2 or "p1" in file.positions or "p2" not in file.positions:
        return Opened(source, file)
    names = {name: own for name, own in (("u2", "u"), ("p2", "p1")) if name in file.positions}
    replaced = {name: one for name, one in source.signals.items() if name not in names.values()}
    source = replace(
        source,
        signals={names.get(name, name): one for name, one in replaced.items()},
        required=frozenset(names.get(name, name) for name in source.required),
    )
    return Opened(source, _open_files(source, config))


def _open_files(source: RecordingSource, config: PipelineConfig) -> SignalReader | MultiFileRecording:
    required = frozenset({"time"}) if source.additional_files else source.required
    first = open_signals(_raw_file(source.path, source.table, source.signals, required, config))
    if not source.additional_files:
        return first
    parts = [
        AdditionalFile(
            open_signals(_raw_file(one.path, one.table, one.signals, frozenset({"time"}), config)),
            one.table.offset,
            one.table.match,
        )
        for one in source.additional_files
    ]
    several = MultiFileRecording(first, parts)
    for name in sorted(source.required - several.positions.keys()):
        raise missing_column(source.path, name, source.signals[name].column or 0, several.names)
    return several


def _raw_file(
    path: Path, table: TextTable, signals: dict[str, SignalTable], required: frozenset[str], config: PipelineConfig
) -> RawFile:
    rig = config.to_rig()
    return RawFile(
        path=path,
        channels={name: _channel(signal, config.unit(name), rig) for name, signal in signals.items()},
        required=required,
        **named(table, "header delimiter decimal thousands encoding skip_rows part"),
        ambient=rig.ambient_pressure,
    )


def _channel(signal: SignalTable, unit: str, rig: Rig) -> Channel:
    stated = flow_unit(signal.unit or unit) if unit == FLOW_UNIT else signal.unit or unit
    factor, offset = factor_and_offset(stated, ambient_pressure=0.0, wanted=unit)
    if parse_unit_as(stated, unit).state is not None:
        factor *= AIR.gas_constant / rig.gas_constant
    above = rig.ambient_pressure if signal.gauge else 0.0
    where = (signal.where.column, signal.where.equals) if signal.where else None
    plain = signal.unit is None and signal.expression is None and (signal.scale, signal.offset) == (1.0, 0.0)
    clock = signal.clock
    return Channel(
        signal.column or 0,
        factor * signal.scale,
        factor * signal.offset + offset + above,
        where,
        signal.decimal,
        signal.thousands,
        signal.expression,
        unit=signal.unit if signal.scale == 1.0 else None,
        si=unit if plain else None,
        clock=None if clock is None else Channel(clock.column, unit=clock.unit),
        hold=signal.hold,
        missing=None if signal.missing is None else tuple(signal.missing),
    )


def recorded_signals(recording: Opened) -> tuple[list[str], set[str]]:
    """Return the signals of a recording, and which of them have columns.

    Raises InputError where the experiment cannot do without another one that is not stated, or is optional; columns
    that are stated and absent are the matter of :func:`absent_column_faults`.
    """
    source, file = recording
    table = source.table
    present = {*file.positions, *table.held_constant}
    for name in sorted(_required_signals(source, present) - present):
        asked = source.signals.get(name)
        if asked is not None and not asked.optional:
            continue
        found = f'no column "{asked.column or asked.expression}" for {name}' if asked else f"{name} is not described"
        columns = ", ".join(f'"{column}"' for column in file.names[:30])
        mend = f'describe it in [signals], or state a constant, {name} = "... {SIGNALS[name].unit}"'
        mend = UNMEASURED_PRESSURE if name == "p1" and EXPERIMENT_KINDS[table.experiment].valve else mend
        mend += SPOOL_VALVE_HINT if name == "u2" else ""
        others = [n for n in EXPERIMENT_KINDS[table.experiment].motion_signals if n != name]
        either = f"{name} (or {', '.join(others)})" if name == "x" and others else name
        wanted = f'{either}, which experiment = "{table.experiment}" needs (columns: {columns})'
        raise InputError(f"{source.where}, file {source.path}", found, wanted, mend, code="E060")
    return [name for name in SIGNALS if name in present], set(file.positions) - {"time"}


def _required_signals(source: RecordingSource, present: set[str]) -> set[str]:
    table = source.table
    return EXPERIMENT_KINDS[table.experiment].required_signals(present, valve_shut=table.valve == "shut") | set(
        source.commands
    )


def _ingest(
    one: IngestedRecording,
    file: SignalReader | MultiFileRecording,
    writer: TableWriter,
    threads: ThreadPoolExecutor,
    tell: Callable[[str], None],
) -> None:
    """Clean one file batch by batch; a batch is written while the next one is read."""
    cleaner = _cleaner(one, file)
    heads: list[dict[str, Array]] = []
    writing: Future[None] | None = None
    for batch in _cleaned_batches(cleaner, file.batches()):
        tell(f"reading {one.source.path.name}: {file.rows} rows")
        rows = batch["time"].size
        if not rows:
            continue
        batch |= {name: np.full(rows, value) for name, value in one.source.table.held_constant.items()}
        if sum(head["time"].size for head in heads) < MAX_NOISE_SAMPLES:
            heads.append({name: values[:MAX_NOISE_SAMPLES] for name, values in batch.items()})
            one.start = one.start if np.isfinite(one.start) else float(batch["time"][0])
        one.end = float(batch["time"][-1])
        one.empty -= {name for name in one.empty if np.isfinite(batch[name]).any()}
        if writing:
            writing.result()
        writing = threads.submit(writer.write, {"recording": one.source.name, **batch})
    if writing:
        writing.result()
    one.samples, one.period, one.rows = cleaner.samples, cleaner.period, file.rows
    one.losses = file.losses + cleaner.losses
    one.repairs = [*file.repairs, *cleaner.repairs()]
    _require_usable(one)
    one.noise = noise_of(one, heads, threads)


def _cleaner(one: IngestedRecording, file: SignalReader | MultiFileRecording) -> Cleaner:
    """Return the checks of a recording: of a time series, or of rows without a clock."""
    table = one.source.table
    steady = EXPERIMENT_KINDS[table.experiment].steady
    return Cleaner(file.locate, stated_noise(one.source), (table.from_, table.to), steady=steady)


def _cleaned_batches(cleaner: Cleaner, batches: Iterator[dict[str, Array]]) -> Iterator[dict[str, Array]]:
    for batch in batches:
        yield cleaner.push(batch)
    yield cleaner.finish()


def _require_usable(one: IngestedRecording) -> None:
    """Refuse a recording that holds nothing that can be used; every row must be accounted for.

    A row with the stamps of several clocks may be several samples.
    """
    where, lost = str(one.source.path), sum(one.losses.values())
    several = any(signal.clock is not None for signal in one.source.signals.values())
    if one.rows > one.samples + lost or (one.rows < one.samples + lost and not several):
        raise RuntimeError(f"{where}: {one.rows} rows were read, {one.samples} samples and {lost} losses are known")
    if one.samples < 2:
        kinds = ", ".join(loss_message(kind, count) for kind, count in one.losses.items() if count)
        found = f"{one.samples} usable rows" + (f" ({kinds})" if kinds else "")
        raise InputError(where, found, "a recording of at least 2 samples", "check from, to and skip_rows", code="E050")
    if not MIN_PERIOD < one.period < MAX_PERIOD:
        found = f"a sampling period of {format_plain(one.period)} s"
        wanted = f"between {format_plain(MIN_PERIOD)} and {format_plain(MAX_PERIOD)} s"
        raise InputError(where, found, wanted, "check the column and unit of time", code="E045")
    for name in sorted(one.empty & _required_signals(one.source, set(one.signals))):
        found = f"no value in any of {one.samples} rows"
        raise InputError(
            f"{where}, signal {name}", found, "a recorded signal", "check its column, or leave it out", code="E050"
        )
    one.signals = [name for name in one.signals if name not in one.empty]
    one.repairs += [Repair(name, "empty", one.samples, "has no value in any row; left out") for name in one.empty]


def _answer(context: Context, done: list[IngestedRecording], absent: Sequence[str]) -> Answer:
    repairs = _repairs(done)
    warnings = [one.text for one in repairs if one.kind in WARNING_REPAIRS]
    warnings += [f"{one.what}; to say otherwise: {one.instead}" for one in flow_unit_assumptions(context.config)]
    looks, found = _inspect_signals(context, done)
    counts = Counter(one.weight for one in found)
    return Answer(
        schema="pneucli/ingest/1",
        pipeline=context.config.name,
        recordings=[_recording_answer(one) for one in done],
        left_out=[*(_dropped_rows_message(one) for one in done if one.rows > one.samples), *absent],
        repairs=repairs,
        warnings=warnings,
        looks=looks,
        plausibility=found,
        findings={f"{weight}s": counts[weight] for weight in get_args(Weight)},
    )


def _repairs(done: list[IngestedRecording]) -> list[RepairAnswer]:
    return [RepairAnswer(one.source.name, *astuple(repair)) for one in done for repair in one.repairs]


def _recording_answer(one: IngestedRecording) -> Recording:
    table = one.source.table
    return Recording(
        name=one.source.name,
        experiment=table.experiment,
        use=table.use,
        chamber_2=table.chamber_2 or "",
        imposed=table.imposed or "",
        valve_shut=table.valve == "shut",
        chamber=table.chamber,
        added_mass=table.added_mass or 0.0,
        file=str(one.source.path),
        sha256=one.sha256,
        rows_read=one.rows,
        samples=one.samples,
        losses={loss_column(kind): one.losses[kind] for kind in LOSS_MESSAGES},
        period=one.period,
        signals=one.signals,
        from_=one.start,
        to=one.end,
        noise={name: NoiseAnswer(model.rms, SIGNALS[name].unit) for name, model in one.noise.items()},
    )


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
    tables = Tables(out, "ingest", about)
    rows = [to_json(_recording_answer(one)) for one in done]
    losses = ", ".join(f"{loss_column(kind)} [1]" for kind in LOSS_MESSAGES)
    columns = (
        "name, experiment, use, chamber_2, imposed, valve_shut, chamber [1], added_mass [kg], file, sha256, "
        f"rows_read [1], samples [1], {losses}, period [s]"
    )
    tables.write("recordings", columns, [[row[key] for key in row if key not in NOT_IN_TABLE] for row in rows])
    noise = [
        (
            *(one.source.name, name, SIGNALS[name].unit, m.white, m.coloured, m.pole, m.period, m.step),
            *(m.interval or UNKNOWN),
            json.dumps(m.lines),
        )
        for one in done
        for name, m in one.noise.items()
    ]
    columns = (
        "recording, signal, unit, white [column unit], coloured [column unit], pole [1], period [s], "
        "step [column unit], least [column unit], most [column unit], lines"
    )
    tables.write("noise", columns, noise)
    repairs = _repairs(done)
    listed = {one.name: [getattr(repair, one.name) for repair in repairs] for one in fields(RepairAnswer)}
    table = listed | {"count": np.array(listed["count"], np.int64)}
    write_table(out / REPAIRS_FILE, table, units={"count": "1"}, schema="pneucli/ingest/repairs/1", provenance=about)


def loss_column(kind: str) -> str:
    """Return the column that counts a kind of loss."""
    return kind.replace("-", "_")


def _inspect_signals(
    context: Context, done: Sequence[IngestedRecording]
) -> tuple[dict[str, dict[str, SignalSummary]], list[Implausible]]:
    """Return what signals look like, and what is odd or cannot be true of them.

    The latter with what was repaired that bears on what they say.
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
    looks = {name: {n: summary.result() for n, summary in own.items()} for name, own in summaries.items()}
    return looks, sorted([*odd, *repair_findings(repairs)], key=rank)
