"""``simulate``: open-loop and closed-loop scenarios with the identified model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pneucli.io.artifacts import write_table
from pneucli.pipeline.context import Context
from pneucli.quantities import SIGNALS
from pneucli.simulate.open_loop import OpenLoopRun, default_free_runs, run_scenario
from pneucli.stages.closed_loop import simulate_closed_loop
from pneucli.stages.flow_bench import require_recordings_over_time
from pneucli.stages.model_file import load_model
from pneucli.stages.pipeline_data import PipelineData


def run(context: Context) -> dict[str, Any]:
    """Run every scenario of ``[[scenarios]]``; return their metrics.

    By default these are the free run of the recordings, and the closed loop where a controller was designed.
    """
    study = PipelineData(context)
    require_recordings_over_time(study)
    runs = _open_loop_runs(study)
    _write(study, runs)
    return {
        "schema": "pneucli/simulate/1",
        "pipeline": context.config.name,
        "open_loop": [{"scenario": r.scenario, "channels": r.metrics()} for r in runs],
        **simulate_closed_loop(study),
    }


def _open_loop_runs(study: PipelineData) -> list[OpenLoopRun]:
    model = load_model(study.context.artifacts / "identify", study.rig, study.effects)
    stated = study.context.config.scenarios
    if not stated:
        return default_free_runs(model, study.experiments)
    by_name = {e.recording.name: e for e in study.experiments}
    where = f"{study.context.path}, key scenarios"
    return [
        run_scenario(model, table, by_name, f"{where}.{i + 1}")
        for i, table in enumerate(stated)
        if table.get("kind", "open-loop") == "open-loop"
    ]


def _write(study: PipelineData, runs: Sequence[OpenLoopRun]) -> None:
    texts: dict[str, list[str]] = {"scenario": [], "channel": [], "unit": []}
    numbers: dict[str, list[Any]] = {"time": [], "value": [], "measured": []}
    for one in runs:
        for channel, values in {**one.commands, **one.modelled}.items():
            for name, text in zip(texts, (one.scenario, channel, SIGNALS[channel].unit), strict=True):
                texts[name] += [text] * values.size
            measured = one.measured.get(channel, np.full(values.size, np.nan))
            for name, part in zip(numbers, (one.time, values, measured), strict=True):
                numbers[name].append(part)
    write_table(
        study.context.out / "open_loop.parquet",
        {**texts, **{name: np.concatenate([np.zeros(0), *parts]) for name, parts in numbers.items()}},
        units={"time": "s", "value": "see column unit", "measured": "see column unit"},
        schema="pneucli/simulate/open_loop/1",
        provenance=study.provenance("ingest/signals.parquet", "identify/model.parquet"),
    )
