"""Steady benches in ``identify`` and ``compare``: by themselves, whatever else a pipeline records."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from pneucli.compare.channel_errors import ChannelResult, channel_result
from pneucli.errors import InputError
from pneucli.identify.valve.flow_bench import FlowBench, FlowComparison, compare_flow, identify_flow_bench
from pneucli.identify.valve.steady_budget import with_flow_budgets
from pneucli.io.artifacts import TableWriter
from pneucli.messages.findings import tell
from pneucli.pipeline.context import NotApplicable
from pneucli.quantities import SIGNALS
from pneucli.stages.answer_parts import assumed_values, measurement_of
from pneucli.stages.flow_tables import flow_answer, flow_parameters, path_label, write_flow
from pneucli.stages.parameter_tables import budgets_answer, write_budgets, write_parameters
from pneucli.stages.pipeline_data import PipelineData

RATIO_PORT, LEAK_PORT = "critical_ratio", "leak_area"  # where effects act that rows of steady flow can show


def flow_bench(study: PipelineData) -> FlowBench | None:
    """Return the flow paths of the steady benches; None where the pipeline records none.

    Raises InputError where rows are recorded and none can be fitted.
    """
    if not study.flow_recordings:
        return None
    bench = identify_flow_bench(study.flow_recordings, study.rig)
    if bench is None:
        names = ", ".join(one.name for one in study.flow_recordings if one.use == "train") or "none of use train"
        mend = 'check the columns of flow, p_supply and p1, and that one recording has use = "train"'
        raise InputError(
            f"{study.context.path}, key recordings", f"no row with a flow ({names})", "rows of flow", mend, code="E060"
        )
    recorded = set.intersection(*(set(one.signals) for one in study.flow_recordings))
    null = bench.rig.valve_null
    return with_flow_budgets(bench, lambda path: path_label(bench, path, null), measurement_of(study), sorted(recorded))


def identify_flow_only(study: PipelineData) -> dict[str, Any]:
    """Identify a pipeline that records steady benches alone; write its files, return the answer of ``identify``."""
    study.context.progress("fitting the flow of each opening")
    bench = flow_bench(study)
    assert bench is not None
    tables = study.tables("identify", "ingest/signals.parquet")
    write_parameters(flow_parameters(bench), tables)
    write_flow(bench, tables, valve_map=True)
    write_budgets(bench.budgets, tables)
    answer = flow_answer(bench)
    idle = [effect.name for effect in study.effects if not {RATIO_PORT, LEAK_PORT} & effect.ports.keys()]
    return {
        "schema": "pneucli/identify/1",
        "pipeline": study.context.config.name,
        "model": {"effects": [e.name for e in study.effects], "parameters": answer["parameters"]},
        "assumed": [asdict(one) for one in assumed_values(study, set())],
        "warnings": [
            *(one["text"] for one in answer["findings"]),
            *([tell("effects-idle", names=", ".join(idle))] if idle else []),
        ],
        "flow": answer,
        "uncertainty": budgets_answer(bench.budgets),
    }


def require_recordings_over_time(study: PipelineData) -> None:
    """Raise NotApplicable where the pipeline records steady benches alone."""
    if not study.recordings:
        wanted = "a recording over time: a valve test, a friction test or an axis"
        raise NotApplicable(f"{study.context.path}", "rows of a steady bench alone", wanted, code="E060")


def flow_results(comparisons: Sequence[FlowComparison]) -> list[ChannelResult]:
    """Return the error of the channel ``flow`` in each recording of a steady bench."""
    return [
        channel_result(one.recording, "flow", one.measured, one.predicted, one.noise)
        for one in comparisons
        if np.isfinite(one.predicted).any()
    ]


def compare_flow_recordings(study: PipelineData) -> list[FlowComparison]:
    """Return measured and fitted flow of every recording of a steady bench; the fit is that of ``identify``."""
    bench = flow_bench(study)
    return [] if bench is None else compare_flow(bench, study.flow_recordings)


def write_flow_residuals(comparisons: Sequence[FlowComparison], writer: TableWriter) -> None:
    """Append the rows to ``residuals.parquet``: the number of the row takes the place of time."""
    for one in comparisons:
        columns = {
            "recording": one.recording.name,
            "use": one.recording.use,
            "channel": "flow",
            "unit": SIGNALS["flow"].unit,
            "time": one.row.astype(np.float64),
            "measured": one.measured,
            "model": one.predicted,
            "residual": one.measured - one.predicted,
            "segment": np.zeros(one.row.size),
        }
        writer.write(columns)
