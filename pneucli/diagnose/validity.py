"""Whether a fitted effect is a finding: was it observed, does it end at a bound, does a reading refute it?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from pneucli.diagnose.candidate import Candidate
from pneucli.identify.estimation.parameters import absent_value
from pneucli.identify.residuals import ForceBalance, ResidualModel
from pneucli.physics.declaration import Effect, consists_of_times
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model

SENSOR_PORTS = {"p1": "read_p1", "p2": "read_p2"}
AMBIENT_TOLERANCE = 0.01  # of ambient pressure: the weather moves a pressure that is stated and not measured by as much
MIN_REST_TIME = 0.2  # s, at the lowest level
REST_NOISE_FACTOR = 4.0  # times the sensor's noise, around that level
REFUTATION_FACTOR = 3.0  # times AMBIENT_TOLERANCE: a fault that changes the reading by less is not refuted
MIN_RESOLVED_PERIODS = 0.5  # of a sampling period: the clock or the model's own step may cause a shorter time

EndLocation = Literal["null", "bound", "inside"]


def has_unmeasured_force(residual_models: Sequence[ResidualModel], effect: Effect) -> bool:
    """Whether an effect acts only in force balances of which no reading gives the force of the gas.

    Chamber 2 is shut or driven and p2 was not recorded: its force is missing from the balance, and an effect such as a
    spring would replace it. Without any pressure the model's errors of flow are forces, as those of most effects.
    """
    sensitive = [model for model in residual_models if model.is_sensitive_to(effect)]
    return bool(sensitive) and all(lacks_p2(model) or model.experiment.lacks_pressures for model in sensitive)


def lacks_p2(residual_model: ResidualModel) -> bool:
    """Whether this is a force balance of a piston whose chamber 2 is shut or driven and has no recorded pressure."""
    return type(residual_model) is ForceBalance and residual_model.experiment.p2_is_unmeasured


def end_locations(candidate: Candidate) -> list[EndLocation]:
    """Return where the fit ended for each parameter with a null: at the null, at another bound, or inside.

    Beside some effects a null is none: no value makes the effect absent. There it is a value like others inside.
    """
    model, effect = candidate.full.model, candidate.effect
    upper = {f.name: f.upper for f in candidate.full.fit.free}
    is_absent_at_null = effect.in_model_with(model.effects) is effect
    parameters = {f"{effect.name}.{p.name}": p for p in effect.parameters}
    absent = {name: absent_value(p, model, upper.get(name, math.inf)) for name, p in parameters.items()}
    nulls = {name: value for name, value in absent.items() if value is not None}
    locations = list[EndLocation]()
    for e in candidate.full.fit.estimates:
        if e.name in nulls:
            at_null = bool(np.isclose(e.value, nulls[e.name], rtol=1e-5, atol=0.0))
            inside: EndLocation = "null" if at_null and is_absent_at_null else "inside"
            locations.append("bound" if e.at_bound and not at_null else inside)
    return locations


def at_any_bound(candidate: Candidate) -> bool:
    """Whether any parameter of the effect ended at a bound."""
    return any(e.at_bound and e.name.startswith(f"{candidate.effect.name}.") for e in candidate.full.fit.estimates)


def below_resolution(residual_models: Sequence[ResidualModel], candidate: Candidate) -> bool:
    """Whether the effect consists of times alone, and the sampling cannot distinguish them from zero."""
    period = max(model.experiment.recording.period for model in residual_models)
    effect, values = candidate.effect, candidate.full.model.values
    return consists_of_times(effect) and all(
        abs(values[f"{effect.name}.{p.name}"]) < MIN_RESOLVED_PERIODS * period for p in effect.main_parameters
    )


def refuted_by_reading(model: Model, effect: Effect, residual_models: Sequence[ResidualModel]) -> bool:
    """Whether samples at ambient pressure refute a fault of a pressure sensor that the model contains.

    An example is an offset of -95 mbar, where the sensor reads ambient pressure at rest in the same recordings.
    """
    experiments = {id(one.experiment.recording): one.experiment for one in residual_models}.values()
    return any(
        abs(float(effect.ports[port](ambient, ambient, *model.effect_parameters(effect))) - ambient)  # type: ignore[arg-type]
        > REFUTATION_FACTOR * AMBIENT_TOLERANCE * ambient
        for signal, port in SENSOR_PORTS.items()
        if port in effect.ports
        for ambient in (e.rig.ambient_pressure for e in experiments if rests_at_ambient(e, signal))
    )


def rests_at_ambient(experiment: Experiment, signal: str) -> bool:
    """Whether a pressure rests at its lowest level, and this level reads as ambient pressure.

    The chamber is vented there: an offset of the sensor would shift the level, and no vented chamber is below it.
    """
    recording, ambient = experiment.recording, experiment.rig.ambient_pressure
    if signal not in recording:
        return False
    values = recording[signal][np.isfinite(recording[signal])]
    if not values.size:
        return False
    level = float(np.quantile(values, 0.01))
    noise = experiment.noise[signal].rms if signal in experiment.noise else 0.0
    band = AMBIENT_TOLERANCE * ambient + REST_NOISE_FACTOR * noise
    rest_time = np.count_nonzero(np.abs(values - level) < band) * recording.period
    return bool(abs(level - ambient) < AMBIENT_TOLERANCE * ambient and rest_time > MIN_REST_TIME)
