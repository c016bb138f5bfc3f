"""``identify``: signals -> valve map and inverse, friction models A to F, and the model's parameters."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from pneucli.errors import InputError
from pneucli.figure import Figure, to_answer
from pneucli.identify.estimation.fit import Estimate, Fit, Iteration, report_iterations_to, without_data
from pneucli.identify.estimation.intervals import draw_parameters, with_intervals
from pneucli.identify.estimation.model_fit import fit_model
from pneucli.identify.estimation.parameters import FreeParameter
from pneucli.identify.friction.identification import FrictionIdentification, identify_friction
from pneucli.identify.guesses.flow_paths import Chamber, as_valve_test, valve_driven
from pneucli.identify.guesses.null_command import drifting_recordings
from pneucli.identify.residuals import with_channel_weights
from pneucli.identify.valve.charge_budget import with_budgets
from pneucli.identify.valve.flow_bench import FlowBench
from pneucli.identify.valve.identification import ValveIdentification, identify_valve
from pneucli.identify.valve.uncertainty import COVERAGE_FACTOR
from pneucli.io.artifacts import Tables
from pneucli.messages.compare import ModelAnswer
from pneucli.messages.findings import tell
from pneucli.messages.formatting import format_number
from pneucli.messages.identify import Answer, Budget, Uncertainty
from pneucli.pipeline.graph import Context
from pneucli.recording import Rig
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.position_smoother import PositionSmoother
from pneucli.stages.answer_parts import (
    assumed_values,
    figures_of,
    fixed_parameters,
    leaks_of,
    measurement_of,
    null_command_estimate,
    per_vessel_volume,
)
from pneucli.stages.flow_bench import flow_answer, flow_bench, flow_parameters, identify_flow_only, write_flow
from pneucli.stages.identify_tables import (
    friction_answer,
    iso_parameters,
    valve_answer,
    valve_findings,
    write_budgets,
    write_friction,
    write_parameter_relations,
    write_parameters,
    write_valves,
)
from pneucli.stages.pipeline_data import PipelineData, save_drawn_parameters, save_model

MAX_NOISE_RATIO = 2.0  # times a sensor's noise, beyond which a position is said to scatter
MAX_FIT_SAMPLES = 300_000  # of the fit: its derivatives need 0.4 kB each, and minutes describe a rig as well as hours


def run(context: Context) -> dict[str, Any]:
    """Identify whatever the training recordings allow; return the answer that ``--json`` prints.

    Raises InputError where no recording can be used for anything.
    """
    study = PipelineData(context)
    if not study.recordings:
        return identify_flow_only(study)
    bench = flow_bench(study)
    warnings = _null_warnings(study.rig)
    rounds: list[Iteration] = []
    fitted_part = study.at_most(MAX_FIT_SAMPLES)
    views = with_channel_weights(fitted_part.residual_models("train"), context.config.identify.weights)
    with report_iterations_to(_round_observer(study, rounds)):
        study.context.progress("fitting the model")
        fitted = fit_model(fitted_part.guess(), views, study.effects)
    tables = study.tables("identify", "ingest/signals.parquet")
    save_drawn_parameters(draw_parameters(fitted), tables)
    whole = with_intervals(fitted, views)
    write_parameter_relations(whole, views, rounds, tables)
    if subsampling := fitted_part.subsampling:
        warnings.append(tell("fit-subsampled", **subsampling))
    found = without_data(whole)
    del fitted, whole, views, fitted_part  # their derivatives fill the memory with a long recording
    context.progress("identifying the valve")
    instruments = measurement_of(study)
    valves = [with_budgets(one, found.estimates, instruments) for one in _identify_valves(study, found, warnings)]
    warnings += _smoothing_warnings(study.experiments)
    leaks = leaks_of(study, found.model, [per_vessel_volume(e, study) for e in found.estimates])
    study.release_experiments()
    context.progress("identifying friction")
    model, estimates = (
        found.model,
        [per_vessel_volume(e, study) for e in found.estimates] + null_command_estimate(study.rig),
    )
    estimates += fixed_parameters(found.model)
    warnings += _unused_prior_warnings(study, found.free)
    at_bound, stated = [e.name for e in found.estimates if e.at_bound], study.rig.priors
    warnings += [tell("at-stated-bound" if n in stated else "at-default-bound", name=n) for n in at_bound]
    warnings += _volume_warnings(study.rig, found.estimates)
    friction = _identify_friction(study, model, warnings)
    _write(tables, model, estimates, valves, friction, bench)
    answer = _answer(study, estimates, valves, friction, bench)
    flow_warnings = [one.text for one in (answer.flow.findings if answer.flow else ())]
    return to_answer(replace(answer, warnings=[*warnings, *flow_warnings], leaks=leaks))


def _answer(
    study: PipelineData,
    estimates: Sequence[Estimate],
    valves: Sequence[ValveIdentification],
    friction: FrictionIdentification | None,
    bench: FlowBench | None,
) -> Answer:
    budgets = all_budgets(valves, bench)
    by_label = {valve.label: valve_answer(valve, estimates) for valve in valves}
    return Answer(
        schema="pneucli/identify/1",
        pipeline=study.context.config.name,
        model=ModelAnswer([e.name for e in study.effects], figures_of(estimates)),
        assumed=assumed_values(study, {e.name for e in estimates}),
        warnings=[],
        contradicted=study.contradicted,
        valve=by_label.get("valve"),
        valve_2=by_label.get("valve_2"),
        friction=None if friction is None else friction_answer(friction),
        flow=None if bench is None else flow_answer(bench),
        uncertainty=Uncertainty(COVERAGE_FACTOR, budgets) if budgets else None,
    )


def all_budgets(valves: Sequence[ValveIdentification], bench: FlowBench | None) -> dict[str, Budget]:
    """Return the budgets of all characteristics; those of a steady bench replace those of the same command."""
    of_bench = {} if bench is None else bench.budgets
    of_valves = {name: one for valve in valves for name, one in valve.budgets.items() if name not in of_bench}
    return {**of_valves, **of_bench}


def _smoothing_warnings(experiments: Sequence[Experiment]) -> list[str]:
    """Return what to say of imposed motions whose readings scatter far more than the noise of their sensor."""
    imposed = [e for e in experiments if e.recording.imposed and isinstance(e.motion_smoother, PositionSmoother)]
    ratios = [(e.recording.name, e.motion_smoother.noise_ratio(e.noise["x"])) for e in imposed]  # type: ignore[union-attr]
    return [tell("scattered-position", name=name, ratio=ratio) for name, ratio in ratios if ratio > MAX_NOISE_RATIO]


def _volume_warnings(rig: Rig, estimates: Sequence[Estimate]) -> list[str]:
    """Return what to say where the stated volume of the vessel contradicts the recorded flow into it."""
    found = next((e for e in estimates if e.name == "rig.vessel_volume"), None)
    if found is None or rig.vessel_volume is None or found.ci95[0] <= rig.vessel_volume <= found.ci95[1]:
        return []
    volumes = (found.value, *found.ci95, rig.vessel_volume)
    return [
        tell("vessel-volume", **dict(zip(("value", "low", "high", "stated"), (1e6 * v for v in volumes), strict=True)))
    ]


def _unused_prior_warnings(study: PipelineData, free: Sequence[FreeParameter]) -> list[str]:
    """Return what to say of entries of [model.parameters] that say nothing of this model."""
    model_has = {f.name for f in free}
    idle = [n for n, k in study.rig.priors.items() if k.fixed is None and n not in model_has]
    waiting = [n for n in study.context.config.model.parameters if n not in study.rig.priors]
    return [
        *(tell("prior-not-identified", name=n) for n in idle),
        *(tell("prior-of-absent-effect", name=n) for n in waiting),
    ]


def _null_warnings(rig: Rig) -> list[str]:
    """Return what to say where recordings cannot all have the null command that was identified."""
    if (names := drifting_recordings(rig)) is None:
        return []
    low, high = ((name, *rig.null_ranges[name]) for name in names)
    return [tell("valve-null-drifts", low=low, high=high, null=rig.valve_null)]


def _round_observer(study: PipelineData, rounds: list[Iteration]) -> Callable[[Iteration], None]:
    """Return the observer that stores each iteration of the fit and reports the progress."""

    def see(one: Iteration) -> None:
        rounds.append(one)
        what = f"with {one.effects[-1]}" if one.effects else "the base model"
        text = f"fitting {what}, round {one.round}: {format_number(one.residual, 3)} × noise"
        study.context.progress(text)

    return see


def _identify_valves(study: PipelineData, found: Fit, warnings: list[str]) -> list[ValveIdentification]:
    """Return the paths of each chamber that recordings show: from curves, or else from moving commands."""
    chambers: tuple[Chamber, ...] = (1, 2)
    valves = [
        valve for chamber in chambers if (valve := _identify_chamber_valve(study, found, chamber, warnings)) is not None
    ]
    for valve in valves:
        which = " (chamber 2)" if valve.chamber == 2 else ""
        warnings += [f"{one.text}{which}" for one in valve_findings(valve)]
    return valves


def _identify_chamber_valve(
    study: PipelineData, found: Fit, chamber: Chamber, warnings: list[str]
) -> ValveIdentification | None:
    driven = (e for e in valve_driven(study.experiments) if e.recording.use == "train")
    if all(as_valve_test(e, chamber) is None for e in driven):
        return None
    try:
        return identify_valve(study.experiments, found, chamber)
    except InputError as error:
        warnings.append(tell("no-map", where=error.where, found=error.found))
        return None


def _identify_friction(study: PipelineData, model: Model, warnings: list[str]) -> FrictionIdentification | None:
    if not any(r.kind.cylinder and r.use == "train" for r in study.recordings):
        return None
    try:
        asked = study.context.config.identify.friction
        found = identify_friction(study.recordings, model, asked.nodes, asked.velocity_range, asked.eta)
    except InputError as error:
        warnings.append(tell("no-friction-models", where=error.where, found=error.found))
        return None
    warnings += [one.text for one in found.warnings]
    return found


def _write(
    tables: Tables,
    model: Model,
    estimates: list[Estimate],
    valves: list[ValveIdentification],
    friction: FrictionIdentification | None,
    bench: FlowBench | None,
) -> None:
    save_model(model, tables)
    found = {e.name: Figure(e.value, *e.ci95, e.unit) for e in estimates}
    if valves:
        write_valves(valves, estimates, tables)
        found |= {name: one for valve in valves for name, one in iso_parameters(valve).items()}
    if bench is not None:  # which measures the flow itself: its characteristics replace those of the same command
        measured = flow_parameters(bench)
        found = {name: one for name, one in found.items() if name not in measured} | measured
        write_flow(bench, tables, valve_map=not valves)
    if friction is not None:
        write_friction(friction, tables)
    write_parameters(found, tables)
    write_budgets(all_budgets(valves, bench), tables)
