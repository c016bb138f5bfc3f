"""``simulate``: open-loop and closed-loop scenarios with the identified model."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pneucli.closed_loop import robustness
from pneucli.closed_loop.metrics import compare_laws
from pneucli.closed_loop.scenarios import read_scenarios
from pneucli.closed_loop.simulation import ClosedLoopSetup, Scenario
from pneucli.controller.parameters import Controller
from pneucli.executors import engine_from
from pneucli.experiments import EXPERIMENT_KINDS
from pneucli.export.export_files import replay_exported_c
from pneucli.figure import to_answer
from pneucli.messages.formatting import format_plain
from pneucli.messages.simulate import Answer, CheckRate, OpenLoop, Robustness, SuccessRate
from pneucli.physics.declaration import Effect
from pneucli.pipeline.graph import Context
from pneucli.pipeline.manifest import program_versions
from pneucli.quantities import SIGNALS
from pneucli.simulate.model import Model
from pneucli.simulate.open_loop import OpenLoopRun, default_free_runs, run_scenario
from pneucli.stages.control_laws import (
    closed_loop_scenarios,
    closed_loop_setup,
    figure_columns,
    load_controller,
    metrics_by_law,
    selected_controller,
    write_runs,
)
from pneucli.stages.flow_bench import require_recordings_over_time
from pneucli.stages.pipeline_data import PipelineData, parameter_intervals

REST_TOLERANCE_RATIO = (
    2.0  # times the reach within which the piston is left alone: the error at rest that is good enough
)
MIN_PARALLEL_RUNS = 500  # runs, below which starting processes takes longer than they save
MONTE_CARLO_SCENARIOS = ("steps", "sine", "load")  # scenarios of the Monte Carlo study


def run(context: Context) -> dict[str, Any]:
    """Run every scenario of ``[[scenarios]]``; return their metrics.

    By default these are the free run of the recordings, and the closed loop where a controller was designed.
    """
    study = PipelineData(context)
    require_recordings_over_time(study)
    runs = _open_loop_runs(study)
    _write(study, runs)
    open_loop = [OpenLoop(r.scenario, r.metrics()) for r in runs]
    return to_answer(with_closed_loop(study, Answer("pneucli/simulate/1", context.config.name, open_loop)))


def _open_loop_runs(study: PipelineData) -> list[OpenLoopRun]:
    model = study.identified_model
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
    blocks = [
        (one.scenario, channel, SIGNALS[channel].unit, one.time, values, one.measured.get(channel, np.nan))
        for one in runs
        for channel, values in {**one.commands, **one.modelled}.items()
    ]
    tables = study.tables("simulate", "ingest/signals.parquet", "identify/model.parquet")
    columns = "scenario, channel, unit, time, value [see column unit], measured [see column unit]"
    tables.write("open_loop", columns, blocks)


def with_closed_loop(study: PipelineData, answer: Answer) -> Answer:
    """Return an answer with the closed-loop scenarios of the pipeline file, or the default ones; write their files.

    Where no controller was designed it stays as it is.
    """
    context = study.context
    if "design" not in context.answers:
        return answer
    folder, designed = context.artifacts / "design", context.answers["design"]
    controller, bench = selected_controller(folder, designed), closed_loop_setup(designed)
    model = study.identified_model
    tables = context.config.scenarios
    if scenarios := closed_loop_scenarios(context, study.recordings, controller):
        pair = {"compensated": controller, "pid_alone": load_controller(folder, "pid")}
        found = compare_laws(model, pair, scenarios, bench)
        runs = {(kind, name): one for kind, by in found.items() for name, (one, _) in by.items()}
        write_runs(study.tables("simulate", "identify/model.parquet", "design/gains.parquet"), "closed_loop", runs)
        metrics = metrics_by_law(found)
        answer = replace(
            answer,
            closed_loop=metrics["compensated"],
            pid_alone=metrics["pid_alone"],
            tolerance_um=REST_TOLERANCE_RATIO * 1e6 * controller.values["C_HOLDING_BAND"],
            exported_c=replay_exported_c(controller, model, bench, context.config.name),
        )
    studies = [t for t in tables if t.get("kind") == "monte-carlo"] or ([] if tables else [{}])
    for table in studies:
        answer = replace(answer, robust=_monte_carlo_study(study, model, controller, bench, table))
    return answer


def effects_to_draw(study: PipelineData, model: Model) -> tuple[Effect, ...]:
    """Return the effects of the catalogue that the axis of a model may have beside its own, each for both chambers."""
    active = {e.name for e in model.effects}
    parts = EXPERIMENT_KINDS["axis"].parts(vessel_is_chamber=False, supply_recorded=False) - model.lacking_parts
    return tuple(
        e for e in study.available_effects.values() if e.name not in active and e.side is None and e.part in parts
    )


def _monte_carlo_study(
    study: PipelineData, model: Model, controller: Controller, bench: ClosedLoopSetup, table: Mapping[str, Any]
) -> Robustness:
    """Run a Monte Carlo study, write its rows and rates, and return its part of the answer."""
    context = study.context
    wanted = robustness.read_settings(table, f"{context.path}, key scenarios")
    intervals = parameter_intervals(context.artifacts)
    axes = robustness.AxisDistribution(
        model, robustness.sigma_from_intervals(intervals, model), wanted.tolerances, effects_to_draw(study, model)
    )
    scenarios: tuple[Scenario, ...] = tuple(
        s for s in read_scenarios([], controller, "") if s.name in MONTE_CARLO_SCENARIOS
    )
    asked = robustness.MonteCarloStudy(axes, controller, scenarios, bench, wanted.runs, wanted.seed, wanted.checks)
    brief = asked.runs < MIN_PARALLEL_RUNS
    with engine_from(context.options.get("executor"), program_versions, threads=brief) as engine:
        rows = robustness.run_study(asked, engine, context.artifacts / ".robust", context.progress)
    rates = robustness.success_rates(rows, wanted.checks)
    _write_monte_carlo(study, rows, rates)
    checks = {
        r.check: CheckRate(r.limit, r.held, r.runs, r.share, r.worst, r.worst_run) for r in rates if r.effect == "all"
    }
    return Robustness(asked.runs, asked.seed, checks, rates)


def _sizes(sizes: Mapping[str, float]) -> str:
    """Return the sizes of what was drawn, as a text."""
    return ", ".join(f"{name} = {format_plain(size, 4)}" for name, size in sizes.items())


def _write_monte_carlo(study: PipelineData, rows: Sequence[Mapping[str, Any]], rates: Sequence[SuccessRate]) -> None:
    figures = [n for n, v in rows[0].items() if isinstance(v, float)]
    tables = study.tables("simulate", "identify/model.parquet", "design/gains.parquet")
    listed = [
        (r["run"], r["scenario"], r["effect"], _sizes(r["sizes"]), *(float(r[name]) for name in figures)) for r in rows
    ]
    tables.write("robust", f"run [1], scenario, effect, sizes, {figure_columns(figures)}", listed)
    held = [(r.check, r.effect, r.limit, float(r.held), float(r.runs), r.worst, float(r.worst_run)) for r in rates]
    columns = "check, effect, limit [the figure's], held [1], runs [1], worst [the figure's], worst_run [1]"
    tables.write("robust_rates", columns, held)
