"""``compare``: model against recordings: how much they differ, and where."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import pyarrow as pa

from pneucli.compare import ChannelResult, Comparison, Region, compare, find_error_regions, overall_error
from pneucli.compare.beyond_fitted import excess_beyond_fitted
from pneucli.compare.excused_segments import excused_error
from pneucli.compare.expected_error import ExpectedError, expected_errors
from pneucli.compare.free_run import free_runs, judge_with_free_runs
from pneucli.compare.goodness_of_fit import is_judged, judge_fit, parameter_error_squares
from pneucli.compare.residual_correlation import Correlation, residual_correlations
from pneucli.identify.valve.flow_bench import FlowComparison
from pneucli.io.artifacts import TableWriter, schema_of, write_table
from pneucli.messages.progress import counted
from pneucli.pipeline.context import Context
from pneucli.quantities import SIGNALS
from pneucli.simulate.model import Model
from pneucli.stages import controller_logs, history
from pneucli.stages.fit_answer import beyond_fitted_answer, diverging_answer, free_run_answer, lack_of_fit_answer
from pneucli.stages.flow_bench import compare_flow_recordings, flow_results, write_flow_residuals
from pneucli.stages.model_file import load_drawn_models, load_model
from pneucli.stages.pipeline_data import PipelineData
from pneucli.stages.purpose_answer import purpose_answer

RESIDUALS_FILE = "residuals.parquet"


def run(context: Context) -> dict[str, Any]:
    """Compare the identified model with every recording; return the answer that ``--json`` prints."""
    study = PipelineData(context)
    flows = compare_flow_recordings(study)
    comparisons, expected, looked, model = _compare_over_time(study) if study.recordings else ([], [], {}, None)
    _write_residuals(study, comparisons, flows)
    _write_correlations(study, [c for one in comparisons for c in residual_correlations(one, study.horizon)])
    results = [*(r for c in comparisons for r in c.results), *flow_results(flows)]
    answer = _answer(study, results, find_error_regions(comparisons))
    answer |= beyond_fitted_answer(comparisons)
    if model is not None:
        answer |= _judgement(study, comparisons, expected, model, answer["channels"])
    answer["closed_loop"] = [] if model is None else [controller_logs.log_answer(one, model) for one in looked.values()]
    return answer | history.record_model(context, answer, RESIDUALS_FILE)


def _compare_over_time(
    study: PipelineData,
) -> tuple[list[Comparison], list[ExpectedError], dict[str, controller_logs.ReplayedLog], Model]:
    """Compare the model with the recordings over time, and replay the controllers of those that state one."""
    context = study.context
    model = load_model(context.artifacts / "identify", study.rig, study.effects)
    experiments = study.experiments

    def progress(i: int) -> None:
        context.progress(counted(f"comparing {experiments[i].recording.name}", i, len(experiments)))

    expected = expected_errors(model, experiments, progress)
    comparisons = [_with_limits(compare(model, e, one.rms), one) for e, one in zip(experiments, expected, strict=True)]
    controllers = controller_logs.controllers_by_recording(context)
    looked = {
        r.name: controller_logs.replay_recording(model, r, controllers[r.name])
        for r in study.recordings
        if r.name in controllers
    }
    return [controller_logs.with_commands(c, looked, model) for c in comparisons], expected, looked, model


def _with_limits(found: Comparison, expected: ExpectedError) -> Comparison:
    """Return a comparison with the limit of each channel's error."""
    results = tuple(
        replace(r, ratio_limit=expected.distribution([r.channel]).limit()) if is_judged(r, expected) else r
        for r in found.results
    )
    return replace(found, results=results)


def _judgement(
    study: PipelineData,
    comparisons: Sequence[Comparison],
    expected: Sequence[ExpectedError],
    model: Model,
    channels: Sequence[dict[str, Any]],
) -> dict[str, Any]:
    """Return the judgement of the model's error and of its free runs; ``channels`` get theirs."""
    drawn = load_drawn_models(study.context.artifacts / "identify", model)
    experiments = [c.experiment for c in comparisons]
    whole = free_runs(model, experiments, lambda: drawn)
    by_channel = {(r.recording, r.channel): free_run_answer(r) for r in whole}
    for one in channels:
        one["free_run"] = by_channel.get((one["recording"], one["channel"]))
    judged = judge_fit(
        [c.results for c in comparisons],
        expected,
        lambda: parameter_error_squares(model, drawn, experiments),
        excused_error([c.segment_squares for c in comparisons], excess_beyond_fitted(comparisons), expected),
    )
    return {
        "lack_of_fit": lack_of_fit_answer(judge_with_free_runs(judged, whole)),
        "free_run": diverging_answer(whole),
    }


def _answer(study: PipelineData, results: Sequence[ChannelResult], regions: Sequence[Region]) -> dict[str, Any]:
    return {
        "schema": "pneucli/compare/1",
        "pipeline": study.context.config.name,
        "horizon_s": study.horizon,
        "model": study.context.answers["identify"]["model"],
        "channels": [_nan_to_null(asdict(r)) for r in results],
        "error": {use: overall_error(results, use) for use in ("train", "test")},
        "where": [_region_answer(asdict(r)) for r in regions],
        "purpose": purpose_answer(results, study.context.config.compare.tolerance),
        "data": study.data_digest,
        "contradicted": study.contradicted,
    }


def _nan_to_null(row: dict[str, Any]) -> dict[str, Any]:
    """JSON knows no NaN: null stands for an undefined number, such as a percentage of a zero range."""
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in row.items()}


def _region_answer(row: dict[str, Any]) -> dict[str, Any]:
    return {"from" if k == "from_" else k: v for k, v in row.items()}


def _model_inputs(study: PipelineData) -> tuple[str, ...]:
    """Return the artifacts that the comparison reads: rows of a steady bench alone have no model file."""
    return ("ingest/signals.parquet", *(["identify/model.parquet"] if study.recordings else []))


def _write_residuals(study: PipelineData, comparisons: Sequence[Comparison], flows: Sequence[FlowComparison]) -> None:
    types: dict[str, Any] = dict.fromkeys(("recording", "use", "channel", "unit"), pa.string())
    types |= dict.fromkeys(("time", "measured", "model", "residual", "segment"), pa.float64())
    schema = schema_of(
        types,
        units={"time": "s", "segment": "1"} | dict.fromkeys(("measured", "model", "residual"), "see column unit"),
        schema="pneucli/compare/residuals/1",
        provenance=study.provenance(*_model_inputs(study)),
    )
    with TableWriter(study.context.out / RESIDUALS_FILE, schema) as writer:
        for c in comparisons:
            for result in c.results:
                columns = {
                    "recording": result.recording,
                    "use": result.use,
                    "channel": result.channel,
                    "unit": SIGNALS[result.channel].unit,
                    "time": c.experiment.time,
                    "measured": c.measured[result.channel],
                    "model": c.modelled[result.channel],
                    "residual": c.residual(result.channel),
                    "segment": c.experiment.segments.astype(np.float64),
                }
                writer.write(columns)
        write_flow_residuals(flows, writer)


def _write_correlations(study: PipelineData, found: Sequence[Correlation]) -> None:
    texts = {name: [getattr(one, name) for one in found for _ in one.lag] for name in ("recording", "use", "channel")}
    numbers = {name: [np.zeros(0), *(getattr(one, name) for one in found)] for name in ("lag", "correlation")}
    bounds = [np.zeros(0), *(np.full(one.lag.size, one.bound) for one in found)]
    write_table(
        study.context.out / "correlation.parquet",
        {
            **texts,
            "against": [one.against for one in found for _ in one.lag],
            **{name: np.concatenate(parts) for name, parts in numbers.items()},
            "bound": np.concatenate(bounds),
        },
        units={"lag": "s", "correlation": "1", "bound": "1"},
        schema="pneucli/compare/correlation/1",
        provenance=study.provenance(*_model_inputs(study)),
    )
