"""The closed-loop part of ``simulate``: the designed controller in its scenarios, with and without compensation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from pneucli.design import layout, robust
from pneucli.design.closed_loop import Bench, Run, Scenario, run
from pneucli.design.controller import Controller
from pneucli.design.metrics import measure
from pneucli.design.scenarios import scenarios_from
from pneucli.executors import executor_from
from pneucli.experiments import KINDS
from pneucli.io.artifacts import read_table, write_table
from pneucli.simulate import layout as at
from pneucli.simulate.model import Model
from pneucli.stages.design import bench_of, load_controller
from pneucli.stages.study import Study, load_model

TOLERATED = 2.0  # times the reach within which the piston is left alone: the error at rest that is good enough
STUDIED = ("steps", "sine", "load")  # scenarios of the Monte Carlo study
SIGNALS = {  # columns of closed_loop.parquet: where they stand in the model's output or the controller's log, and units
    "x": (at.X, "m"),
    "v": (at.V, "m/s"),
    "p1": (at.P1, "Pa"),
    "p2": (at.P2, "Pa"),
}
LOGGED = {
    "u": (layout.L_U1, "V"),
    "u2": (layout.L_U2, "V"),
    "p1_ref": (layout.L_P1_REF, "Pa"),
    "x_shaped": (layout.L_SHAPED, "m"),
    "load_estimate": (layout.L_LOAD, "N"),
    "flow_estimate": (layout.L_FLOW1, "Pa/s"),
}


def simulate_closed_loop(study: Study) -> dict[str, Any]:
    """Run the closed-loop scenarios of the pipeline file, or the default ones; write their files, return their part
    of the answer. Nothing where no controller was designed.
    """
    context = study.context
    if "design" not in context.answers:
        return {}
    controller, bench = load_controller(context.artifacts / "design"), bench_of(context.answers["design"])
    model = load_model(context.artifacts / "identify", study.rig, study.effects)
    tables = context.config.scenarios
    own = [_without_kind(t) for t in tables if t.get("kind") == "closed-loop"]
    where = f"{context.path}, key scenarios"
    answer: dict[str, Any] = {}
    if own or not tables:
        scenarios = scenarios_from(own, controller, where, _recorded(study))
        runs = {
            kind: [run(model, c, s, bench) for s in scenarios]
            for kind, c in (("compensated", controller), ("pid_alone", controller.with_values(C_COMPENSATION=0.0)))
        }
        _write_runs(study, runs)
        answer["closed_loop"] = {r.scenario.name: _figures(r, model, controller) for r in runs["compensated"]}
        answer["tolerance_um"] = TOLERATED * 1e6 * controller.values["C_REACH"]
        answer["pid_alone"] = {r.scenario.name: _figures(r, model, controller) for r in runs["pid_alone"]}
    studies = [t for t in tables if t.get("kind") == "monte-carlo"] or ([] if tables else [{}])
    for table in studies:
        answer["robust"] = _robust(study, model, controller, bench, table)
    return answer


def _without_kind(table: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in table.items() if key != "kind"}


def _recorded(study: Study) -> dict[str, tuple[Any, Any]]:
    """Return what a recording asked for or did, as a reference: x_ref, else x."""
    return {
        r.name: (r.time, np.nan_to_num(r["x_ref"] if "x_ref" in r else r["x"], nan=0.0))
        for r in study.recordings
        if "x_ref" in r or "x" in r
    }


def _figures(one: Run, model: Model, controller: Controller) -> dict[str, float | None]:
    """Return the figures of a run; null where the scenario does not show one, or it is without bound."""
    return {n: v if math.isfinite(v) else None for n, v in asdict(measure(one, model, controller)).items()}


def _write_runs(study: Study, runs: Mapping[str, Sequence[Run]]) -> None:
    columns: dict[str, list[Any]] = {"scenario": [], "controller": []}
    numbers: dict[str, list[Any]] = {}
    for kind, results in runs.items():
        for one in results:
            s, n = one.scenario, one.time.size
            columns["scenario"] += [s.name] * n
            columns["controller"] += [kind] * n
            parts = {"time": one.time, "x_ref": s.reference, "load": s.force, "p_supply": s.supply}
            parts |= {name: one.model[:, place] for name, (place, _) in SIGNALS.items()}
            parts |= {name: one.log[:, place] for name, (place, _) in LOGGED.items()}
            for name, part in parts.items():
                numbers.setdefault(name, []).append(part)
    write_table(
        study.context.out / "closed_loop.parquet",
        {**columns, **{name: np.concatenate(parts) for name, parts in numbers.items()}},
        units={n: u for n, (_, u) in (SIGNALS | LOGGED).items()} | {"load": "N"},
        schema="pneucli/simulate/closed_loop/1",
        provenance=study.provenance("identify/model.parquet", "design/gains.parquet"),
    )


def _robust(
    study: Study, model: Model, controller: Controller, bench: Bench, table: Mapping[str, Any]
) -> dict[str, Any]:
    """Run a Monte Carlo study, write its rows and rates, and return its part of the answer."""
    context = study.context
    wanted = robust.settings_from(table, f"{context.path}, key scenarios")
    parameters = read_table(context.artifacts / "identify" / "parameters.parquet")
    names = (parameters[n] for n in ("name", "ci_low", "ci_high"))
    intervals = {str(n): (float(low), float(high)) for n, low, high in zip(*names, strict=True)}
    active = {e.name for e in model.effects}
    effects = tuple(
        e
        for e in study.known_effects.values()
        if e.name not in active and e.part in KINDS["axis"].parts(cylinder_known=True, supply_recorded=False)
    )
    axes = robust.Axes(model, robust.sigma_of(intervals, model), wanted.tolerances, effects)
    scenarios: tuple[Scenario, ...] = tuple(s for s in scenarios_from([], controller, "") if s.name in STUDIED)
    asked = robust.Study(axes, controller, scenarios, bench, wanted.runs, wanted.seed, wanted.checks)
    with executor_from(context.options.get("executor")) as executor:
        rows = robust.run_study(asked, executor, context.artifacts / ".robust", context.progress)
    rates = robust.success_rates(rows, wanted.checks)
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


def _write_robust(study: Study, rows: Sequence[Mapping[str, Any]], rates: Sequence[robust.Rate]) -> None:
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
        units={"run": "1"} | {n: _unit(n) for n in figures},
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


def _unit(figure: str) -> str:
    """Return the unit that a figure's name ends in."""
    return {"um": "um", "s": "s", "hz": "Hz", "v": "V", "kg": "kg"}.get(figure.rsplit("_", 1)[-1], "1")
