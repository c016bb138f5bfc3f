"""Hard constraints: an effect that violates one, or whose fit is no finding, is neither named nor suggested.

Each constraint has one reason. They hold in the model with all effects that are to be named: an estimate says little
while another effect is missing.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np

from pneucli.diagnose.candidate import Candidate, Reason
from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.evidence import score_gain
from pneucli.diagnose.free_run_error import held_out_error
from pneucli.diagnose.score import FittedModel
from pneucli.distributions import chi_square_tail
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.parameters import absent_value
from pneucli.identify.residuals import ForceBalance, ResidualModel
from pneucli.physics.declaration import Effect, Parameter, consists_of_times
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


SIGNIFICANCE = 0.05  # of a test of all parameters at once, as the intervals of each have 95 %
MIN_ERROR_RISE = 1.005  # ratio of free-run errors: the smallest that three digits show

Violation = tuple[bool, Reason]
# reasons of an estimate that is impossible, however much the effect explains, in the order in which they count
IMPOSSIBLE: tuple[Reason, ...] = (
    "vanishes",
    "replaces-base-parameter",
    "at-bound",
    "below-resolution",
    "contradicted-by-reading",
)


def violations_of_estimate(data: DiagnosisData, candidate: Candidate) -> list[Violation]:
    """Return the constraints on the fitted values themselves, in the order in which they count."""
    ends = end_locations(candidate)
    fails = (
        bool(ends) and set(ends) == {"null"},
        bool(candidate.replaces),
        "bound" in ends,
        below_resolution(data.train, candidate),
        refuted_by_reading(candidate.full.model, candidate.effect, data.train),
    )
    return list(zip(fails, IMPOSSIBLE, strict=True))


def violated_constraint(
    data: DiagnosisData, candidate: Candidate, *, distance: float = 0.0, error_may_rise: bool = False
) -> Reason | None:
    """Return the reason why an effect must not be named; None where it may be.

    Args:
        data: The data of the diagnosis.
        candidate: The step to the model with all effects, from the same one without this effect.
        distance: Of the effect from its absence over its standard error. Of several parameters each may be as if the
            effect were absent, and not all at once: a gain that is uncertain because a time constant is.
        error_may_rise: Whether the free-run error may rise: where channels of its own measure the effect, another
            missing effect may have compensated for it.

    Returns:
        The reason of the first violated constraint.
    """
    return next(
        (reason for fails, reason in _violations(data, candidate, distance, error_may_rise=error_may_rise) if fails),
        None,
    )


def _violations(
    data: DiagnosisData, candidate: Candidate, distance: float, *, error_may_rise: bool
) -> Iterator[Violation]:
    """Yield each constraint with its reason, the cheap ones first."""
    effect = candidate.effect
    yield has_unmeasured_force(data.train, effect), "cannot-show"
    yield from violations_of_estimate(data, candidate)
    if has_null(candidate.full.fit, effect):
        count = sum(f.name.startswith(f"{effect.name}.") for f in candidate.full.fit.free)
        shown = count > 1 and chi_square_tail(distance**2, count) < SIGNIFICANCE
        contains = not shown and interval_contains_null(data.with_intervals(candidate.full), effect)
        yield contains, "interval-contains-null"
    else:
        yield not score_gain(candidate.reduced.costs, candidate.full.costs).significant, "not-significant"
    yield not error_may_rise and raises_held_out_error(data, candidate.reduced, candidate.full), "raises-error"


def _parameters_with_null(fitted: Fit, effect: Effect) -> list[tuple[str, Parameter]]:
    """Return the fitted parameters of an effect that have a null in this model, by their full names."""
    names = {e.name for e in fitted.estimates}
    parameters = effect.in_model_with(fitted.model.effects).parameters
    return [(name, p) for p in parameters if p.null is not None and (name := f"{effect.name}.{p.name}") in names]


def has_null(fitted: Fit, effect: Effect) -> bool:
    """Whether values of its parameters make an effect absent; otherwise it is judged on against off."""
    return bool(_parameters_with_null(fitted, effect))


def interval_contains_null(fitted: Fit, effect: Effect) -> bool:
    """Whether the interval of every parameter contains the value at which the effect is absent.

    An infinite null is replaced by the upper bound. Where the null is another fitted parameter, the interval is that of
    their difference.
    """
    upper = {f.name: f.upper for f in fitted.free}
    for name, parameter in _parameters_with_null(fitted, effect):
        absent = absent_value(parameter, fitted.model, upper[name])
        assert absent is not None
        low, high = fitted[name].ci95
        if isinstance(parameter.null, str) and parameter.null in upper:
            half_width = 0.5 * (high - low) * _relative_difference_error(fitted, name, parameter.null)
            low, high = fitted[name].value - half_width, fitted[name].value + half_width
        if not low <= absent <= high:
            return False
    return True


def _relative_difference_error(fitted: Fit, name: str, other: str) -> float:
    """Return the standard error of the difference of two parameters over that of the first."""
    names = [f.name for f in fitted.free]
    i, j = names.index(name), names.index(other)
    contrast = np.zeros(len(names))
    contrast[i] = fitted.free[i].derivative(fitted[name].value)
    own = abs(contrast[i]) * np.sqrt(max(fitted.covariance[i, i], 0.0))
    contrast[j] = -fitted.free[j].derivative(fitted[other].value)
    variance = max(float(contrast @ fitted.covariance @ contrast), 0.0)
    return float(np.sqrt(variance) / own) if own > 0.0 else 1.0


def raises_held_out_error(data: DiagnosisData, reduced: FittedModel, full: FittedModel) -> bool:
    """Return whether the free-run error on held-out recordings is larger with an effect (``full``) than without it.

    It may not rise by more than chance: one held-out recording more or less decides on less. It is that of the fitted
    recordings where none is held out.
    """
    before, after, limit = _errors_of_step(data, reduced, full)
    return after > max(limit, MIN_ERROR_RISE) * before


def raises_error_beyond_noise(data: DiagnosisData, reduced: FittedModel, full: FittedModel) -> bool:
    """Return whether that error rises by more than noise moves it: its square by more than a correct model's varies.

    While other effects are missing or too many, an error far above the noise may rise within chance; beside the effects
    that are named in the end none may.
    """
    before, after, limit = _errors_of_step(data, reduced, full)
    return after**2 > before**2 + max(limit**2 - 1.0, (MIN_ERROR_RISE**2 - 1.0) * before**2)


def _errors_of_step(data: DiagnosisData, reduced: FittedModel, full: FittedModel) -> tuple[float, float, float]:
    """Return the held-out error without an effect and with it, and the limit of a correct model; no rise where one is
    unknown.

    The error with the effect is the geometric mean of those in units of either model, as neither is known to be the
    correct one: noise moves a damped model less, whose smaller error in mm and bar may be more of its own units.
    """
    errors = data.free_run_errors
    if errors is None:
        return 1.0, 1.0, 1.0
    before, after = reduced.model, full.model
    given = held_out_error(errors(before))
    in_same_units, printed = held_out_error(errors(after, before)), held_out_error(errors(after))
    if given is None or in_same_units is None or printed is None:
        return 1.0, 1.0, 1.0
    return given, math.sqrt(in_same_units * printed), held_out_error(errors.limits(after)) or 1.0


def lowers_error(data: DiagnosisData, reduced: FittedModel, full: FittedModel) -> bool:
    """Return whether the free-run error on held-out recordings is smaller with ``full``."""
    before, after, _ = _errors_of_step(data, reduced, full)
    return after < before


def error_ratio(data: DiagnosisData, reduced: FittedModel, full: FittedModel) -> float:
    """Return the error with an effect over that without it, both as ``compare`` prints them; 1 where one is unknown."""
    errors = data.free_run_errors
    if errors is None:
        return 1.0
    before, after = held_out_error(errors(reduced.model)), held_out_error(errors(full.model))
    return after / before if before and after is not None else 1.0
