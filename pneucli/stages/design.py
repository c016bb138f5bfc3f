"""``design``: the identified model -> matching, surfaces, sliding sector, PDC, and the cascade controller."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.design import layout
from pneucli.design.cascade import Corners, corners_of, design_cascade
from pneucli.design.closed_loop import Bench
from pneucli.design.controller import Controller
from pneucli.design.lpv import Study as WeightStudy
from pneucli.design.lpv import compare_weight_types
from pneucli.design.ports import pulls_back
from pneucli.design.requirements import Requirements, requirements_from
from pneucli.design.sector import Sector, resolved, sector_from_vertices
from pneucli.design.surface import axis_systems, surface_by_lq, surface_by_poles, unmatched
from pneucli.errors import InputError
from pneucli.io.artifacts import Provenance, atomic_path, read_table, write_table
from pneucli.pipeline.context import Context, NotApplicable
from pneucli.recording import Recording
from pneucli.simulate.model import Model
from pneucli.stages.study import Study, load_model

CONTROLLER = "controller.json"


@dataclass(frozen=True)
class Designed:
    """All that the stage found."""

    controller: Controller
    requirements: Requirements
    corners: Corners
    sectors: dict[str, Sector]
    surfaces: list[dict[str, Any]]
    matching: dict[str, dict[str, list[str]]]
    weights: list[WeightStudy]
    warnings: list[str]


def run(context: Context) -> dict[str, Any]:
    """Design a controller for the identified axis; return the answer that ``--json`` prints.

    Raises NotApplicable where there is no axis to control.
    """
    study = Study(context)
    axes = [r for r in study.recordings if r.kind.axis]
    if not study.rig.has_cylinder or not axes:
        raise NotApplicable(f"{context.path}", "no axis to control", "a cylinder and a recording of it with its valve")
    model = load_model(context.artifacts / "identify", study.rig, study.effects)
    wanted = requirements_from(context.config.design, f"{context.path}, key design", **_known(axes, model, context))
    designed = _design(context, model, wanted, sealed_pressure(axes, model))
    _write(study, designed)
    return _answer(study, designed)


def _known(axes: Sequence[Recording], model: Model, context: Context) -> dict[str, Any]:
    """Return what the recordings tell of the sensors, and how chamber 2 is driven."""
    kinds = {r.chamber_2 for r in axes}
    is_open = kinds == {"open"}
    if is_open and "chamber_2" not in context.config.design and not pulls_back(model):
        raise NotApplicable(
            f"{context.path}",
            "chamber 2 is open: nothing pulls the piston back",
            "a closed one, a valve, or a spring or weight among the effects",
        )
    x = [r.noise["x"] for r in axes if "x" in r.noise]
    p = [r.noise["p1"].rms for r in axes if "p1" in r.noise]
    quantum = max((n.step for n in x), default=0.0)
    noise = max((n.rms for n in x), default=0.0)
    return {
        "chamber_2": "valve" if "valve" in kinds else "open" if is_open else "closed",
        "quantum_x": quantum,
        "noise_x": noise if noise > quantum else 0.0,  # below it the estimate is the rounding itself
        "noise_p": max(p, default=0.0),
    }


def sealed_pressure(axes: Sequence[Recording], model: Model) -> float | None:
    """Return the pressure in Pa that a closed chamber 2 has with the piston in the middle (median, isentropic)."""
    base = model.base()
    dead, area, stroke = base["rig.dead_volume_2"], base["rig.piston_area_2"], base["rig.stroke"]
    found = []
    for r in axes:
        if "p2" in r and "x" in r and r.chamber_2 == "closed":
            share = (dead + area * (stroke - r["x"])) / (dead + 0.5 * area * stroke)
            found.append(r["p2"] * share ** base["rig.heat_capacity_ratio"])
    return float(np.nanmedian(np.concatenate(found))) if found else None


def _design(context: Context, model: Model, wanted: Requirements, sealed: float | None) -> Designed:
    context.progress("controller", 0.1)
    controller = design_cascade(model, wanted, sealed)
    c = controller.values
    corners = corners_of(model, wanted, c)
    sectors, warnings = _sectors(context.artifacts / "identify", controller, wanted)
    systems = axis_systems(c, 0.5 * c["C_STROKE"], c["C_P_MEAN"], c["C_P_MEAN"])
    matching = {name: unmatched(system) for name, system in systems.items()}
    mechanical = systems["mechanical"]
    surfaces = [
        ("mechanical", "pole placement", surface_by_poles(mechanical.A, mechanical.B, [-corners.position])),
        ("mechanical", "LQ", surface_by_lq(mechanical.A, mechanical.B, np.diag([corners.position**2, 1.0]))),
    ]
    rows = [{"system": s, "method": m, "surface": f.S[0], "pole": float(f.poles[0].real)} for s, m, f in surfaces]
    context.progress("linear matrix inequalities", 0.4)
    floor = sectors["resolved"].speed_floor if "resolved" in sectors else c["C_V_FLOOR"]
    weights: list[WeightStudy] = []
    try:
        weights = compare_weight_types(c, floor)
    except InputError as error:
        warnings.append(f"no PDC: {error.found}")
    return Designed(controller, wanted, corners, sectors, rows, matching, weights, warnings)


def _sectors(folder: Path, controller: Controller, wanted: Requirements) -> tuple[dict[str, Sector], list[str]]:
    """Return the sector of the TP friction model as identified, and as far as the controller can resolve it."""
    try:
        table = read_table(folder / "tp_vertices.parquet")
    except InputError:
        return {}, ["no sliding sector from vertices: there is no TP friction model"]
    c = controller.values
    chosen = [float(a) for a, m in zip(table["a22"], table["model"], strict=True) if m == "B"]
    try:
        sector = sector_from_vertices(
            chosen or table["a22"], c["C_MASS"], wanted.period, c["C_STATIC"], wanted.sector_ratio
        )
    except InputError as error:
        return {}, [f"no sliding sector: {error.found}"]
    found = {"vertices": sector, "resolved": resolved(sector, c["C_STATIC"], c["C_SECTOR_2"])}
    return found, []  # where it is too steep the resolved one is taken, and the table of sectors says so


def _write(study: Study, designed: Designed) -> None:
    out, provenance = study.context.out, study.provenance("identify/model.parquet")
    with atomic_path(out / CONTROLLER) as path:
        path.write_text(designed.controller.to_json(), encoding="utf-8")
    values = designed.controller.values
    write_table(
        out / "gains.parquet",
        {
            "name": list(values),
            "value": np.array(list(values.values())),
            "unit": [layout.UNITS.get(n, "1") for n in values],
        },
        units={"value": "see column unit"},
        schema="pneucli/design/gains/1",
        provenance=provenance,
    )
    _write_sectors(out, designed, provenance)
    if designed.weights:
        _write_lmi(out, designed.weights, provenance)


def _write_sectors(out: Path, designed: Designed, provenance: Provenance) -> None:
    units = {"a_1": "1/s", "a_2": "1/s", "lambda_1": "1/s", "lambda_2": "1/s", "speed_floor": "m/s"}
    rows = designed.sectors
    write_table(
        out / "sector.parquet",
        {"name": list(rows)}
        | {
            n: np.array([getattr(s, n) for s in rows.values()], dtype=np.float64)
            for n in [*units, "middle", "steepness"]
        }
        | {"warning": [s.warning for s in rows.values()]},
        units=units | {"middle": "1/s", "steepness": "1"},
        schema="pneucli/design/sector/1",
        provenance=provenance,
    )


def _write_lmi(out: Path, weights: Sequence[WeightStudy], provenance: Provenance) -> None:
    numbers = ("rate", "worst_pole", "worst_lmi")
    write_table(
        out / "lmi.parquet",
        {
            "weight_type": [str(w.weight_type) for w in weights],
            "vertices": np.array([w.vertices for w in weights]),
            **{n: np.array([getattr(w.pdc, n) if w.pdc else np.nan for w in weights]) for n in numbers},
            "status": [w.pdc.status if w.pdc else w.failure for w in weights],
            "verified": np.array([bool(w.pdc and w.pdc.verified) for w in weights]),
            "peak": np.array([w.peak for w in weights]),
            "decayed": np.array([w.decayed for w in weights]),
        },
        units={"vertices": "1", "rate": "1/s", "worst_pole": "1/s"}
        | dict.fromkeys(("worst_lmi", "peak", "decayed", "verified"), "1"),
        schema="pneucli/design/lmi/1",
        provenance=provenance,
    )


def load_controller(folder: Path) -> Controller:
    """Return the controller that the stage wrote."""
    return Controller.from_json((folder / CONTROLLER).read_text(encoding="utf-8"))


def bench_of(answer: dict[str, Any]) -> Bench:
    """Return the sensors and the delay that the design reckoned with."""
    wanted = answer["requirements"]
    delay = round(wanted["delay"] / wanted["period"])
    return Bench(wanted["noise_x"], wanted["noise_p"], wanted["quantum_x"], 0.0, delay)


def _answer(study: Study, designed: Designed) -> dict[str, Any]:
    lmi = [
        {
            "weight_type": w.weight_type,
            "rate": w.pdc.rate if w.pdc else None,
            "unit": "1/s",
            "status": w.pdc.status if w.pdc else w.failure,
            "verified": bool(w.pdc and w.pdc.verified),
        }
        for w in designed.weights
    ]
    feasible = [w for w in designed.weights if w.pdc]
    best = max(feasible, key=lambda w: w.pdc.rate if w.pdc else 0.0).weight_type if feasible else None
    return {
        "schema": "pneucli/design/1",
        "pipeline": study.context.config.name,
        "requirements": asdict(designed.requirements),
        "corners": {n: {"value": v, "unit": "1/s"} for n, v in asdict(designed.corners).items()},
        "sector": {n: asdict(s) | {"steepness": s.steepness, "remark": s.warning} for n, s in designed.sectors.items()},
        "matching": {n: {"holds": not broken, "broken_by": broken} for n, broken in designed.matching.items()},
        "surface": [{**row, "surface": list(map(float, row["surface"]))} for row in designed.surfaces],
        "lmi": {"best": best, "types": lmi},
        "warnings": designed.warnings,
    }
