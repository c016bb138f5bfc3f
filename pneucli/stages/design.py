"""``design``: the identified model -> matching, surfaces, sliding sector, PDC, and the cascade controller."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.closed_loop.law_comparison import controllers, plan_of, surfaces
from pneucli.closed_loop.simulation import Bench
from pneucli.controller import layout
from pneucli.controller.laws import LAWS, laws_named
from pneucli.controller.parameters import Controller
from pneucli.design.bandwidths import Corners, corners_of
from pneucli.design.cascade_design import design_cascade
from pneucli.design.effect_compensation import pulls_back
from pneucli.design.lpv import Study as WeightStudy
from pneucli.design.lpv import compare_weight_types
from pneucli.design.requirements import Requirements, requirements_from
from pneucli.design.sliding import axis_systems, unmatched
from pneucli.design.sliding_sector import Sector, resolved, sector_from_vertices
from pneucli.errors import InputError
from pneucli.io.artifacts import Provenance, atomic_path, read_table, write_table
from pneucli.pipeline.context import Context, NotApplicable
from pneucli.recording import Recording
from pneucli.simulate.model import Model
from pneucli.stages.acceptance import gate_answer
from pneucli.stages.law_comparison import Compared, compared, compared_answer, scenarios_of, write_compared
from pneucli.stages.margins import margins_answer
from pneucli.stages.pipeline_data import Study, load_model

CONTROLLERS = "controllers"  # a file a law


@dataclass(frozen=True)
class Designed:
    """All that the stage found."""

    controllers: dict[str, Controller]
    failed: dict[str, str]
    requirements: Requirements
    corners: Corners
    sectors: dict[str, Sector]
    surfaces: list[dict[str, Any]]
    matching: dict[str, dict[str, list[str]]]
    weights: list[WeightStudy]
    warnings: list[str]

    @property
    def chosen(self) -> Controller:
        """The controller that is simulated and exported."""
        return self.controllers[self.requirements.controller]


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
    names = [law.name for law in laws_named(context.options.get("compare") or LAWS, "--compare")]
    _require(designed, [wanted.controller, *context.options.get("compare", [])], context)
    context.progress("the same scenarios under each law", 0.7)
    chosen = {name: designed.controllers[name] for name in names if name in designed.controllers}
    scenarios = scenarios_of(context, study.recordings, designed.chosen)
    found = compared(model, chosen, scenarios, _bench(wanted))
    _write(study, designed)
    write_compared(found, context.out, study.provenance("identify/model.parquet"))
    about = (context, model, designed.chosen)
    margins = margins_answer(
        *about, _bench(wanted), designed.corners.position, study.provenance("identify/model.parquet")
    )
    held = gate_answer(*about, wanted, _bench(wanted))
    return _answer(study, designed, found) | {"margins": margins, "gate": held}


def _require(designed: Designed, names: Sequence[str], context: Context) -> None:
    """Raise InputError where a law that was asked for cannot be made."""
    for name in names:
        if name in designed.failed:
            raise InputError(f"{context.path}, controller {name}", designed.failed[name], "a law that can be made here")


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
    unpredicted = corners_of(model, wanted, c, predicted=False)
    rows = surfaces(systems["mechanical"], unpredicted, wanted)
    context.progress("linear matrix inequalities", 0.4)
    floor = sectors["resolved"].speed_floor if "resolved" in sectors else c["C_V_FLOOR"]
    weights: list[WeightStudy] = []
    missing = {"vertices": "there is none", "scheduled": "no weight type gives gains that are verified"}
    try:
        weights = compare_weight_types(c, floor)
    except InputError as error:
        missing["scheduled"] = error.found
        warnings.append(f"no PDC: {error.found}")
    vertices = _vertices(context.artifacts / "identify")
    made, failed = controllers(plan_of(controller, unpredicted, wanted, rows, vertices, weights, missing))
    return Designed(made, failed, wanted, corners, sectors, rows, matching, weights, warnings)


def _vertices(folder: Path) -> list[float]:
    """Return a22 in 1/s at the vertices of the direct TP friction model (C), where there is one."""
    try:
        table = read_table(folder / "tp_vertices.parquet")
    except InputError:
        return []
    return [float(a) for a, m in zip(table["a22"], table["model"], strict=True) if m == "C"]


def _sectors(folder: Path, controller: Controller, wanted: Requirements) -> tuple[dict[str, Sector], list[str]]:
    """Return the sector of the TP friction model as identified, and as far as the controller can resolve it."""
    if not (vertices := _vertices(folder)):
        return {}, ["no sliding sector from vertices: there is no direct TP friction model"]
    c = controller.values
    try:
        sector = sector_from_vertices(vertices, c["C_MASS"], wanted.period, c["C_STATIC"], wanted.sector_ratio)
    except InputError as error:
        return {}, [f"no sliding sector: {error.found}"]
    found = {"vertices": sector, "resolved": resolved(sector, c["C_STATIC"], c["C_SECTOR_2"])}
    return found, []  # where it is too steep the resolved one is taken, and the table of sectors says so


def _write(study: Study, designed: Designed) -> None:
    out, provenance = study.context.out, study.provenance("identify/model.parquet")
    for name, controller in designed.controllers.items():
        with atomic_path(out / CONTROLLERS / f"{name}.json") as path:
            path.write_text(controller.to_json(), encoding="utf-8")
    values = designed.chosen.values
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


def load_controller(folder: Path, name: str) -> Controller:
    """Return the controller of that name; raises InputError where the stage could not make it."""
    if not (path := folder / CONTROLLERS / f"{name}.json").is_file():
        made = ", ".join(sorted(one.stem for one in path.parent.iterdir()))
        raise InputError(f"controller {name}", "it could not be designed for this axis", f"one of {made}")
    return Controller.from_json(path.read_text(encoding="utf-8"))


def chosen_controller(folder: Path, answer: Mapping[str, Any]) -> Controller:
    """Return the controller that ``[design] controller`` names."""
    return load_controller(folder, answer["requirements"]["controller"])


def bench_of(answer: Mapping[str, Any]) -> Bench:
    """Return the sensors and the delay that the design reckoned with."""
    return _bench(Requirements(**answer["requirements"]))


def _bench(wanted: Requirements) -> Bench:
    return Bench(wanted.noise_x, wanted.noise_p, wanted.quantum_x, 0.0, round(wanted.delay / wanted.period))


def _answer(study: Study, designed: Designed, found: Compared) -> dict[str, Any]:
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
    best = max(feasible, key=lambda w: w.pdc.rate if w.pdc else 0.0, default=None)
    loops = best.pdc.loops if best is not None and best.pdc is not None else np.zeros((0, 0))
    return {
        "schema": "pneucli/design/1",
        "pipeline": study.context.config.name,
        "requirements": asdict(designed.requirements),
        "corners": {n: {"value": v, "unit": "1/s"} for n, v in asdict(designed.corners).items()},
        "sector": {n: asdict(s) | {"steepness": s.steepness, "remark": s.warning} for n, s in designed.sectors.items()},
        "matching": {n: {"holds": not broken, "broken_by": broken} for n, broken in designed.matching.items()},
        "surface": designed.surfaces,
        "lmi": {
            "best": best.weight_type if best is not None else None,
            "types": lmi,
            "vertex_loops": [[[pole.real, pole.imag] for pole in loop] for loop in loops.tolist()],
        },
        "controllers": {name: LAWS[name].title for name in designed.controllers},
        "not_made": designed.failed,
        "tolerance_um": 2e6 * designed.chosen.values["C_REACH"],
        **compared_answer(found),
        "warnings": designed.warnings,
    }
