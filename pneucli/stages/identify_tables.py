"""What ``identify`` writes and answers: parameters, relations between them, budgets, the valve, friction."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.figure import FIGURE_COLUMNS, Figure, named
from pneucli.identify.estimation.fit import Estimate, Fit, Iteration
from pneucli.identify.estimation.intervals import parameter_correlation, sensitivities
from pneucli.identify.friction.identification import FrictionIdentification
from pneucli.identify.residuals import ResidualModel
from pneucli.identify.valve.identification import LackOfFit, ValveIdentification, known_vessel_volume
from pneucli.io.artifacts import Tables
from pneucli.messages.findings import Finding
from pneucli.messages.identify import Budget, Friction, KineticLevel, MapResidual, Valve, ValveDeviation
from pneucli.quantities import Z95

Block = Sequence[Any]  # of rows of a table
Written = tuple[str, str, Iterable[Block]]  # name, columns and blocks of a table
MAX_TRAIN_RESIDUAL = 3.0  # times the noise: the limit of a good map on its own curves
MAX_TEST_TO_TRAIN = 2.0  # times the residual on fitted curves
MODEL_POINTS = 401
DEVIATION_KEYS = "model recording use channel rmsd noise unit percent"


def write_parameters(found: Mapping[str, Figure], tables: Tables) -> None:
    """Write ``parameters``, a row for each parameter or characteristic."""
    tables.write("parameters", f"name, {FIGURE_COLUMNS}", [(name, *one.row) for name, one in found.items()])


def write_parameter_relations(
    found: Fit, views: Sequence[ResidualModel], rounds: Sequence[Iteration], tables: Tables
) -> None:
    """Write ``correlation`` (a row a pair), ``sensitivity`` (a row a parameter and channel) and ``iterations``."""
    names = [e.name for e in found.estimates]
    pairs = [(one, other) for one in names for other in names]
    related = [(*pair, r) for pair, r in zip(pairs, parameter_correlation(found).ravel(), strict=True)]
    tables.write("correlation", "name, other, correlation [1]", related)
    felt = [(s.name, s.channel, s.times_noise) for s in sensitivities(found, views)]
    tables.write("sensitivity", "name, channel, times_noise [1]", felt)
    walked = [(", ".join(r.effects), r.search, r.round, r.residual) for r in rounds]
    tables.write("iterations", "effects, search [1], round [1], residual [1]", walked)


def write_budgets(budgets: Mapping[str, Budget], tables: Tables) -> None:
    """Write ``uncertainty_budget``: a row for each source of each result."""
    rows = [
        (
            *(name, budget.figure.unit, one.source, one.type_, one.unit, one.bound),
            *(one.uncertainty, one.sensitivity, one.contribution, one.share),
            *(budget.figure.value, budget.combined, budget.expanded, budget.figure.low, budget.figure.high),
        )
        for name, budget in budgets.items()
        for one in budget.sources
    ]
    if rows:
        columns = (
            "name, unit, source, type, uncertainty_unit, bound [1], uncertainty [see column uncertainty_unit], "
            "sensitivity [unit / uncertainty_unit], contribution [see column unit], share [1], "
            "value [see column unit], combined [see column unit], expanded [see column unit], "
            "ci_low [see column unit], ci_high [see column unit]"
        )
        tables.write("uncertainty_budget", columns, rows)


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
        repeats=friction.repeatability,
        deviations=[named(d, DEVIATION_KEYS) for d in friction.deviations],
    )


def write_friction(friction: FrictionIdentification, tables: Tables) -> None:
    """Write models A to F, curves, stick-slips, tables 6.2 and 6.3, kinetic friction, TP weights and vertices."""
    written = (_friction_curves(friction), _friction_models(friction), _friction_figures(friction))
    for name, columns, found in chain(*written):
        if blocks := list(found):
            tables.write(name, columns, blocks)


def _friction_curves(friction: FrictionIdentification) -> Iterator[Written]:
    """Yield name, columns and blocks of what was measured."""
    measured = ((c.branch, c.v, c.force, c.ci_low, c.ci_high, c.count.astype(float)) for c in friction.curves)
    yield "friction_curves", "branch, v, force [N], ci_low [N], ci_high [N], count [1]", measured
    slips = (
        (c.recording, float(i), float(c.direction), c.time, c.speed, c.friction)
        for i, c in enumerate(friction.stick_slips)
        if c.time.size
    )
    yield "friction_cuts", "recording, cut [1], direction [1], time [s], speed [m/s], force [N]", slips
    averages = (
        (a.branch, float(a.direction), a.speed, a.friction, a.error, a.count.astype(float)) for a in friction.averages
    )
    columns = "branch, direction [1], speed [m/s], force [N], error [N], count [1]"
    yield "friction_averages", columns, averages


def _friction_models(friction: FrictionIdentification) -> Iterator[Written]:
    """Yield name, columns and blocks of the models."""
    branches = [(m.name, b) for m in friction.models for b in m.branches]
    grid = np.linspace(-friction.domain.max_velocity, friction.domain.max_velocity, MODEL_POINTS)
    models = ((name, b.branch, grid, b.force(grid)) for name, b in branches)
    yield "friction_models", "model, branch, v, force [N]", models
    replays = ((r.model, r.time, r.v, r.v_model, r.a, r.a_model) for r in friction.replays)
    yield "friction_replays", "model, time, v, v_model [m/s], a, a_model [m/s^2]", replays
    parameters = ((model, b.branch, name, *one.row) for model, b in branches for name, one in b.parameters.items())
    yield "friction_parameters", f"model, branch, name, {FIGURE_COLUMNS}", parameters
    convex = [(name, b.branch, b.tp) for name, b in branches if b.tp is not None]
    weights = (
        (name, branch, float(vertex), tp.grids[0], weight)
        for name, branch, tp in convex
        for vertex, weight in enumerate(tp.weights[0].T)
    )
    yield "tp_weights", "model, branch, vertex [1], v, weight [1]", weights
    vertices = ((name, branch, np.arange(float(tp.vertices.size)), tp.vertices.ravel()) for name, branch, tp in convex)
    yield "tp_vertices", "model, branch, vertex [1], a22 [1/s]", vertices


def _friction_figures(friction: FrictionIdentification) -> Iterator[Written]:
    """Yield name, columns and rows of what recordings have one of."""
    keys = "model recording use channel rmsd unit percent relative_percent noise"
    lacks = {name: ", ".join(effects) for name, effects in friction.unmodelled_effects.items()}
    columns = (
        "model, recording, use, channel, rmsd [see column unit], unit, percent [%], relative_percent [%], "
        "noise [see column unit], lacks"
    )
    deviations = ((*named(d, keys).values(), lacks[d.model]) for d in friction.deviations)
    yield "friction_deviations", columns, deviations
    levels = (
        (k.recording, k.pressures.get("p1", np.nan), k.speed, f.value, f.low, f.high, k.offset.value)
        for k in friction.kinetic
        for f in [k.friction]
    )
    yield "friction_kinetic", "recording, p1, speed [m/s], friction [N], ci_low [N], ci_high [N], offset [N]", levels


def write_valves(valves: Sequence[ValveIdentification], estimates: Sequence[Estimate], tables: Tables) -> None:
    """Write map, inverse, lack of fit, areas and curves of the valve's paths (interface, section 4).

    Commands are those that went to the valve. A column has the chamber where both are driven.
    """
    both = valves[0].model_gradient.model.rig.arrangement.drives_both
    written: dict[tuple[str, str], list[Block]] = {}
    for valve in valves:
        for name, columns, blocks in _valve_tables(valve, estimates):
            own = [(valve.chamber, *block) if both else block for block in blocks]
            written.setdefault((name, columns), []).extend(own)
    for (name, columns), listed in written.items():
        tables.write(name, f"chamber [1], {columns}" if both else columns, listed)


def area_unit(estimates: Sequence[Estimate]) -> str:
    """Return the unit of effective areas, which may be identifiable per volume only."""
    return next((e.unit for e in estimates if e.unit.startswith("m^2") and "area" in e.name), "m^2")


def _valve_tables(valve: ValveIdentification, estimates: Sequence[Estimate]) -> Iterator[Written]:
    """Yield name, columns and blocks of the tables of one valve; lack of fit is that of covered commands."""
    grid, inverse, lack, back = valve.map, valve.inverse, valve.lack_of_fit, valve.command_conversion.from_opening
    u, p = np.meshgrid(grid.u, grid.p, indexing="ij")
    gradients = "p_gradient [Pa/s], p_gradient_ci_low [Pa/s], p_gradient_ci_high [Pa/s]"
    values: Block = (u, p, grid.gradient, grid.ci_low, grid.ci_high, grid.covered)
    yield "valve_map", f"u [V], p [Pa], {gradients}, covered [1]", [[one.ravel() for one in values]]
    gradient, p = np.meshgrid(inverse.p_gradient, inverse.p, indexing="ij")
    values = (gradient, p, inverse.u, inverse.reachable)
    yield "valve_inverse", "p_gradient [Pa/s], p [Pa], u [V], reachable [1]", [[one.ravel() for one in values]]
    model, measured = (
        (middle, middle - half, middle + half)
        for middle, half in ((lack.model, Z95 * lack.model_error), (lack.measured, lack.half_interval))
    )
    values = (back(lack.u), lack.p, *model, *measured, lack.difference, lack.outside)
    columns = (
        "u [V], p [Pa], model [Pa/s], model_ci_low [Pa/s], model_ci_high [Pa/s], measured [Pa/s], "
        "measured_ci_low [Pa/s], measured_ci_high [Pa/s], difference [Pa/s], outside [1]"
    )
    yield "valve_lack_of_fit", columns, [[one[lack.covered] for one in values]]
    found, unit = {e.name: e for e in estimates}, area_unit(estimates)
    areas = [(c, found[name]) for c, name in valve.model_gradient.valve.area_names.items() if name in found]
    opening, area, low, high = np.array([(c, e.value, *e.ci95) for c, e in areas]).reshape(-1, 4).T
    columns = f"u [V], opening [V], area [{unit}], ci_low [{unit}], ci_high [{unit}]"
    yield "valve_areas", columns, [(back(opening), opening, area, low, high)]
    curves = (
        (c.recording, c.u, c.time, c.measured, c.fitted, c.gradient, c.ci_low, c.ci_high, mass_flow(valve, c.gradient))
        for c in valve.curves
    )
    columns = "u [V], time [s], measured [Pa], fitted [Pa], gradient [Pa/s], ci_low [Pa/s], ci_high [Pa/s]"
    yield "valve_curves", f"recording, {columns}, mass_flow [kg/s]", curves


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
