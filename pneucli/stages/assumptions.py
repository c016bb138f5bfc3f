"""The values that identification takes as given, and those that the pipeline file fixes."""

from __future__ import annotations

from pneucli.identify.estimation.fit import Estimate
from pneucli.messages.formatting import format_signal
from pneucli.plausibility.required_inputs import Assumption, assumptions
from pneucli.quantities import axis_parameter_name
from pneucli.recording import Rig
from pneucli.simulate.model import Model, has_parameter, parameter_value
from pneucli.stages.flow_units import flow_unit_assumptions
from pneucli.stages.leak_answer import only_ratio_identifiable
from pneucli.stages.pipeline_data import PipelineData

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
