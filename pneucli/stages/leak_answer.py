"""The leaks of shut chambers, and flows over an unknown volume."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Any

from pneucli.identify.estimation.fit import Estimate
from pneucli.identify.guesses.base_model import PLACEHOLDER_VOLUME
from pneucli.identify.leak_rate import FLOW_UNIT, leak_flows, pressure_losses
from pneucli.plausibility.required_inputs import volumes_to_identify
from pneucli.simulate.model import Model
from pneucli.stages.pipeline_data import PipelineData


def only_ratio_identifiable(study: PipelineData) -> bool:
    """Whether vessels of unknown volume are all that gas flows into."""
    unknown = study.rig.vessel_volume is None and "rig.vessel_volume" not in volumes_to_identify(
        study.recordings, study.rig
    )
    return unknown and {r.kind.cylinder for r in study.recordings if r.kind.valve} == {False}


def vessel_scale(name: str, unit: str, study: PipelineData) -> tuple[float, str]:
    """Return the factor and the unit of a parameter's value in answers.

    Where the vessel's volume is unknown, only ratios to it are identifiable: such a value is per volume of the vessel.
    """
    counted = unit.startswith(("m^2", "m^3", "W/K", "kg/")) and not name.startswith("rig.")
    return (1.0 / PLACEHOLDER_VOLUME, f"{unit}/m^3") if counted and only_ratio_identifiable(study) else (1.0, unit)


def per_vessel_volume(estimate: Estimate, study: PipelineData) -> Estimate:
    """Return the estimate, per volume of the vessel where that volume is unknown."""
    factor, unit = vessel_scale(estimate.name, estimate.unit, study)
    low, high = estimate.ci95
    value, error = factor * estimate.value, factor * estimate.error
    return replace(estimate, unit=unit, value=value, error=error, ci95=(factor * low, factor * high))


def leak_answer(study: PipelineData, model: Model, estimates: list[Estimate]) -> dict[str, Any]:
    """Return what the answer says of leaks, in the units of the trade, and what an area takes for granted of heat."""
    lost = [asdict(one) for one in pressure_losses(study.experiments, study.rig)]
    flows = [
        asdict(one) | {"unit": FLOW_UNIT}
        for one in leak_flows(model, study.experiments, volume_known=not only_ratio_identifiable(study))
    ]
    leaking = {f"{e.name}.area" for e in model.effects if any(port.startswith("leak_") for port in e.ports)}
    simulated = any("heat" in e.ports for e in model.effects)
    mine = [e for e in estimates if e.name in leaking and not simulated]
    exponent, kappa = model.base_values()["rig.polytropic_exponent"], study.rig.heat_capacity_ratio
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
