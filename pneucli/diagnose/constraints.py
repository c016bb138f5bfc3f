"""Hard constraints: an effect that violates one is neither named nor suggested, however probable it is.

Each constraint has one reason. They hold in the model with all effects that are to be named: an estimate says little
while another effect is missing.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from pneucli.diagnose.candidate import Candidate, Reason
from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.evidence import score_gain
from pneucli.diagnose.free_run_error import held_out_error
from pneucli.diagnose.score import FittedModel
from pneucli.diagnose.validity import (
    below_resolution,
    end_locations,
    has_unmeasured_force,
    refuted_by_reading,
)
from pneucli.distributions import chi_square_tail
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.parameters import absent_value
from pneucli.physics.declaration import Effect, Parameter

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
