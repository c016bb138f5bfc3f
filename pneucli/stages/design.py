"""``design``: the identified model -> matching, surfaces, sliding sector, PDC, and the cascade controller."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.closed_loop.acceptance import ACCEPTANCE_SCENARIOS, axis_variants, check_acceptance
from pneucli.closed_loop.commissioning import member_on_ensemble, with_commissioning
from pneucli.closed_loop.ensemble import (
    CONFIDENCE,
    FIGURES,
    LAW_RIGS,
    LAW_SEARCH_RIGS,
    PROOF_RIGS,
    Choice,
    Proof,
    RigEnsemble,
    RigTest,
    chosen_data,
    chosen_requirements,
    ensemble_of,
    family_of,
    prove,
    rig_test,
    search,
)
from pneucli.closed_loop.margins import LoopCut, MarginAnalysis, analyse_margins
from pneucli.closed_loop.robustness import sigma_from_intervals
from pneucli.closed_loop.scenarios import read_scenarios
from pneucli.closed_loop.simulation import ClosedLoopSetup
from pneucli.controller import layout
from pneucli.controller.laws import DEFAULT, LAWS, select_laws
from pneucli.controller.parameters import Controller
from pneucli.design.bandwidths import Bandwidths, choose_bandwidths
from pneucli.design.cascade_design import design_cascade
from pneucli.design.control_laws import (
    DesignData,
    collect_design_data,
    controller_for,
    design_controllers,
    design_variants,
    designed_sector,
    sliding_surfaces,
)
from pneucli.design.effect_compensation import has_restoring_force
from pneucli.design.pdc import WeightStudy, compare_weight_types
from pneucli.design.requirements import Requirements, read_requirements
from pneucli.design.sliding import (
    SlidingSector,
    axis_systems,
    limit_slope,
    sector_from_vertices,
    unmatched_disturbances,
)
from pneucli.errors import InputError
from pneucli.figure import to_answer
from pneucli.io.artifacts import Tables, read_table, write_text
from pneucli.messages import answer_of, compare
from pneucli.messages.compare import BAD_ERROR_RATIO, evaluation_error
from pneucli.messages.design import (
    Answer,
    DecayRate,
    Demand,
    Ensemble,
    Gate,
    Held,
    MarginPoint,
    Margins,
    Matching,
    MatrixInequalities,
    Poles,
    Quantity,
    SectorAnswer,
    SlidingLine,
    StickingPoint,
    WorstMargins,
)
from pneucli.messages.progress import counted
from pneucli.physics.effects import catalogue
from pneucli.pipeline.graph import Context, NotApplicable
from pneucli.recording import Recording
from pneucli.simulate.model import Model
from pneucli.stages.control_laws import (
    CONTROLLERS_FOLDER,
    LawComparison,
    closed_loop_scenarios,
    compare_controllers,
    metrics_by_law,
    observer_warnings,
    setup_from_requirements,
    valve_warnings,
    write_comparison,
)
from pneucli.stages.pipeline_data import PipelineData, parameter_intervals


@dataclass(frozen=True)
class DesignResult:
    """All that the stage found."""

    controllers: dict[str, Controller]
    not_designed: dict[str, str]
    requirements: Requirements
    corners: Bandwidths
    sectors: dict[str, SlidingSector]
    surfaces: list[SlidingLine]
    matching: dict[str, dict[str, list[str]]]
    weight_studies: list[WeightStudy]
    warnings: list[str]
    data: DesignData
    on_ensemble: EnsembleDesign | None = None

    @property
    def selected(self) -> Controller:
        """The controller that is simulated and exported."""
        return self.controllers[self.requirements.controller]


def run(context: Context) -> dict[str, Any]:
    """Design a controller for the identified axis; return the answer that ``--json`` prints.

    Raises NotApplicable where there is no axis to control.
    """
    study = PipelineData(context)
    axes = [r for r in study.recordings if r.kind.axis]
    if not study.rig.has_cylinder or not axes:
        raise NotApplicable(
            f"{context.path}", "no axis to control", "a cylinder and a recording of it with its valve", code="E071"
        )
    model = study.identified_model
    wanted = read_requirements(
        context.config.design, f"{context.path}, key design", **_sensors_and_drive(axes, model, context)
    )
    designed = _design(context, model, wanted, sealed_pressure(axes, model))
    names = [law.name for law in select_laws(context.options.get("compare") or LAWS, "--compare")]
    _require_controllers(designed, [wanted.controller, *context.options.get("compare", [])], context)
    context.progress("the same scenarios under each law")
    chosen = {name: designed.controllers[name] for name in names if name in designed.controllers}
    scenarios = closed_loop_scenarios(context, study.recordings, designed.selected)
    variants = design_variants(designed.data, chosen)
    found = compare_controllers(model, chosen, scenarios, setup_from_requirements(wanted), variants)
    designed.warnings.extend(valve_warnings(model) + observer_warnings(found))
    tables = study.tables("design", "identify/model.parquet")
    _write(tables, designed)
    write_comparison(found, tables)
    about = (context, model, designed.selected)
    setup = setup_from_requirements(wanted)
    margins = margins_answer(*about, setup, designed.corners.position, tables)
    held = acceptance_answer(*about, wanted, setup)
    rigs = None
    if (own := designed.on_ensemble) is not None:
        rigs = ensemble_answer(context, own, chosen, designed.data, setup)
    return to_answer(replace(_answer(study, designed, found), margins=margins, gate=held, ensemble=rigs))


def _require_controllers(designed: DesignResult, names: Sequence[str], context: Context) -> None:
    """Raise InputError where a law that was asked for cannot be made."""
    for name in names:
        if name in designed.not_designed:
            raise InputError(
                f"{context.path}, controller {name}",
                designed.not_designed[name],
                "a law that can be made here",
                code="E070",
            )


def _sensors_and_drive(axes: Sequence[Recording], model: Model, context: Context) -> dict[str, Any]:
    """Return what the recordings tell of the sensors, and how chamber 2 is driven."""
    kinds = {r.chamber_2 for r in axes}
    is_open = kinds == {"open"}
    if is_open and "chamber_2" not in context.config.design and not has_restoring_force(model):
        raise NotApplicable(
            f"{context.path}",
            "chamber 2 is open: nothing pulls the piston back",
            "a closed one, a valve, or a spring or weight among the effects",
            code="E071",
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
    base = model.base_values()
    dead, area, stroke = base["rig.dead_volume_2"], base["rig.piston_area_2"], base["rig.stroke"]
    found = []
    for r in axes:
        if "p2" in r and "x" in r and r.chamber_2 == "closed":
            share = (dead + area * (stroke - r["x"])) / (dead + 0.5 * area * stroke)
            found.append(r["p2"] * share ** base["rig.heat_capacity_ratio"])
    return float(np.nanmedian(np.concatenate(found))) if found else None


def _design(context: Context, model: Model, wanted: Requirements, sealed: float | None) -> DesignResult:
    context.progress("controller")
    controller = design_cascade(model, wanted, sealed)
    c = controller.values
    corners = choose_bandwidths(model, wanted, c)
    systems = axis_systems(c, 0.5 * c["C_STROKE"], c["C_P_MEAN"], c["C_P_MEAN"])
    matching = {name: unmatched_disturbances(system) for name, system in systems.items()}
    unpredicted = choose_bandwidths(model, wanted, c, predicted=False)
    designed = _designed_sector(controller, unpredicted, wanted)
    sectors, warnings = _sectors(context.artifacts / "identify", controller, designed, wanted)
    rows = sliding_surfaces(systems["mechanical"], unpredicted, wanted)
    context.progress("linear matrix inequalities")
    floor = sectors["resolved"].speed_floor if "resolved" in sectors else c["C_V_FLOOR"]
    weights: list[WeightStudy] = []
    missing = {"scheduled": "no weight type gives gains that are verified"}
    try:
        weights = compare_weight_types(c, floor)
    except InputError as error:
        missing["scheduled"] = error.found
        warnings.append(f"no PDC: {error.found}")
    data = collect_design_data(controller, unpredicted, wanted, rows, weights, missing)
    made, failed = design_controllers(data)
    own, setup = None, setup_from_requirements(wanted)
    if wanted.gains == "ensemble":
        own = design_on_ensemble(context, model, wanted, setup, sealed)
        made[DEFAULT], corners = own.controller, choose_bandwidths(own.model, own.requirements, own.controller.values)
    context.progress("gains for the commissioning")

    def member(slower: Model) -> Controller:
        if own is None:
            return design_cascade(slower, wanted, sealed)
        return member_on_ensemble(own.ensemble, slower, wanted, sealed, own.test, setup)

    if DEFAULT in made:
        made[DEFAULT] = with_commissioning(model, made[DEFAULT], member, setup)
    return DesignResult(made, failed, wanted, corners, sectors, rows, matching, weights, warnings, data, own)


def _vertices(folder: Path) -> list[float]:
    """Return a22 in 1/s at the vertices of the direct TP friction model (C), where there is one."""
    try:
        table = read_table(folder / "tp_vertices.parquet")
    except InputError:
        return []
    return [float(a) for a, m in zip(table["a22"], table["model"], strict=True) if m == "C"]


def _sectors(
    folder: Path, controller: Controller, designed: SlidingSector | None, requirements: Requirements
) -> tuple[dict[str, SlidingSector], list[str]]:
    """Return the sectors by name: ``vertices`` as identified, ``resolved`` as a sample can follow it, ``design``."""
    own = {} if designed is None else {"design": designed}
    if not (vertices := _vertices(folder)):
        return own, ["no sliding sector from vertices: there is no direct TP friction model"]
    c = controller.values
    try:
        sector = sector_from_vertices(
            vertices, c["C_MASS"], requirements.period, c["C_STATIC"], requirements.sector_ratio
        )
    except InputError as error:
        return own, [f"no sliding sector: {error.found}"]
    return {"vertices": sector, "resolved": limit_slope(sector, c["C_STATIC"], c["C_SECTOR_2"]), **own}, []


def _designed_sector(
    controller: Controller, bandwidths: Bandwidths, requirements: Requirements
) -> SlidingSector | None:
    """Return the sector of the law ``sector``; None without dry friction."""
    try:
        return designed_sector(controller, bandwidths, requirements)
    except InputError:
        return None


def _write(tables: Tables, designed: DesignResult) -> None:
    for name, controller in designed.controllers.items():
        write_text(tables.out / CONTROLLERS_FOLDER / f"{name}.json", controller.to_json())
    gains = [(name, value, layout.UNITS.get(name, "1")) for name, value in designed.selected.values.items()]
    tables.write("gains", "name, value [see column unit], unit", gains)
    write_sectors(tables, designed.sectors)
    if designed.weight_studies:
        write_weight_studies(tables, designed.weight_studies)


def _answer(study: PipelineData, designed: DesignResult, found: LawComparison) -> Answer:
    return Answer(
        schema="pneucli/design/1",
        pipeline=study.context.config.name,
        requirements=asdict(designed.requirements),
        corners={n: Quantity(v, "1/s") for n, v in asdict(designed.corners).items()},
        sector={
            n: SectorAnswer(**asdict(s), eta=s.eta, steepness=s.steepness, remark=s.warning)
            for n, s in designed.sectors.items()
        },
        matching={n: Matching(not broken, broken) for n, broken in designed.matching.items()},
        surface=designed.surfaces,
        lmi=_matrix_inequalities(designed),
        controllers={name: LAWS[name].title for name in designed.controllers},
        not_made=designed.not_designed,
        tolerance_um=2e6 * designed.selected.values["C_HOLDING_BAND"],
        compare=metrics_by_law(found.laws),
        without_map=metrics_by_law(found.without_inverse_map),
        ablation=metrics_by_law(found.ablation),
        variants=metrics_by_law(found.variants),
        warnings=designed.warnings,
        margins=None,
        gate=None,
        ensemble=None,
    )


def _matrix_inequalities(designed: DesignResult) -> MatrixInequalities:
    rates = [
        DecayRate(
            w.weight_type,
            w.pdc.rate if w.pdc else None,
            "1/s",
            w.pdc.status if w.pdc else w.failure,
            bool(w.pdc and w.pdc.verified),
        )
        for w in designed.weight_studies
    ]
    feasible = [w for w in designed.weight_studies if w.pdc]
    best = max(feasible, key=lambda w: w.pdc.rate if w.pdc else 0.0, default=None)
    loops = best.pdc.vertex_poles if best is not None and best.pdc is not None else np.zeros((0, 0))
    poles = [[[pole.real, pole.imag] for pole in loop] for loop in loops.tolist()]
    return MatrixInequalities(best.weight_type if best is not None else None, rates, poles)


def write_sectors(tables: Tables, rows: Mapping[str, SlidingSector]) -> None:
    """Write the sliding sectors."""
    listed = [
        (name, s.a_1, s.a_2, s.lambda_1, s.lambda_2, s.speed_floor, s.middle, s.steepness, s.warning)
        for name, s in rows.items()
    ]
    columns = (
        "name, a_1 [1/s], a_2 [1/s], lambda_1 [1/s], lambda_2 [1/s], speed_floor [m/s], middle [1/s], steepness [1], "
        "warning"
    )
    tables.write("sector", columns, listed)


def write_weight_studies(tables: Tables, weights: Sequence[WeightStudy]) -> None:
    """Write the parallel distributed compensation of each weight type."""
    listed = [
        (str(w.weight_type), w.vertices)
        + ((w.pdc.rate, w.pdc.worst_pole, w.pdc.worst_lmi, w.pdc.status) if w.pdc else (*3 * (None,), w.failure))
        + (bool(w.pdc and w.pdc.verified), w.peak_input_ratio, w.lyapunov_ratio)
        for w in weights
    ]
    columns = (
        "weight_type, vertices [1], rate [1/s], worst_pole [1/s], worst_lmi [1], status, verified [1], peak [1], "
        "decayed [1]"
    )
    tables.write("lmi", columns, listed)


MARGIN_UNITS = {"gain_up": "1", "gain_down": "1", "phase": "rad", "delay": "s", "modulus": "1", "crossover": "1/s"}
MAX_FREQUENCIES = 300  # frequencies of a ratio
MAX_POLES = 8  # poles of an operating point, slowest first
WORST_OF_MARGIN = {"gain_up": min, "gain_down": max, "phase": min, "delay": min, "modulus": min}


def acceptance_answer(
    context: Context, model: Model, controller: Controller, requirements: Requirements, setup: ClosedLoopSetup
) -> Gate:
    """Run the gate; return its part of the answer of ``design``."""
    sized = parameter_intervals(context.artifacts)
    axes = list(axis_variants(model, sized, sigma_from_intervals(sized, model)))
    scenarios = [s for s in read_scenarios([], controller, "") if s.name in ACCEPTANCE_SCENARIOS]

    def progress(number: int) -> None:
        context.progress(counted("the gate, axis", number, len(axes)))

    found = check_acceptance(controller, requirements, scenarios, setup, axes, progress)
    error = evaluation_error(answer_of(compare.Answer, context.answers).error)[1]
    return Gate(
        passed=not found.violations and not (error is not None and error > BAD_ERROR_RATIO),
        strict=requirements.strict,
        missed=found.violations,
        asked=[Demand(d.name, d.limit, d.unit) for d in found.criteria],
        axes=found.axis_count,
        model_error=error,
        model_error_limit=BAD_ERROR_RATIO,
    )


def margins_answer(
    context: Context,
    model: Model,
    controller: Controller,
    setup: ClosedLoopSetup,
    bandwidth: float,
    tables: Tables,
) -> Margins:
    """Return the margins as a part of the answer of ``design``; write ``margins.parquet``. ``bandwidth`` in rad/s."""
    context.progress("margins of the loop")
    found = analyse_margins(model, controller, setup, bandwidth)
    _write_margins(tables, found.cuts)
    points = [_point(cut, found) for cut in found.cuts]
    return Margins(
        points=points,
        worst={
            loop: _worst([p for p in points if p.loop == loop]) for loop in dict.fromkeys(c.loop for c in found.cuts)
        },
        poles=[
            Poles(x, speed, "1/s", [[p.real, p.imag] for p in poles[:MAX_POLES].tolist()])
            for (x, speed), poles in found.poles.items()
        ],
        stable=bool(found.poles) and not any(found.is_unstable(point) for point in found.poles),
        stuck=[StickingPoint(x, way) for x, way in found.sticking_points],
        left_out=found.excluded_effects,
        overlap=Quantity(controller.fill[0] - controller.vent[0], "V"),
        units=MARGIN_UNITS,
    )


def _point(cut: LoopCut, found: MarginAnalysis) -> MarginPoint:
    return MarginPoint(cut.loop, cut.x, cut.speed, not found.is_unstable((cut.x, cut.speed)), cut.margins)


def _worst(points: Sequence[MarginPoint]) -> WorstMargins:
    """Return of each margin the smallest one; not finite where there is no limit."""
    finite = {n: [v for p in points if math.isfinite(v := getattr(p.margins, n))] for n in WORST_OF_MARGIN}
    return WorstMargins(**{n: worst(finite[n], default=math.nan) for n, worst in WORST_OF_MARGIN.items()})


def _write_margins(tables: Tables, cuts: Sequence[LoopCut]) -> None:
    blocks = [
        (c.loop, c.x, c.speed, c.frequency[k], c.ratio.real[k], c.ratio.imag[k])
        for c in cuts
        for k in [np.unique(np.linspace(0, c.frequency.size - 1, MAX_FREQUENCIES).astype(int))]
    ]
    tables.write("margins", "loop, x, speed [m/s], frequency [1/s], real [1], imaginary [1]", blocks)


@dataclass(frozen=True)
class EnsembleDesign:
    """``best`` with gains from the ensemble, the model and the requirements that give them, and the test of a rig."""

    controller: Controller
    model: Model
    requirements: Requirements
    choice: Choice
    ensemble: RigEnsemble
    test: RigTest


def design_on_ensemble(
    context: Context, model: Model, wanted: Requirements, setup: ClosedLoopSetup, sealed: float | None
) -> EnsembleDesign:
    """Return the design whose gains hold best on the ensemble of rigs that the recordings allow."""

    def make(choice: Choice) -> Controller:
        return design_cascade(*chosen_requirements(choice, model, wanted), sealed)

    def progress(share: float) -> None:
        context.progress(f"gains on the ensemble, {share:.0%}")

    ensemble = ensemble_of(model, sigma_from_intervals(parameter_intervals(context.artifacts), model))
    test = rig_test(design_cascade(model, wanted, sealed), wanted)
    choice = search(ensemble, make, setup, test, family_of(ensemble), progress)
    return EnsembleDesign(make(choice), *chosen_requirements(choice, model, wanted), choice, ensemble, test)


def ensemble_answer(
    context: Context, found: EnsembleDesign, laws: Mapping[str, Controller], data: DesignData, setup: ClosedLoopSetup
) -> Ensemble:
    """Return what the chosen gains promise, and what every law does on fresh rigs, as it is stated and as chosen."""
    promise = prove(found.controller, found.ensemble, found.test, setup, PROOF_RIGS)
    rows = {DEFAULT: _proof_row(promise), f"{DEFAULT}, by the rules": _law_row(found, data.cascade, setup)}
    others = [name for name in laws if name != DEFAULT]
    for i, name in enumerate(others):
        context.progress(counted("laws on the ensemble", i, len(others)))
        rows[name] = _law_row(found, laws[name], setup)
        rows[f"{name}, ensemble"] = _law_row(found, _law_on_ensemble(name, found, data, setup), setup)
    limiting = promise.limiting
    return Ensemble(
        effects=list(found.ensemble.effects),
        spool_lag=Quantity(found.choice.lag, "s"),
        confidence=CONFIDENCE,
        limits={n: Quantity(limit, unit) for (n, unit), limit in zip(FIGURES.items(), found.test.limits, strict=True)},
        laws=rows,
        limiting=limiting or None,
        explained=promise.explained,
        rescued=promise.rescued,
        separate=catalogue()[limiting].separate if limiting else None,
    )


def _law_on_ensemble(name: str, found: EnsembleDesign, data: DesignData, setup: ClosedLoopSetup) -> Controller:
    """Return a law with the corners that hold best on the ensemble."""
    family = [choice for choice in family_of(found.ensemble) if choice.lag == 0.0]

    def make(choice: Choice) -> Controller:
        return controller_for(name, chosen_data(choice, data))

    return make(search(found.ensemble, make, setup, found.test, family, count=LAW_SEARCH_RIGS))


def _law_row(found: EnsembleDesign, controller: Controller, setup: ClosedLoopSetup) -> Held:
    return _proof_row(prove(controller, found.ensemble, found.test, setup, LAW_RIGS, explained=False))


def _proof_row(proof: Proof) -> Held:
    """Return one controller's rigs, those that it holds, and its figures over their limits, worst and median."""
    worst, median = (
        dict(zip(FIGURES, of.tolist(), strict=True))
        for of in (proof.ratios.max(axis=0), np.median(proof.ratios, axis=0))
    )
    return Held(len(proof.ratios), proof.held, proof.probability, worst, median)
