"""``identify``: signals -> valve map and inverse, friction models A to F, and the model's parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

from pneucli.errors import InputError
from pneucli.identify.estimation.fit import Estimate, Fit, without_data
from pneucli.identify.estimation.intervals import with_intervals
from pneucli.identify.estimation.model_fit import fit_model
from pneucli.identify.estimation.parameters import Free, has, value_of
from pneucli.identify.estimation.progress import Round, watching
from pneucli.identify.friction import FrictionIdentification, identify_friction
from pneucli.identify.guesses.chamber_balance import Chamber
from pneucli.identify.guesses.flow_paths import driven, opening_of
from pneucli.identify.guesses.friction_and_valve import STAND_IN_VOLUME, first_guess
from pneucli.identify.guesses.null_command import drifted
from pneucli.identify.leak_rate import TRADE, leak_flows, losses
from pneucli.identify.residuals import View, weighted
from pneucli.identify.valve import ValveIdentification, identify_moving, identify_valve
from pneucli.io.artifacts import write_table
from pneucli.messages.formatting import number
from pneucli.pipeline.context import Context
from pneucli.plausibility.required_inputs import Assumed, assumptions, to_identify
from pneucli.quantities import named
from pneucli.recording import Rig
from pneucli.simulate.model import Model
from pneucli.stages.pipeline_data import Study, save_model
from pneucli.stages.tables.correlation import write_relations
from pneucli.stages.tables.friction import friction_answer, write_friction
from pneucli.stages.tables.valve import iso_parameters, valve_answer, valve_warnings, write_valves

STATED = {
    "rig.moving_mass": "rig.cylinder.moving_mass",
    "rig.dead_volume_1": "rig.cylinder.dead_volume_1",
    "rig.dead_volume_2": "rig.cylinder.dead_volume_2",
    "rig.vessel_volume": "rig.vessel.volume",
}  # where the pipeline file says what is identified where it does not
AT_STATED = "{} stands at its bound, which [model.parameters] may set: these recordings ask for more, or do not show it"
AT_BOUND = "{} stands at its bound: these recordings do not show it; leave it out, or record a motion that does"


def run(context: Context) -> dict[str, Any]:
    """Identify whatever the training recordings allow; return the answer that ``--json`` prints.

    Raises InputError where no recording can be used for anything.
    """
    study = Study(context)
    warnings = _null_warnings(study.rig)
    rounds: list[Round] = []
    views = weighted(study.views("train"), study.context.config.identify.weights)
    with watching(_shown(study, rounds)):
        whole = _fitted(study, views)
    write_relations(whole, views, rounds, context.out, study.provenance("ingest/signals.parquet"))
    found = without_data(whole)
    del whole, views  # their derivatives fill the memory with a long recording
    context.progress("identifying the valve", 0.5)
    valves = _valves(study, found, warnings)
    leaks = _leaks(study, found.model, [as_ratio(e, study) for e in found.estimates])
    study.forget_experiments()
    context.progress("identifying friction", 0.7)
    model, estimates = found.model, [as_ratio(e, study) for e in found.estimates] + _null(study.rig)
    estimates += _fixed(found.model)
    warnings += _unused(study, found.free)
    warnings += [_at_bound(e.name, study.rig) for e in found.estimates if e.at_bound]
    friction = _friction(study, model, warnings)
    _write(study, model, estimates, valves, friction)
    return _answer(study, estimates, valves, friction, warnings) | leaks


def _null(rig: Rig) -> list[Estimate]:
    """Return the null command where it was identified: anywhere in its range it explains the recordings as well."""
    if rig.null_range is None:
        return []
    low, high = rig.null_range
    return [Estimate("valve.null", "V", rig.valve_null, 0.25 * (high - low), (low, high), False)]


def _at_bound(name: str, rig: Rig) -> str:
    return (AT_STATED if name in rig.known else AT_BOUND).format(name)


def _fixed(model: Model) -> list[Estimate]:
    """Return the parameters that the pipeline file fixes: the interval has no width."""
    fixed = {name: k for name, k in model.rig.known.items() if k.fixed is not None and has(model, name)}
    return [
        Estimate(name, k.unit, value := value_of(model, name), 0.0, (value, value), False) for name, k in fixed.items()
    ]


def _unused(study: Study, free: Sequence[Free]) -> list[str]:
    """Return what to say of entries of [model.parameters] that say nothing of this model."""
    model_has = {f.name for f in free}
    idle = [n for n, k in study.rig.known.items() if k.fixed is None and n not in model_has]
    waiting = [n for n in study.context.config.model.parameters if n not in study.rig.known]
    return [
        *(f"[model.parameters] {n} is not used: these recordings do not show it" for n in idle),
        *(f"[model.parameters] {n} is not used: the model has not that effect" for n in waiting),
    ]


def _null_warnings(rig: Rig) -> list[str]:
    """Return what to say where recordings cannot all have the null command that was identified."""
    if (names := drifted(rig)) is None:
        return []
    low, high = (f"{name} ({rig.null_ranges[name][0]:.4g} to {rig.null_ranges[name][1]:.4g} V)" for name in names)
    return [
        f"valve-null-drifts: {low} and {high} have no null command in common; the model has one, "
        f"{rig.valve_null:.4g} V: split the recordings, or find out what moved the spool"
    ]


def _shown(study: Study, rounds: list[Round]) -> Callable[[Round], None]:
    """Return what keeps each round of the fit, and tells people how far it is."""

    def see(one: Round) -> None:
        rounds.append(one)
        what = f"with {one.effects[-1]}" if one.effects else "the base model"
        text = f"fitting {what}, round {one.round}: {number(one.residual, 3)} × noise"
        study.context.progress(text, 0.3 + 0.2 * len(rounds) / (len(rounds) + 30.0))  # how many there are, data decide

    return see


def _fitted(study: Study, views: Sequence[View]) -> Fit:
    """Return the model with its parameters."""
    train = [e for e in study.experiments if e.recording.use == "train"]
    if not train:
        raise InputError(
            f"{study.context.path}, key recordings", "no recording to train on", 'at least one with use = "train"'
        )
    study.context.progress("fitting the model", 0.3)
    guess = first_guess(train, study.rig, study.valve)
    return with_intervals(fit_model(guess, views, study.effects), views)


def _valves(study: Study, found: Fit, warnings: list[str]) -> list[ValveIdentification]:
    """Return the paths of each chamber that recordings show: from curves, or else from moving commands."""
    chambers: tuple[Chamber, ...] = (1, 2)
    valves = [valve for chamber in chambers if (valve := _valve(study, found, chamber, warnings)) is not None]
    for valve in valves:
        which = " (chamber 2)" if valve.chamber == 2 else ""
        warnings += [f"{text}{which}" for text in valve_warnings(valve)]
    return valves


def _valve(study: Study, found: Fit, chamber: Chamber, warnings: list[str]) -> ValveIdentification | None:
    shown = [e for e in driven(study.experiments) if e.recording.use == "train" and opening_of(e, chamber) is not None]
    if not shown:
        return None
    try:
        if any(e.vessel for e in shown):
            return identify_valve(study.experiments, found, chamber)
    except InputError as error:
        warnings.append(
            f"no measured map of chamber {chamber}: {error.where}: {error.found}; the map is that of the model's valve"
        )
    try:
        return identify_moving(study.experiments, found, chamber)
    except InputError as error:
        warnings.append(f"no valve map: {error.where}: {error.found}")
        return None


def _friction(study: Study, model: Model, warnings: list[str]) -> FrictionIdentification | None:
    if not any(r.kind.cylinder and r.use == "train" for r in study.recordings):
        return None
    try:
        asked = study.context.config.identify.friction
        found = identify_friction(study.recordings, model, asked.nodes, asked.velocity_range, asked.eta)
    except InputError as error:
        warnings.append(f"no friction models: {error.where}: {error.found}")
        return None
    warnings += found.warnings
    return found


def _per_volume(study: Study) -> bool:
    """Whether vessels of unknown volume are all that gas flows into."""
    unknown = study.rig.vessel_volume is None and "rig.vessel_volume" not in to_identify(study.recordings, study.rig)
    return unknown and {r.kind.cylinder for r in study.recordings if r.kind.valve} == {False}


def as_ratio(estimate: Estimate, study: Study) -> Estimate:
    """Return the estimate, per volume of the vessel where that volume is not known: only the ratio can be told."""
    counted = estimate.unit.startswith(("m^2", "m^3", "W/K", "kg/")) and not estimate.name.startswith("rig.")
    if not (counted and _per_volume(study)):
        return estimate
    low, high = estimate.ci95
    return Estimate(
        estimate.name,
        f"{estimate.unit}/m^3",
        estimate.value / STAND_IN_VOLUME,
        estimate.error / STAND_IN_VOLUME,
        (low / STAND_IN_VOLUME, high / STAND_IN_VOLUME),
        estimate.at_bound,
    )


def _write(
    study: Study,
    model: Model,
    estimates: list[Estimate],
    valves: list[ValveIdentification],
    friction: FrictionIdentification | None,
) -> None:
    out, provenance = study.context.out, study.provenance("ingest/signals.parquet")
    save_model(model, out, provenance)
    rows = [(e.name, e.value, e.unit, *e.ci95) for e in estimates]
    if valves:
        write_valves(valves, estimates, out, provenance)
        rows += [row for valve in valves for row in iso_parameters(valve)]
    if friction is not None:
        write_friction(friction, out, provenance)
    name, value, unit, low, high = zip(*rows, strict=True) if rows else ((),) * 5
    write_table(
        out / "parameters.parquet",
        {"name": list(name), "value": value, "unit": list(unit), "ci_low": low, "ci_high": high},
        units=dict.fromkeys(("value", "ci_low", "ci_high"), "see column unit"),
        schema="pneucli/identify/parameters/1",
        provenance=provenance,
    )


def assumed(study: Study, names: set[str]) -> list[Assumed]:
    """Return what stands in for what the pipeline file does not say of the rig; ``names`` are of what was fitted."""
    rig, stated = study.rig, study.context.config.document.get("rig", {})
    gas = any(r.kind.valve for r in study.recordings)
    pressed = gas or any("p1" in r or "p2" in r for r in study.recordings)
    found = []
    if pressed and "ambient_pressure" not in stated:
        found.append(Assumed(f"ambient pressure is {rig.ambient_pressure / 1e5:.5g} bar", "rig.ambient_pressure"))
    if gas and "gas_temperature" not in stated:
        found.append(Assumed(f"the gas has {rig.gas_temperature:g} K", "rig.gas_temperature"))
    unstated = {name for name in names & STATED.keys() if getattr(rig, name.removeprefix("rig.")) is None}
    keys = {named(name): named(STATED[name]) for name in STATED if name in unstated}
    instead = [Assumed(f"{name} is not stated and identified", key) for name, key in keys.items()]
    if _per_volume(study):
        instead.append(Assumed("areas, volumes and flows are per volume of the vessel", "rig.vessel.volume"))
    return [*found, *assumptions(study.recordings, rig), *instead]


def parameter_answer(estimates: list[Estimate]) -> dict[str, Any]:
    """Return the parameters as the JSON answers hold them."""
    return {e.name: {"value": e.value, "unit": e.unit, "ci95": list(e.ci95)} for e in estimates}


def _answer(
    study: Study,
    estimates: list[Estimate],
    valves: list[ValveIdentification],
    friction: FrictionIdentification | None,
    warnings: list[str],
) -> dict[str, Any]:
    answer: dict[str, Any] = {
        "schema": "pneucli/identify/1",
        "pipeline": study.context.config.name,
        "model": {"effects": [e.name for e in study.effects], "parameters": parameter_answer(estimates)},
        "assumed": [asdict(one) for one in assumed(study, {e.name for e in estimates})],
        "warnings": warnings,
    }
    answer |= {valve.label: valve_answer(valve, estimates) for valve in valves}
    if friction is not None:
        answer["friction"] = friction_answer(friction)
    return answer


def _leaks(study: Study, model: Model, estimates: list[Estimate]) -> dict[str, Any]:
    """Return what the answer says of leaks, in the units of the trade, and what an area takes for granted of heat."""
    lost = [asdict(one) for one in losses(study.experiments, study.rig)]
    flows = [
        asdict(one) | {"unit": TRADE}
        for one in leak_flows(model, study.experiments, volume_known=not _per_volume(study))
    ]
    leaking = {f"{e.name}.area" for e in model.effects if any(port.startswith("leak_") for port in e.ports)}
    simulated = any("heat" in e.ports for e in model.effects)
    mine = [e for e in estimates if e.name in leaking and not simulated]
    exponent, kappa = model.base()["rig.polytropic_exponent"], study.rig.heat_capacity_ratio
    areas = [
        {
            "name": e.name,
            "unit": e.unit,
            "exponent": exponent,
            "isothermal": e.value * exponent,
            "adiabatic": e.value * exponent / kappa,
        }
        for e in mine
    ]
    return {"leaks": {"lost": lost, "flows": flows, "areas": areas}} if lost or flows else {}
