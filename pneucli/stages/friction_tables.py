"""The friction identification as artifacts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pneucli.figure import INTERVAL_UNITS, named
from pneucli.identify.friction.identification import FrictionIdentification
from pneucli.identify.friction.stick_slip import StickSlip
from pneucli.io.artifacts import Tables
from pneucli.messages.identify import Friction, KineticLevel, Repeats

MODEL_POINTS = 401
DEVIATION_KEYS = "model recording use channel rmsd noise unit percent"


def friction_answer(friction: FrictionIdentification) -> Friction:
    """Return what the answer holds of friction."""
    domain = friction.domain
    return Friction(
        warnings=[one.text for one in friction.warnings],
        taken_out=friction.removed_effects,
        domain={
            "velocity_range": {"value": domain.max_velocity, "unit": "m/s"},
            "nodes": domain.nodes,
            "eta": {"value": domain.eta, "unit": "s/m"},
        },
        models=[{"model": m.name, "lacks": friction.unmodelled_effects[m.name]} for m in friction.models],
        kinetic=[KineticLevel(k.recording, k.pressures, k.speed, k.friction) for k in friction.kinetic],
        breakaway=friction.break_aways,
        over_pressure=friction.pressure_dependence,
        repeats=[Repeats(r.recordings, r.friction, "N", r.spread) for r in friction.repeatability],
        deviations=[named(d, DEVIATION_KEYS) for d in friction.deviations],
    )


def write_friction(friction: FrictionIdentification, tables: Tables) -> None:
    """Write models A to F, curves, stick-slips, tables 6.2 and 6.3, kinetic friction, TP weights and vertices."""
    grid = np.linspace(-friction.domain.max_velocity, friction.domain.max_velocity, MODEL_POINTS)
    models = [
        {"model": m.name, "branch": b.branch, "v": v, "force": f}
        for m in friction.models
        for b in m.branches
        for v, f in zip(grid, b.force(grid), strict=True)
    ]
    tables.write_rows("friction_models", models, {"v": "m/s", "force": "N"})
    slip = [
        {"model": r.model, "time": time, "v": v, "v_model": vm, "a": a, "a_model": am}
        for r in friction.replays
        for time, v, vm, a, am in zip(r.time, r.v, r.v_model, r.a, r.a_model, strict=True)
    ]
    units = {"v_model": "m/s", "a_model": "m/s^2"}
    tables.write_rows("friction_replays", slip, units)
    curves = [
        {"branch": c.branch, "v": v, "force": f, "ci_low": low, "ci_high": high, "count": float(n)}
        for c in friction.curves
        for v, f, low, high, n in zip(c.v, c.force, c.ci_low, c.ci_high, c.count, strict=True)
    ]
    force = {"force": "N", "ci_low": "N", "ci_high": "N"}
    tables.write_rows("friction_curves", curves, {"v": "m/s", "count": "1", **force})
    _write_cuts(friction.stick_slips, tables)
    _write_averages(friction, tables)
    _write_tables(friction, tables)
    _write_tp(friction, tables)


def _write_cuts(cuts: Sequence[StickSlip], tables: Tables) -> None:
    sizes = [c.time.size for c in cuts]
    if not sum(sizes):
        return
    columns: dict[str, Any] = {
        "recording": [c.recording for c in cuts for _ in range(c.time.size)],
        "cut": np.repeat(np.arange(len(cuts), dtype=np.float64), sizes),
        "direction": np.repeat([float(c.direction) for c in cuts], sizes),
        "time": np.concatenate([c.time for c in cuts]),
        "speed": np.concatenate([c.speed for c in cuts]),
        "force": np.concatenate([c.friction for c in cuts]),
    }
    units = {"cut": "1", "direction": "1", "time": "s", "speed": "m/s", "force": "N"}
    tables.write("friction_cuts", columns, units)


def _write_averages(friction: FrictionIdentification, tables: Tables) -> None:
    rows = [
        {"branch": a.branch, "direction": float(a.direction), "speed": s, "force": f, "error": e, "count": float(n)}
        for a in friction.averages
        for s, f, e, n in zip(a.speed, a.friction, a.error, a.count, strict=True)
    ]
    units = {"direction": "1", "speed": "m/s", "force": "N", "error": "N", "count": "1"}
    tables.write_rows("friction_averages", rows, units)


def _write_tables(friction: FrictionIdentification, tables: Tables) -> None:
    columns = "model recording use channel rmsd unit percent relative_percent noise"
    rows = [named(d, columns) | {"lacks": ", ".join(friction.unmodelled_effects[d.model])} for d in friction.deviations]
    units = {"rmsd": "see column unit", "noise": "see column unit", "percent": "%", "relative_percent": "%"}
    tables.write_rows("friction_deviations", rows, units)
    parameters = [
        {"model": m.name, "branch": b.branch, "name": name} | v.columns
        for m in friction.models
        for b in m.branches
        for name, v in b.parameters.items()
    ]
    tables.write_rows("friction_parameters", parameters, INTERVAL_UNITS)
    kinetic = [
        {"recording": k.recording, "p1": k.pressures.get("p1", np.nan), "speed": k.speed, "friction": k.friction.value}
        | {"ci_low": k.friction.low, "ci_high": k.friction.high, "offset": k.offset.value}
        for k in friction.kinetic
    ]
    units = {"p1": "Pa", "speed": "m/s", "friction": "N", "offset": "N", "ci_low": "N", "ci_high": "N"}
    tables.write_rows("friction_kinetic", kinetic, units)


def _write_tp(friction: FrictionIdentification, tables: Tables) -> None:
    weights: list[dict[str, Any]] = []
    vertices: list[dict[str, Any]] = []
    for m in friction.models:
        for b in m.branches:
            if b.tp is None:
                continue
            for j, column in enumerate(b.tp.weights[0].T):
                weights += [
                    {"model": m.name, "branch": b.branch, "vertex": float(j), "v": v, "weight": w}
                    for v, w in zip(b.tp.grids[0], column, strict=True)
                ]
            vertices += [
                {"model": m.name, "branch": b.branch, "vertex": float(j), "a22": float(a)}
                for j, a in enumerate(np.ravel(b.tp.vertices))
            ]
    tables.write_rows("tp_weights", weights, {"vertex": "1", "v": "m/s", "weight": "1"})
    tables.write_rows("tp_vertices", vertices, {"vertex": "1", "a22": "1/s"})
