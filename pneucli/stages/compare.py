"""``compare``: model against recordings: how much they differ, and where."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from itertools import chain
from typing import Any

import numpy as np

from pneucli import paths
from pneucli.closed_loop.commissioning import commissioned
from pneucli.closed_loop.log_replay import (
    ControllerLog,
    Engine,
    Replay,
    find_replay,
    log_on_grid,
    log_resolution,
    logged_loop,
    predict_loop,
    replay_rounding_error,
    setup_from_recording,
)
from pneucli.closed_loop.metrics import evaluate_run
from pneucli.closed_loop.simulation import ClosedLoopSetup, Run, replay_log, replay_states
from pneucli.compare import Comparison, compare, find_error_regions, overall_error
from pneucli.compare.channel_errors import Correlation, evaluate_channel, residual_correlations
from pneucli.compare.error_regions import beyond_fitted, excess_beyond_fitted
from pneucli.compare.expected_error import ExpectedError, expected_errors
from pneucli.compare.goodness_of_fit import (
    excused_error,
    free_runs,
    is_judged,
    judge_fit,
    judge_with_free_runs,
    parameter_error_squares,
)
from pneucli.config import recording_sources
from pneucli.controller import layout
from pneucli.export.controller_program import ExportedController, load_controller
from pneucli.export.single_precision import replay_in_single_precision
from pneucli.figure import read, to_answer
from pneucli.identify.valve.flow_bench import FlowComparison
from pneucli.io.artifacts import TableWriter, schema_from
from pneucli.messages.compare import Answer, ChannelResult, Commissioned, LackOfFit, ModelAnswer
from pneucli.messages.compare import ControllerLog as ControllerLogAnswer
from pneucli.messages.progress import counted
from pneucli.pipeline.graph import Context
from pneucli.quantities import SIGNALS
from pneucli.recording import Recording
from pneucli.simulate.model import Model
from pneucli.stages import history
from pneucli.stages.answer_parts import FREE_RUN_KEYS, divergences, purpose_of
from pneucli.stages.flow_bench import compare_flow_recordings, flow_residual_blocks, flow_results
from pneucli.stages.pipeline_data import PipelineData, load_drawn_models

UNKNOWN_CONTROLLER = "unknown"
MIN_COMMAND_ERROR = 1e-9  # V, within which any two programs of one controller agree


@dataclass(frozen=True)
class ReplayedLog:
    """A log, the controller that ran, and its replay."""

    recording: Recording
    exported: ExportedController
    log: ControllerLog
    engine: Engine
    replay: Replay


RESIDUALS_FILE = "residuals.parquet"


def run(context: Context) -> dict[str, Any]:
    """Compare the identified model with every recording; return the answer that ``--json`` prints."""
    study = PipelineData(context)
    flows = compare_flow_recordings(study)
    comparisons, expected, looked, model = _compare_over_time(study) if study.recordings else ([], [], {}, None)
    _write_residuals(study, comparisons, flows)
    _write_correlations(study, [c for one in comparisons for c in residual_correlations(one, study.horizon)])
    results = [*(r for c in comparisons for r in c.results), *flow_results(flows)]
    beyond, within = beyond_fitted(comparisons)
    judged, whole = (None, []) if model is None else _judgement(study, comparisons, expected, model)
    blind = [c.experiment.recording.name for c in comparisons if c.experiment.lacks_pressures]
    free = {r.key: {key: getattr(r, key) for key in FREE_RUN_KEYS} for r in whole}
    found = Answer(
        schema="pneucli/compare/1",
        pipeline=context.config.name,
        horizon_s=study.horizon,
        model=read(ModelAnswer, context.answers["identify"]["model"]),
        channels=[replace(r, free_run=free.get(r.key)) for r in results],
        error={use: overall_error(results, use) for use in ("train", "test")},
        where=find_error_regions(comparisons),
        purpose=purpose_of(results, context.config.compare.tolerance),
        data=study.data_digest,
        contradicted=study.contradicted,
        beyond_fitted=beyond,
        error_within_fitted=within,
        lack_of_fit=judged,
        free_run=divergences(whole),
        without_pressure=blind or None,
        closed_loop=[] if model is None else [log_answer(one, model) for one in looked.values()],
    )
    answer = to_answer(found)
    for channel in answer["channels"] if model else ():
        channel.setdefault("free_run", None)
    if model is None:  # rows of a steady bench have neither a restart nor a course
        del answer["lack_of_fit"], answer["free_run"]
    return {**answer, **history.record_model(context, answer, RESIDUALS_FILE)}


def _compare_over_time(
    study: PipelineData,
) -> tuple[list[Comparison], list[ExpectedError], dict[str, ReplayedLog], Model]:
    """Compare the model with the recordings over time, and replay the controllers of those that state one."""
    context = study.context
    model = study.identified_model
    experiments = study.experiments

    def progress(i: int) -> None:
        context.progress(counted(f"comparing {experiments[i].recording.name}", i, len(experiments)))

    expected = expected_errors(model, experiments, progress)
    comparisons = [_with_limits(compare(model, e, one.rms), one) for e, one in zip(experiments, expected, strict=True)]
    controllers = controllers_by_recording(context)
    looked = {
        r.name: replay_recording(model, r, controllers[r.name]) for r in study.recordings if r.name in controllers
    }
    return [with_commands(c, looked, model) for c in comparisons], expected, looked, model


def _with_limits(found: Comparison, expected: ExpectedError) -> Comparison:
    """Return a comparison with the limit of each channel's error."""
    results = tuple(
        replace(r, ratio_limit=expected.distribution([r.channel]).limit()) if is_judged(r, expected) else r
        for r in found.results
    )
    return replace(found, results=results)


def _judgement(
    study: PipelineData, comparisons: Sequence[Comparison], expected: Sequence[ExpectedError], model: Model
) -> tuple[LackOfFit | None, list[ChannelResult]]:
    """Return the judgement of the model's error, and the errors of its free runs."""
    drawn = load_drawn_models(study.context.artifacts / "identify", model)
    experiments = [c.experiment for c in comparisons]
    whole = free_runs(model, experiments, lambda: drawn)
    judged = judge_fit(
        [c.results for c in comparisons],
        expected,
        lambda: parameter_error_squares(model, drawn, experiments),
        excused_error([c.segment_squares for c in comparisons], excess_beyond_fitted(comparisons), expected),
    )
    return judge_with_free_runs(judged, whole), whole


def _model_inputs(study: PipelineData) -> tuple[str, ...]:
    """Return the artifacts that the comparison reads: rows of a steady bench alone have no model file."""
    return ("ingest/signals.parquet", *(["identify/model.parquet"] if study.recordings else []))


def _write_residuals(study: PipelineData, comparisons: Sequence[Comparison], flows: Sequence[FlowComparison]) -> None:
    columns = (
        "recording, use, channel, unit, time, measured [see column unit], model [see column unit], "
        "residual [see column unit], segment [1]"
    )
    made_by = study.provenance(*_model_inputs(study))
    schema = schema_from(columns, schema="pneucli/compare/residuals/1", provenance=made_by)
    with TableWriter(study.context.out / RESIDUALS_FILE, schema) as writer:
        for block in chain(*map(_residual_blocks, comparisons), flow_residual_blocks(flows)):
            writer.write(dict(zip(schema.names, block, strict=True)))


def _residual_blocks(found: Comparison) -> Iterator[tuple[Any, ...]]:
    segments = found.experiment.segments.astype(np.float64)
    for one in found.results:
        name = one.channel
        curves = found.measured[name], found.modelled[name], found.residual(name)
        yield one.recording, one.use, name, SIGNALS[name].unit, found.experiment.time, *curves, segments


def _write_correlations(study: PipelineData, found: Sequence[Correlation]) -> None:
    blocks = [(c.recording, c.use, c.channel, c.against, c.lag, c.correlation, c.bound) for c in found]
    columns = "recording, use, channel, against, lag [s], correlation [1], bound [1]"
    study.tables("compare", *_model_inputs(study)).write("correlation", columns, blocks)


def controllers_by_recording(context: Context) -> dict[str, ExportedController]:
    """Return the controllers that ran, by recording; unnamed ones are left out. Raises InputError."""
    found = {}
    for source in recording_sources(context.config):
        name = source.table.controller
        if name is not None and name != UNKNOWN_CONTROLLER:
            where = f"{source.where}.controller"
            found[source.name] = load_controller(paths.expand_path(name, context.path.parent, where), where)
    return found


def replay_recording(model: Model, recording: Recording, exported: ExportedController) -> ReplayedLog:
    """Replay one log; raises InputError where it was not logged at every sample."""
    log, controller = log_on_grid(recording, exported.controller), exported.controller
    engine: Engine = partial(replay_log, model, controller)
    if exported.precision == "float32":
        engine = partial(replay_in_single_precision, controller)
    return ReplayedLog(recording, exported, log, engine, find_replay(engine, log))


def with_commands(found: Comparison, replayed: Mapping[str, ReplayedLog], model: Model) -> Comparison:
    """Return a comparison with the logged commands as further channels, held against those of the replay, if any."""
    recording = found.experiment.recording
    if recording.name not in replayed:
        return found
    looked = replayed[recording.name]
    replay, places = looked.replay, looked.log.grid_indices
    # a position that is counted is logged as it is
    rounded = {n: log_resolution(recording[n]) for n in ("x", "x_ref", "p1", "p2", "p_supply") if n in recording}
    steps = {n: step for n, step in rounded.items() if n == "x_ref" or recording.noise_rms(n) > step > 0.0}
    off = replay_rounding_error(looked.engine, looked.log, replay, steps) if steps else 0.0
    names = ["u", *(["u2"] if "u2" in recording else [])]
    read = {name: recording[name] for name in names}
    commands = {name: replay.commands[places, i] for i, name in enumerate(names)}
    results = tuple(
        evaluate_channel(found.experiment, n, read[n], commands[n], _command_error_floor(recording, n, off))
        for n in names
    )
    return replace(
        found,
        results=found.results + results,
        measured={**found.measured, **read},
        modelled={**found.modelled, **commands},
    )


def _command_error_floor(recording: Recording, name: str, off: float) -> float:
    """Return what a right replay differs by in V: the rounding of readings, and that of the command."""
    return max(float(np.hypot(off, log_resolution(recording[name]) / np.sqrt(12.0))), MIN_COMMAND_ERROR)


def log_answer(looked: ReplayedLog, model: Model) -> ControllerLogAnswer:
    """Return the predicted and the measured figures of a logged closed loop."""
    controller, exported = looked.exported.controller, looked.exported
    expected = predict_loop(model, controller, looked.log, setup_from_recording(looked.recording, ClosedLoopSetup()))
    came = logged_loop(model, controller, looked.log, looked.replay)
    return ControllerLogAnswer(
        *(looked.recording.name, looked.recording.use, controller.law, exported.hash, exported.precision),
        began=looked.replay.start_mode,
        supply_told="p_supply" in looked.replay.readings,
        foretold=_loop_answer(expected, model, looked),
        measured=_loop_answer(came, model, looked),
        commissioned=commissioned_machine(looked, model),
    )


def commissioned_machine(looked: ReplayedLog, model: Model) -> Commissioned | None:
    """Return what the commissioning found with which a log begins, from a replay in double precision; None without."""
    replay, controller = looked.replay, looked.exported.controller
    if replay.start_mode != "commission":
        return None
    return commissioned(replay_states(model, controller, replay.readings, replay.start_mode)[0])


def _loop_answer(run: Run, model: Model, looked: ReplayedLog) -> Mapping[str, Any]:
    return asdict(evaluate_run(run, model, looked.exported.controller)) | mean_estimates(run)


def mean_estimates(run: Run) -> dict[str, float]:
    """Return the means of the controller's estimates: of the load in N, and of the flow past the valve in Pa/s."""
    return {
        "load_estimate_n": float(np.mean(run.log[:, layout.L_LOAD])),
        "flow_estimate_pa_s": float(np.mean(run.log[:, layout.L_FLOW1])),
    }
