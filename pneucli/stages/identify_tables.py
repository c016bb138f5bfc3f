"""What ``identify`` writes and answers: parameters, relations between them, budgets, the valve, friction."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.figure import INTERVAL_UNITS, Figure, named
from pneucli.identify.estimation.correlation import parameter_correlation, sensitivities
from pneucli.identify.estimation.fit import Estimate, Fit
from pneucli.identify.estimation.progress import Iteration
from pneucli.identify.friction.identification import FrictionIdentification
from pneucli.identify.friction.stick_slip import StickSlip
from pneucli.identify.residuals import ResidualModel
from pneucli.identify.valve.lack_of_fit import LackOfFit
from pneucli.identify.valve.result import ValveIdentification, known_vessel_volume
from pneucli.identify.valve.uncertainty import COVERAGE_FACTOR, Budget
from pneucli.io.artifacts import Tables
from pneucli.messages.findings import Finding
from pneucli.messages.identify import (
    BudgetAnswer,
    Friction,
    KineticLevel,
    MapResidual,
    Repeats,
    Source,
    Uncertainty,
    Valve,
    ValveDeviation,
)
from pneucli.quantities import Z95
from pneucli.stages.table_rows import write_blocks, write_table_rows

Columns = dict[str, NDArray[Any]]
INTERVAL_COLUMNS = ("ci_low", "ci_high")
GRADIENT_COLUMNS = ("gradient", *INTERVAL_COLUMNS)
LACK_OF_FIT_COLUMNS = (
    "difference",
    *(f"{name}{end}" for name in ("model", "measured") for end in ("", "_ci_low", "_ci_high")),
)
MAX_TRAIN_RESIDUAL = 3.0  # times the noise: the limit of a good map on its own curves
MAX_TEST_TO_TRAIN = 2.0  # times the residual on fitted curves
MODEL_POINTS = 401
DEVIATION_KEYS = "model recording use channel rmsd noise unit percent"
SOURCE_KEYS = "uncertainty unit sensitivity contribution bound factors"


def write_parameters(found: Mapping[str, Figure], tables: Tables) -> None:
    """Write ``parameters``, a row for each parameter or characteristic."""
    rows = [(name, one.value, one.unit, one.low, one.high) for name, one in found.items()]
    write_table_rows(tables, "parameters", "name value unit ci_low ci_high", rows, INTERVAL_UNITS)


def write_parameter_relations(
    found: Fit, views: Sequence[ResidualModel], rounds: Sequence[Iteration], tables: Tables
) -> None:
    """Write ``correlation`` (a row a pair), ``sensitivity`` (a row a parameter and channel) and ``iterations``."""
    names = [e.name for e in found.estimates]
    pairs = [(one, other) for one in names for other in names]
    related = [(*pair, r) for pair, r in zip(pairs, parameter_correlation(found).ravel(), strict=True)]
    write_table_rows(tables, "correlation", "name other correlation", related, {"correlation": "1"})
    felt = [(s.name, s.channel, s.times_noise) for s in sensitivities(found, views)]
    write_table_rows(tables, "sensitivity", "name channel times_noise", felt, {"times_noise": "1"})
    walked = [(", ".join(r.effects), r.search, r.round, r.residual) for r in rounds]
    units = dict.fromkeys(("search", "round", "residual"), "1")
    write_table_rows(tables, "iterations", "effects search round residual", walked, units)


def write_budgets(budgets: Sequence[Budget], tables: Tables) -> None:
    """Write ``uncertainty_budget``: a row for each source of each result."""
    rows = [(budget, one) for budget in budgets for one in budget.contributions]
    if not rows:
        return
    tables.write_rows(
        "uncertainty_budget",
        [
            {"name": budget.name, "unit": budget.figure.unit}
            | named(one, "source")
            | {"type": one.kind, "uncertainty_unit": one.unit, "bound": one.bound}
            | named(one, "uncertainty sensitivity contribution")
            | {"share": budget.share(one)}
            | {"value": budget.figure.value}
            | named(budget, "combined expanded")
            | {"ci_low": budget.figure.low, "ci_high": budget.figure.high}
            for budget, one in rows
        ],
        {
            **INTERVAL_UNITS,
            **dict.fromkeys(("contribution", "combined", "expanded"), "see column unit"),
            **{"uncertainty": "see column uncertainty_unit", "sensitivity": "unit / uncertainty_unit"},
            **{"share": "1", "bound": "1"},
        },
    )


def budgets_answer(budgets: Sequence[Budget]) -> Uncertainty:
    """Return what ``identify`` says of the uncertainty, by the name of the result."""
    return Uncertainty(COVERAGE_FACTOR, {one.name: _budget(one) for one in budgets})


def _budget(budget: Budget) -> BudgetAnswer:
    return BudgetAnswer(
        **named(budget, "figure combined expanded propagated"),
        calibration_not_stated=budget.not_stated,
        sources=[
            Source(one.source, one.kind, share=budget.share(one), **named(one, SOURCE_KEYS))
            for one in budget.contributions
        ],
    )


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
    blocks = [
        (c.recording, float(i), float(c.direction), c.time, c.speed, c.friction)
        for i, c in enumerate(cuts)
        if c.time.size
    ]
    units = {"cut": "1", "direction": "1", "time": "s", "speed": "m/s", "force": "N"}
    if blocks:
        write_blocks(tables, "friction_cuts", "recording cut direction time speed force", blocks, units)


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


def write_valves(valves: Sequence[ValveIdentification], estimates: Sequence[Estimate], tables: Tables) -> None:
    """Write map, inverse, lack of fit, areas and curves of the valve's paths (interface, section 4).

    Commands are those that went to the valve. A column has the chamber where both are driven.
    """
    gradients = ("p_gradient", "p_gradient_ci_low", "p_gradient_ci_high")
    kinds: dict[str, tuple[Callable[[ValveIdentification], Columns], dict[str, str]]] = {
        "valve_map": (_map, dict.fromkeys(gradients, "Pa/s") | {"covered": "1"}),
        "valve_inverse": (_inverse, {"p_gradient": "Pa/s", "reachable": "1"}),
        "valve_lack_of_fit": (_lack_of_fit_columns, dict.fromkeys(LACK_OF_FIT_COLUMNS, "Pa/s") | {"outside": "1"}),
        "valve_areas": (
            partial(_areas, estimates=estimates),
            dict.fromkeys(("area", *INTERVAL_COLUMNS), area_unit(estimates)) | {"opening": "V"},
        ),
        "valve_curves": (
            _curves,
            {"time": "s", "measured": "Pa", "fitted": "Pa", "mass_flow": "kg/s"}
            | dict.fromkeys(GRADIENT_COLUMNS, "Pa/s"),
        ),
    }
    both = valves[0].model_gradient.model.rig.arrangement.drives_both
    for name, (columns, units) in kinds.items():
        parts = [columns(valve) for valve in valves]
        if both:
            chambers = [
                {"chamber": np.full(len(part["u"]), valve.chamber)} for part, valve in zip(parts, valves, strict=True)
            ]
            parts = [chamber | part for chamber, part in zip(chambers, parts, strict=True)]
        table = {key: np.concatenate([np.asarray(part[key]) for part in parts]) for key in parts[0]}
        tables.write(
            name,
            {key: values if values.dtype.kind in "bif" else list(values) for key, values in table.items()},
            {key: unit for key, unit in ({"u": "V", "p": "Pa", "chamber": "1"} | units).items() if key in table},
        )


def area_unit(estimates: Sequence[Estimate]) -> str:
    """Return the unit of effective areas, which may be identifiable per volume only."""
    return next((e.unit for e in estimates if e.unit.startswith("m^2") and "area" in e.name), "m^2")


def _map(valve: ValveIdentification) -> Columns:
    grid = valve.map
    u, p = np.meshgrid(grid.u, grid.p, indexing="ij")
    return {
        "u": u.ravel(),
        "p": p.ravel(),
        "p_gradient": grid.gradient.ravel(),
        "p_gradient_ci_low": grid.ci_low.ravel(),
        "p_gradient_ci_high": grid.ci_high.ravel(),
        "covered": grid.covered.ravel(),
    }


def _inverse(valve: ValveIdentification) -> Columns:
    inverse = valve.inverse
    gradient, p = np.meshgrid(inverse.p_gradient, inverse.p, indexing="ij")
    columns = {"p_gradient": gradient, "p": p, "u": inverse.u, "reachable": inverse.reachable}
    return {name: values.ravel() for name, values in columns.items()}


def _lack_of_fit_columns(valve: ValveIdentification) -> Columns:
    """Return the model's valve and the measured gradients at covered commands."""
    lack = valve.lack_of_fit
    columns = {
        "u": valve.command_conversion.from_opening(lack.u),
        "p": lack.p,
        "model": lack.model,
        "model_ci_low": lack.model - Z95 * lack.model_error,
        "model_ci_high": lack.model + Z95 * lack.model_error,
        "measured": lack.measured,
        "measured_ci_low": lack.measured - lack.half_interval,
        "measured_ci_high": lack.measured + lack.half_interval,
        "difference": lack.difference,
        "outside": lack.outside,
    }
    return {name: values[lack.covered] for name, values in columns.items()}


def _areas(valve: ValveIdentification, estimates: Sequence[Estimate]) -> Columns:
    """Return the effective areas of the model's valve."""
    found = {e.name: e for e in estimates}
    areas = [(c, found[name]) for c, name in valve.model_gradient.valve.area_names.items() if name in found]
    return {
        "u": valve.command_conversion.from_opening(np.array([c for c, _ in areas])),
        "opening": np.array([c for c, _ in areas]),
        "area": np.array([e.value for _, e in areas]),
        "ci_low": np.array([e.ci95[0] for _, e in areas]),
        "ci_high": np.array([e.ci95[1] for _, e in areas]),
    }


def _curves(valve: ValveIdentification) -> Columns:
    curves, sizes = valve.curves, [c.time.size for c in valve.curves]
    named = np.repeat(np.array([c.recording for c in curves], dtype=object), sizes)
    columns: Columns = {"recording": named, "u": np.repeat(np.array([c.u for c in curves]), sizes)}
    for name in ("time", "measured", "fitted", *GRADIENT_COLUMNS):
        columns[name] = np.concatenate([np.zeros(0), *(getattr(c, name) for c in curves)])
    columns["mass_flow"] = mass_flow(valve, columns["gradient"])
    return columns


def mass_flow(valve: ValveIdentification, gradient: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mass flow (kg/s) of a gradient dp/dt (Pa/s) in the vessel, q = V dp/dt / (n R T), thesis (2.22).

    NaN if the volume of the vessel is unknown.
    """
    model = valve.model_gradient.model
    base, volume = model.base_values(), known_vessel_volume(model)
    per_flow = base["rig.polytropic_exponent"] * base["rig.gas_constant"] * base["rig.gas_temperature"]
    return gradient * ((np.nan if volume is None else volume) / per_flow)


def iso_parameters(valve: ValveIdentification) -> dict[str, Figure]:
    """Return ISO 6358-1 characteristics by command: name, value, 95 % interval."""
    names = {"C": "sonic_conductance", "b": "critical_ratio", "m": "subsonic_index"}
    return {
        f"{valve.label}.{name}({one.u:+.4g} V)": getattr(one, letter)
        for one in valve.iso
        for letter, name in names.items()
    }


def valve_answer(valve: ValveIdentification, estimates: Sequence[Estimate]) -> Valve:
    """Return what ``identify`` says of the valve."""
    found = {e.name: e for e in estimates}
    sides = {"charge": f"{valve.label}.overlap_fill", "discharge": f"{valve.label}.overlap_vent"}
    overlap = {side: found[name] for side, name in sides.items() if name in found}
    return Valve(
        map="measured" if valve.measured else "model",
        volume=None if valve.volume is None else {"value": valve.volume, "unit": "m^3"},
        overlap={side: Figure(e.value, *e.ci95, e.unit) for side, e in overlap.items()},
        iso=iso_parameters(valve),
        lack_of_fit=ValveDeviation(**named(valve.lack_of_fit, "median p95 share_outside")),
        residual=MapResidual(
            valve.residual_to_noise("train"), valve.residual_to_noise("test"), [asdict(r) for r in valve.residuals]
        ),
    )


def valve_findings(valve: ValveIdentification) -> Iterator[Finding]:
    """Yield what users must know before they use the map or the model of the valve: a code and its numbers."""
    if not valve.is_consistent:
        yield Finding("valve-not-described", {"largest": valve.max_gradient, "measured": valve.max_measured_gradient})
    train, test = valve.residual_to_noise("train") or 0.0, valve.residual_to_noise("test") or 0.0
    if train > MAX_TRAIN_RESIDUAL:
        yield Finding("valve-curves-not-followed", {"residual": train})
    if test > max(MAX_TRAIN_RESIDUAL, MAX_TEST_TO_TRAIN * train):
        yield Finding("valve-not-foreseen", {"residual": test})
    yield from lack_of_fit_findings(valve.lack_of_fit)


def lack_of_fit_findings(lack: LackOfFit) -> Iterator[Finding]:
    """Yield the difference of the model's valve from the measured one, where it is significant."""
    if lack.is_significant:
        numbers = {"median": lack.median, "p95": lack.p95, "outside": lack.share_outside}
        yield Finding("valve-lack-of-fit", numbers)
