"""``identify``: signals -> valve map and inverse, friction models A to F, and the model's parameters."""

from __future__ import annotations

from typing import Any

from pneucli.errors import InputError
from pneucli.identify.effects import fit_model
from pneucli.identify.fit import Estimate, Fit, without_data
from pneucli.identify.friction import FrictionIdentification, identify_friction
from pneucli.identify.null import drifted
from pneucli.identify.paths import Chamber, driven, opening_of
from pneucli.identify.start import STAND_IN_VOLUME, first_guess
from pneucli.identify.valve import ValveIdentification, identify_moving, identify_valve
from pneucli.io.artifacts import write_table
from pneucli.pipeline.context import Context
from pneucli.recording import Rig
from pneucli.simulate.model import Model
from pneucli.stages.friction_tables import friction_answer, write_friction
from pneucli.stages.study import Study, save_model
from pneucli.stages.valve_tables import iso_parameters, valve_answer, valve_warnings, write_valves

AT_BOUND = "{} stands at its bound: these recordings do not show it; leave it out, or record a motion that does"


def run(context: Context) -> dict[str, Any]:
    """Identify whatever the training recordings allow; return the answer that ``--json`` prints.

    Raises InputError where no recording can be used for anything.
    """
    study = Study(context)
    warnings = _null_warnings(study.rig)
    found = _fitted(study)
    context.progress("identifying the valve", 0.5)
    valves = _valves(study, found, warnings)
    study.forget_experiments()
    context.progress("identifying friction", 0.7)
    model, estimates = found.model, [as_ratio(e, study) for e in found.estimates] + _null(study.rig)
    warnings += [AT_BOUND.format(e.name) for e in found.estimates if e.at_bound]
    del found  # its derivatives fill the memory with a long recording
    friction = _friction(study, model, warnings)
    _write(study, model, estimates, valves, friction)
    return _answer(study, estimates, valves, friction, warnings)


def _null(rig: Rig) -> list[Estimate]:
    """Return the null command where it was identified: anywhere in its range it explains the recordings as well."""
    if rig.null_range is None:
        return []
    low, high = rig.null_range
    return [Estimate("valve.null", "V", rig.valve_null, 0.25 * (high - low), (low, high), False)]


def _null_warnings(rig: Rig) -> list[str]:
    """Return what to say where recordings cannot all have the null command that was identified."""
    if (names := drifted(rig)) is None:
        return []
    low, high = (f"{name} ({rig.null_ranges[name][0]:.4g} to {rig.null_ranges[name][1]:.4g} V)" for name in names)
    return [
        f"valve-null-drifts: {low} and {high} have no null command in common; the model has one, "
        f"{rig.valve_null:.4g} V: split the recordings, or find out what moved the spool"
    ]


def _fitted(study: Study) -> Fit:
    """Return the model with its parameters."""
    train = [e for e in study.experiments if e.recording.use == "train"]
    if not train:
        raise InputError(
            f"{study.context.path}, key recordings", "no recording to train on", 'at least one with use = "train"'
        )
    study.context.progress("fitting the model", 0.3)
    guess = first_guess(train, study.rig, study.valve)
    return without_data(fit_model(guess, study.views("train"), study.effects))


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


def as_ratio(estimate: Estimate, study: Study) -> Estimate:
    """Return the estimate, per volume of the vessel where that volume is not known: only the ratio can be told."""
    tested = any(r.kind.vessel for r in study.recordings)
    per_volume = tested and study.rig.vessel_volume is None and not study.rig.has_cylinder
    if not per_volume or not estimate.unit.startswith(("m^2", "m^3", "W/K", "kg")):
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
        "warnings": warnings,
    }
    answer |= {valve.label: valve_answer(valve, estimates) for valve in valves}
    if friction is not None:
        answer["friction"] = friction_answer(friction)
    return answer
