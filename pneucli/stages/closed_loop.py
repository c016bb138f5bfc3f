"""The closed-loop part of ``simulate``: the designed controller in its scenarios, and its PIDs alone beside it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from pneucli.closed_loop import robustness
from pneucli.closed_loop.law_comparison import trial
from pneucli.closed_loop.scenarios import scenarios_from
from pneucli.closed_loop.simulation import Bench, Scenario
from pneucli.controller.parameters import Controller
from pneucli.executors import engine_from
from pneucli.experiments import KINDS
from pneucli.io.artifacts import read_table, write_table
from pneucli.pipeline.manifest import identity
from pneucli.simulate.model import Model
from pneucli.stages.design import bench_of, chosen_controller, load_controller
from pneucli.stages.law_comparison import figures, scenarios_of, unit_of, write_runs
from pneucli.stages.pipeline_data import Study, load_model

TOLERATED = 2.0  # times the reach within which the piston is left alone: the error at rest that is good enough
BRIEF = 500  # runs, below which starting processes takes longer than they save
STUDIED = ("steps", "sine", "load")  # scenarios of the Monte Carlo study


def simulate_closed_loop(study: Study) -> dict[str, Any]:
    """Run the closed-loop scenarios of the pipeline file, or the default ones; write their files, return their part
    of the answer. Nothing where no controller was designed.
    """
    context = study.context
    if "design" not in context.answers:
        return {}
    folder, designed = context.artifacts / "design", context.answers["design"]
    controller, bench = chosen_controller(folder, designed), bench_of(designed)
    model = load_model(context.artifacts / "identify", study.rig, study.effects)
    tables = context.config.scenarios
    answer: dict[str, Any] = {}
    if scenarios := scenarios_of(context, study.recordings, controller):
        pair = {"compensated": controller, "pid_alone": load_controller(folder, "pid")}
        found = trial(model, pair, scenarios, bench)
        write_runs(
            context.out / "closed_loop.parquet",
            {(kind, name): one for kind, by in found.items() for name, (one, _) in by.items()},
            study.provenance("identify/model.parquet", "design/gains.parquet"),
            "pneucli/simulate/closed_loop/1",
        )
        told = {kind: {name: figures(m) for name, (_, m) in by.items()} for kind, by in found.items()}
        answer["closed_loop"], answer["pid_alone"] = told["compensated"], told["pid_alone"]
        answer["tolerance_um"] = TOLERATED * 1e6 * controller.values["C_REACH"]
    studies = [t for t in tables if t.get("kind") == "monte-carlo"] or ([] if tables else [{}])
    for table in studies:
        answer["robust"] = _robust(study, model, controller, bench, table)
    return answer


def _robust(
    study: Study, model: Model, controller: Controller, bench: Bench, table: Mapping[str, Any]
) -> dict[str, Any]:
    """Run a Monte Carlo study, write its rows and rates, and return its part of the answer."""
    context = study.context
    wanted = robustness.settings_from(table, f"{context.path}, key scenarios")
    parameters = read_table(context.artifacts / "identify" / "parameters.parquet")
    names = (parameters[n] for n in ("name", "ci_low", "ci_high"))
    intervals = {str(n): (float(low), float(high)) for n, low, high in zip(*names, strict=True)}
    active = {e.name for e in model.effects}
    effects = tuple(
        e
        for e in study.known_effects.values()
        if e.name not in active and e.part in KINDS["axis"].parts(cylinder_known=True, supply_recorded=False)
    )
    axes = robustness.Axes(model, robustness.sigma_of(intervals, model), wanted.tolerances, effects)
    scenarios: tuple[Scenario, ...] = tuple(s for s in scenarios_from([], controller, "") if s.name in STUDIED)
    asked = robustness.Study(axes, controller, scenarios, bench, wanted.runs, wanted.seed, wanted.checks)
    brief = asked.runs < BRIEF
    with engine_from(context.options.get("executor"), identity, brief=brief) as engine:
        rows = robustness.run_study(asked, engine, context.artifacts / ".robust", context.progress)
    rates = robustness.success_rates(rows, wanted.checks)
    _write_robust(study, rows, rates)
    return {
        "runs": asked.runs,
        "seed": asked.seed,
        "checks": {
            r.check: {
                "limit": r.limit,
                "held": r.held,
                "runs": r.runs,
                "share": r.held / r.runs,
                "worst": r.worst if math.isfinite(r.worst) else None,
                "worst_run": r.worst_run,
            }
            for r in rates
            if r.effect == "all"
        },
        "by_effect": [asdict(r) | {"worst": r.worst if math.isfinite(r.worst) else None} for r in rates],
    }


def _write_robust(study: Study, rows: Sequence[Mapping[str, Any]], rates: Sequence[robustness.Rate]) -> None:
    figures = [n for n, v in rows[0].items() if isinstance(v, float)]
    provenance = study.provenance("identify/model.parquet", "design/gains.parquet")
    write_table(
        study.context.out / "robust.parquet",
        {
            "run": np.array([r["run"] for r in rows]),
            "scenario": [r["scenario"] for r in rows],
            "effect": [r["effect"] for r in rows],
            "sizes": [", ".join(f"{n} = {v:.4g}" for n, v in r["sizes"].items()) for r in rows],
            **{n: np.array([r[n] for r in rows], dtype=np.float64) for n in figures},
        },
        units={"run": "1"} | {n: unit_of(n) for n in figures},
        schema="pneucli/simulate/robust/1",
        provenance=provenance,
    )
    plain = [asdict(r) for r in rates]
    numbers = ("limit", "held", "runs", "worst", "worst_run")
    write_table(
        study.context.out / "robust_rates.parquet",
        {
            "check": [r["check"] for r in plain],
            "effect": [r["effect"] for r in plain],
            **{n: np.array([r[n] for r in plain], dtype=np.float64) for n in numbers},
        },
        units=dict.fromkeys(("held", "runs", "worst_run"), "1") | dict.fromkeys(("limit", "worst"), "the figure's"),
        schema="pneucli/simulate/robust_rates/1",
        provenance=provenance,
    )
