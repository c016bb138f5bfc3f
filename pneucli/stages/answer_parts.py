"""Parts that the answers of several stages have: parameters, assumptions, leaks, lack of fit, free runs, purpose."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from pneucli.compare.channel_errors import assess_purpose
from pneucli.compare.goodness_of_fit import exceeds_limit
from pneucli.config.stage_tables import Channel
from pneucli.figure import Figure
from pneucli.identify.estimation.fit import Estimate
from pneucli.identify.guesses.base_model import PLACEHOLDER_VOLUME
from pneucli.identify.leak_rate import leak_flows, pressure_losses
from pneucli.identify.valve.uncertainty import DEFAULT_TEMPERATURE, Measurement
from pneucli.messages.compare import ChannelResult, Divergence, Purpose
from pneucli.messages.formatting import format_percent, format_signal
from pneucli.messages.identify import Assumption, LeakArea, Leaks
from pneucli.plausibility.required_inputs import assumptions, volumes_to_identify
from pneucli.quantities import axis_parameter_name
from pneucli.recording import Rig
from pneucli.simulate.model import Model, has_parameter, parameter_value
from pneucli.stages.absent_columns import flow_unit_assumptions
from pneucli.stages.pipeline_data import PipelineData

FREE_RUN_KEYS = ("rmsd", "percent", "ratio_to_noise", "ratio_limit")
PIPELINE_KEYS = {
    "rig.moving_mass": "rig.cylinder.moving_mass",
    "rig.dead_volume_1": "rig.cylinder.dead_volume_1",
    "rig.dead_volume_2": "rig.cylinder.dead_volume_2",
    "rig.vessel_volume": "rig.vessel.volume",
}  # where the pipeline file says what is identified where it does not


def null_command_estimate(rig: Rig) -> list[Estimate]:
    """Return the null command where it was identified: anywhere in its range it explains the recordings as well."""
    if rig.null_range is None:
        return []
    low, high = rig.null_range
    return [Estimate("valve.null", "V", rig.valve_null, 0.25 * (high - low), (low, high), False)]


def fixed_parameters(model: Model) -> list[Estimate]:
    """Return the parameters that the pipeline file fixes: the interval has no width."""
    fixed = {name: k for name, k in model.rig.priors.items() if k.fixed is not None and has_parameter(model, name)}
    return [
        Estimate(name, k.unit, value := parameter_value(model, name), 0.0, (value, value), False)
        for name, k in fixed.items()
    ]


def assumed_values(study: PipelineData, names: set[str]) -> list[Assumption]:
    """Return the values that are assumed because the pipeline file does not state them; ``names`` were fitted."""
    rig, stated = study.rig, study.context.config.document.get("rig", {})
    gas = any(r.kind.valve for r in [*study.recordings, *study.flow_recordings])
    pressed = gas or any("p1" in r or "p2" in r for r in study.recordings)
    found = []
    if pressed and "ambient_pressure" not in stated:
        ambient = format_signal(rig.ambient_pressure, "p1", 5)
        found.append(Assumption(f"ambient pressure is {ambient}", "rig.ambient_pressure"))
    if gas and "gas_temperature" not in stated:
        found.append(
            Assumption(f"the gas has {format_signal(rig.gas_temperature, 'temperature', 6)}", "rig.gas_temperature")
        )
    if (areas := study.context.config.rig.cylinder.effective_area) and rig.piston_area_1:
        off = max(abs(area / rig.piston_area_1 - 1.0) for _, area in areas)
        found.append(
            Assumption(
                "the area on which p1 acts is the mean over the travel; the stated ones differ by up to "
                f"{format_percent(off)}",
                "rig.cylinder.effective_area",
            )
        )
    unstated = {name for name in names & PIPELINE_KEYS.keys() if getattr(rig, name.removeprefix("rig.")) is None}
    keys = {
        axis_parameter_name(name): axis_parameter_name(PIPELINE_KEYS[name])
        for name in PIPELINE_KEYS
        if name in unstated
    }
    instead = [Assumption(f"{name} is not stated and identified", key) for name, key in keys.items()]
    if only_ratio_identifiable(study):
        instead.append(Assumption("areas, volumes and flows are per volume of the vessel", "rig.vessel.volume"))
    found += flow_unit_assumptions(study.context.config)
    return [*found, *assumptions(study.recordings, rig), *instead]


def figures_of(estimates: Sequence[Estimate]) -> dict[str, Figure]:
    """Return the parameters by name; an open end of an interval is not finite."""
    return {e.name: e.figure for e in estimates}


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


def leaks_of(study: PipelineData, model: Model, estimates: list[Estimate]) -> Leaks | None:
    """Return what the answer says of leaks, in the units of the trade, and what an area takes for granted of heat."""
    lost = [*pressure_losses(study.experiments, study.rig)]
    flows = [*leak_flows(model, study.experiments, volume_known=not only_ratio_identifiable(study))]
    leaking = {f"{e.name}.area" for e in model.effects if any(port.startswith("leak_") for port in e.ports)}
    simulated = any("heat" in e.ports for e in model.effects)
    mine = [e for e in estimates if e.name in leaking and not simulated]
    exponent, kappa = model.base_values()["rig.polytropic_exponent"], study.rig.heat_capacity_ratio
    areas = [LeakArea(e.name, e.unit, exponent, e.value * exponent, e.value * exponent / kappa) for e in mine]
    return Leaks(lost, flows, areas) if lost or flows else None


def purpose_of(results: Sequence[ChannelResult], tolerances: Mapping[Channel, float]) -> Purpose | None:
    """Return whether the model serves its user; None where no channel can tell."""
    return assess_purpose(results, {str(channel): limit for channel, limit in tolerances.items()})


def divergences(found: Sequence[ChannelResult]) -> list[Divergence]:
    """Return the channels whose error over the whole recording exceeds its limit, the largest first."""
    beyond = sorted(filter(exceeds_limit, found), key=lambda r: -r.rmsd / max(r.measured_range, r.noise))
    return [Divergence(r.recording, r.channel, r.unit, *(getattr(r, key) for key in FREE_RUN_KEYS)) for r in beyond]


def measurement_of(study: PipelineData) -> Measurement:
    """Return the instruments of a pipeline: ``calibration`` of ``[signals]``, ``sigma`` of the vessel's volume.

    The calibration of ``temperature`` holds for the gas temperature of tests that do not record it, too.
    """
    config = study.context.config
    present = config.signals.present()
    calibrations = config.calibrations
    volume = study.rig.priors.get("rig.vessel_volume")
    temperature = calibrations.get("temperature")
    return Measurement(
        calibrations,
        frozenset(name for name, one in present.items() if one.gauge),
        volume.sigma if volume is not None and math.isfinite(volume.sigma) else None,
        temperature.zero if temperature is not None and temperature.zero else DEFAULT_TEMPERATURE,
    )
