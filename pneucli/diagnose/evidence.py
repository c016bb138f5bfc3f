"""The evidence for an effect, from its fit alone and from every set of effects that a search has fitted.

All costs are sums of squared residuals in units of noise by block. Residuals are correlated, so blocks count instead of
samples; a block is a segment of one recording that is longer than the correlation time of the residual
(:func:`pneucli.identify.estimation.blocks.block_labels`). One fit gives the gain of the cost by block, Wald tests of
the effect's parameters, and its relative size.

Each set of effects has one number, from which the probability of each effect follows. A channel is one signal of one
balance, over all recordings; its variance v in units of noise is that of the held-out readings where there are any. A
channel that only noise is left in counts with all its readings; one that an unmodelled effect disturbs counts as
``KAPPA``. The log evidence of a set is

    L = -1/2 sum_c R_c mean(log v_c) + sum_e [log PRIOR_ODDS - 2 max(0, -log10 size_e)]

with R_c = 1 / ((1 - rho) / n + rho / KAPPA), rho = 1 - 1 / v of the best set, and the size of an effect over its
typical one, between 0.1 and 1.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import softmax

from pneucli.arrays import Array
from pneucli.distributions import f_tail, student_t_tail
from pneucli.identify.estimation.blocks import group_scores
from pneucli.identify.estimation.fit import Fit, multiplied_level
from pneucli.identify.estimation.least_squares import pseudo_inverse
from pneucli.identify.estimation.objective import LeastSquaresProblem
from pneucli.identify.estimation.parameters import null_value
from pneucli.identify.estimation.score_test import initial_guesses, residual_changes
from pneucli.identify.residuals import ResidualModel
from pneucli.physics.declaration import Effect, Parameter
from pneucli.physics.scales import RigQuantities
from pneucli.simulate.model import Model, parameter_value, without_effect
from pneucli.simulate.rig_quantities import rig_quantities

RESAMPLES = 2000
SEED = 7
TINY = 1e-300


@dataclass(frozen=True)
class ScoreGain:
    """The reduction of a cost over all blocks, its one-sided 95 % lower bound, and the p value of no reduction."""

    total: float
    lower_95: float
    p_value: float

    @property
    def significant(self) -> bool:
        """Whether the lower bound excludes zero."""
        return self.lower_95 > 0.0


def score_gain(before: Array, after: Array) -> ScoreGain:
    """Return the reduction from ``before`` to ``after``, both by block, with a block-bootstrap lower bound.

    The p value is that of :func:`gain_p_value`.
    """
    fall = _reductions(before, after)
    total = float(fall.sum())
    if fall.size < 2 or not np.any(fall):
        return ScoreGain(total, min(total, 0.0), 1.0)
    rng = np.random.default_rng(SEED)
    resampled = fall[rng.integers(fall.size, size=(RESAMPLES, fall.size))].sum(axis=1)
    return ScoreGain(total, float(np.quantile(resampled, 0.05)), gain_p_value(before, after))


def gain_p_value(before: Array, after: Array) -> float:
    """Return the p value of no reduction from ``before`` to ``after``, both by block.

    It is that of a paired t test over the blocks with the effective degrees of freedom (for models that are not nested:
    Vuong's test).
    """
    fall = _reductions(before, after)
    if fall.size < 2 or not np.any(fall):
        return 1.0
    spread = float(np.std(fall, ddof=1) * np.sqrt(fall.size))
    freedom = effective_degrees_of_freedom(fall - fall.mean())
    return float(student_t_tail(float(fall.sum()) / max(spread, TINY), freedom))


def _reductions(before: Array, after: Array) -> Array:
    """Return the reduction by block, without blocks that have no reading and so cost nothing in both."""
    return np.asarray((before - after)[(before != 0.0) | (after != 0.0)])


def effective_degrees_of_freedom(parts: Array) -> float:
    """Return the number of equal normal terms that have the same kurtosis as these: few large terms count as few."""
    largest = float(np.max(np.abs(parts), initial=0.0))
    if not 0.0 < largest < math.inf:
        return 1.0
    squares = (parts / largest) ** 2  # only their ratios count, and powers of large ones have no number
    return float(max(3.0 * squares.sum() ** 2 / (squares**2).sum() - 2.0, 1.0))


@dataclass(frozen=True)
class WaldDistance:
    """The distance of an effect's parameters from their nulls, as a Wald statistic.

    ``squared`` is d^T C^-1 d with the covariance C by blocks, ``parameter_count`` the number of parameters,
    ``degrees_of_freedom`` the effective number of blocks. ``one_sided``: every null is a bound of its parameter.
    """

    squared: float
    parameter_count: int
    degrees_of_freedom: float
    one_sided: bool


def wald_distance(fit: Fit, effect: Effect, residual_models: Sequence[ResidualModel] = ()) -> WaldDistance | None:
    """Return the distance of the effect's fitted values from their nulls; None where it has no null.

    For an infinite null the reciprocal counts. Parameters without a null are held at their values, because they have no
    meaning where the effect is absent (Davies, Biometrika 74, 1987). With effects that make the nulls meaningless, the
    distance is that of a switch at 1 from 0 (:func:`switch_distance`). ``residual_models`` are those of the fit.
    """
    if effect.in_model_with(fit.model.effects) is not effect:
        return switch_distance(fit, effect, residual_models)
    null = null_contrast(fit, effect)
    if null is None:
        return None
    without_null_names = {f"{effect.name}.{p.name}" for p in effect.parameters if p.null is None}
    held = np.array([f.name in without_null_names for f in fit.free])
    influence = fit.jacobian @ (fit.inverse_hessian_holding(held) @ null.contrast.T)
    scored = group_scores(influence, fit.residual, fit.blocks)
    tested = pseudo_inverse(scored.T @ scored) @ null.distance
    return WaldDistance(
        float(null.distance @ tested),
        len(null.distance),
        effective_degrees_of_freedom(scored @ tested),
        one_sided=null.at_bounds,
    )


class NullContrast(NamedTuple):
    """What of an effect is 0 where it is absent: ``distance`` (m,), and its derivatives (m, k) by the coordinates.

    ``at_bounds``: every null is a bound of its parameter.
    """

    distance: Array
    contrast: Array
    at_bounds: bool


def null_contrast(fit: Fit, effect: Effect) -> NullContrast | None:
    """Return the distance of the effect's fitted values from their nulls; None where it has no null.

    It is the reciprocal for an infinite null, and the product for a parameter that multiplies a level: a test of the
    ratio would depend on how uncertain the level is.
    """
    names = [f.name for f in fit.free]
    rows, distance, at_bounds = [], [], True
    for p in effect.parameters:
        name = f"{effect.name}.{p.name}"
        if p.null is None or name not in names:
            continue
        row, value, null = np.zeros(len(names)), parameter_value(fit.model, name), null_value(p, fit.model)
        own = names.index(name)
        level = multiplied_level(fit.free[own], fit.free, fit.model, fit.covariance)
        factor = 1.0 if level is None else level.value
        row[own] = factor if null is not None else -1.0 / value**2
        if level is not None:
            row += value * level.weights
        if isinstance(p.null, str) and p.null in names:
            row[names.index(p.null)] = -1.0
        rows.append(row)
        distance.append(factor * (value - null) if null is not None else 1.0 / value)
        at_bounds &= null is None or p.lower == null
    if not rows:
        return None
    slopes = [f.derivative(parameter_value(fit.model, f.name)) for f in fit.free]
    return NullContrast(np.array(distance), np.array(rows) * slopes, at_bounds)


def residual_change_without(fit: Fit, effect: Effect, residual_models: Sequence[ResidualModel]) -> Array:
    """Return the change of the residuals (N,) when an effect of the model is switched off, all else being held."""
    return _residuals(fit, without_effect(fit.model, effect.name), residual_models) - fit.residual


def _residuals(fit: Fit, model: Model, residual_models: Sequence[ResidualModel]) -> Array:
    problem = LeastSquaresProblem(model, residual_models, (), fit.initial_state_sensitivities)
    return np.asarray(np.concatenate(problem.data_residuals(model)))


MIN_COLLINEARITY = 0.9  # squared cosine: either parameter's variance is ten times that without the other one
RELATIVE_STEP = 1e-3  # of a parameter, for the change that it makes
MAX_CONDITION = 30.0  # of two columns of unit length; above it the data do not determine both


def replaced_base_parameters(fit: Fit, effect: Effect, residual_models: Sequence[ResidualModel]) -> tuple[str, ...]:
    """Return the base parameters that may vanish and in whose place an effect stands.

    They change the residuals as the effect does: alike, or so much alike that the fit with the effect does not need
    them. Where all motion has one direction, a constant force is dry friction, and the data determine only what both
    explain together. No fit with an effect can do without what it multiplies: the effect vanishes with it. Of such a
    parameter that part is compared which the effect does not multiply.

    References:
        D. W. Marquardt, Technometrics 12 (1970) 591-612: variance inflation above 10.
        D. A. Belsley, E. Kuh, R. E. Welsch, Regression Diagnostics (1980), ch. 3: condition index above 30.
    """
    effects = {e.name for e in fit.model.effects}
    base = [j for j, f in enumerate(fit.free) if f.name.partition(".")[0] not in effects and f.lower == 0.0]
    if not base or not len(fit.jacobian):
        return ()
    off, change = without_effect(fit.model, effect.name), residual_change_without(fit, effect, residual_models)
    found, own = list[str](), [f for f in fit.free if f.name.startswith(f"{effect.name}.")]
    multiplied = {name for f in own for name in f.multiplies}
    for j in base:
        name, estimate, acts = fit.free[j].name, fit.estimates[j], fit.jacobian[:, j]
        if name in multiplied:
            larger = off.with_values({name: (1.0 + RELATIVE_STEP) * estimate.value})
            acts = _residuals(fit, larger, residual_models) - fit.residual - change
        squared_cosine = _squared_cosine(acts, change)
        needless = name not in multiplied and squared_cosine > MIN_COLLINEARITY and estimate.ci95[0] <= 0.0
        if needless or _are_alike(math.sqrt(squared_cosine)):
            found.append(name)
    return tuple(found)


def _are_alike(cosine: float) -> bool:
    return 1.0 + cosine > MAX_CONDITION**2 * (1.0 - cosine)


def _squared_cosine(one: Array, other: Array) -> float:
    power = float(one @ one) * float(other @ other)
    return min(float(one @ other) ** 2 / power, 1.0) if 0.0 < power < math.inf else 0.0


def switch_distance(fit: Fit, effect: Effect, residual_models: Sequence[ResidualModel]) -> WaldDistance:
    """Return the distance of an effect that is on from off: that of a switch at 1 from 0.

    The switch moves the residuals in a straight line from those of the fit to those without the effect. The model's
    other parameters adjust; the effect's own are held, because they have no meaning without it. The estimate of the
    switch is 1 where the effect explains the residuals and 0 where they are smaller without it.
    """
    own = np.array([f.name.startswith(f"{effect.name}.") for f in fit.free], dtype=bool)
    change = residual_change_without(fit, effect, residual_models)
    change = fit.project_out_nuisance(change, fit.inverse_hessian_holding(own))
    power = float(change @ change)
    if not np.isfinite(power) or power <= TINY:
        return WaldDistance(0.0, 1, 1.0, one_sided=False)
    scored = np.bincount(fit.blocks, weights=change * fit.residual) / power
    switch = max(1.0 + float(scored.sum()), 0.0)  # its estimate on that line
    distance = switch**2 / max(float(scored @ scored), TINY)
    return WaldDistance(distance, 1, effective_degrees_of_freedom(scored), one_sided=False)


def wald_p_value(fit: Fit, effect: Effect, residual_models: Sequence[ResidualModel] = ()) -> float:
    """Return the p value of the effect's fitted values under its nulls; NaN where it has no null.

    It is halved for a single parameter whose null is a bound.
    """
    distance = wald_distance(fit, effect, residual_models)
    if distance is None:
        return float("nan")
    chance = f_tail(distance.squared / distance.parameter_count, distance.parameter_count, distance.degrees_of_freedom)
    return chance / (2.0 if distance.one_sided and distance.parameter_count == 1 else 1.0)


def significance(fit: Fit, effect: Effect, residual_models: Sequence[ResidualModel] = ()) -> float:
    """Return the distance of an effect from its absence over its standard error.

    For an effect without a null it is the first parameter over its standard error. It is 0 where the residuals
    determine none of its parameters, whose intervals are their whole ranges.
    """
    own = {f.name for f in fit.free if f.name.startswith(f"{effect.name}.")}
    if own and own <= fit.undetermined:
        return 0.0
    distance = wald_distance(fit, effect, residual_models)
    if distance is not None:
        return math.sqrt(max(distance.squared, 0.0))
    first = next((e for e in fit.estimates if e.name == f"{effect.name}.{effect.parameters[0].name}"), None)
    return abs(first.value) / max(first.error, TINY) if first is not None else 0.0


def holm_adjusted(p_values: Sequence[float], hypotheses: int) -> list[float]:
    """Return p values adjusted for a family of ``hypotheses``, of which these are the smallest (S. Holm, 1979)."""
    order = np.argsort(p_values, kind="stable")
    adjusted = np.empty(len(p_values))
    adjusted[order] = np.maximum.accumulate(np.asarray(p_values)[order] * (hypotheses - np.arange(len(p_values))))
    return [float(p) for p in np.minimum(adjusted, 1.0)]


def relative_effect_sizes(fit: Fit, names: Sequence[str], residual_models: Sequence[ResidualModel]) -> dict[str, float]:
    """Return the sizes of some effects of a fitted model over their typical ones."""
    rig = rig_quantities(fit.model, [m.experiment for m in residual_models])
    effects = [e for e in fit.model.effects if e.name in names]
    return {e.name: relative_effect_size(fit, e, rig, residual_models) for e in effects}


def relative_effect_size(
    fit: Fit, effect: Effect, rig: RigQuantities, residual_models: Sequence[ResidualModel] = ()
) -> float:
    """Return the distance of an effect from its null over the typical distance on this rig.

    The typical distance is the geometric mean of those of the typical values, because rigs differ in size by factors.
    The largest ratio of several parameters counts; for an effect without a null the result is 1. With effects that make
    the nulls meaningless, the change of the residuals is the distance (``residual_models`` are those of the fit).
    """
    if effect.in_model_with(fit.model.effects) is not effect:
        return _relative_residual_change(fit, effect, rig, residual_models)
    fitted = {e.name for e in fit.estimates}
    parameters = [p for p in effect.parameters if p.null is not None and f"{effect.name}.{p.name}" in fitted]
    return max((_relative_parameter_size(fit, effect, p, rig) for p in parameters), default=1.0)


def _relative_residual_change(
    fit: Fit, effect: Effect, rig: RigQuantities, residual_models: Sequence[ResidualModel]
) -> float:
    """Return the change of the residuals by an effect over that by its typical values."""
    off = residual_change_without(fit, effect, residual_models)
    typical = initial_guesses(effect, rig, fit.model.rig.priors)
    sizes = [float(np.linalg.norm(on - off)) for on in residual_changes(effect, fit, residual_models, typical)]
    sizes = [size for size in sizes if size > 0.0 and math.isfinite(size)]
    return float(np.linalg.norm(off)) / _geometric_mean(sizes) if sizes else 1.0


def _relative_parameter_size(fit: Fit, effect: Effect, parameter: Parameter, rig: RigQuantities) -> float:
    """Return the ratio for one parameter; for an infinite null that of the reciprocals."""
    null, typical = null_value(parameter, fit.model), parameter.range_on(rig).typical
    value = parameter_value(fit.model, f"{effect.name}.{parameter.name}")
    if null is None:
        return _geometric_mean(typical) / max(abs(value), TINY) if typical else 1.0
    distances = [abs(v - null) for v in typical if v != null]
    return abs(value - null) / _geometric_mean(distances) if distances else 1.0


def _geometric_mean(values: Sequence[float]) -> float:
    return math.exp(math.fsum(map(math.log, values)) / len(values))


# calibrated on fits of 27 cases of the exam and of two virtual rigs, the same with each world left out
KAPPA = 8.0  # independent readings that a disturbed channel is worth
PRIOR_ODDS = 0.02  # of an effect
MIN_DISTURBED_SHARE = 0.05  # of a channel's variance: a noise that is known to 3 % is no more exact
MIN_SIZE = 0.1  # of the typical size, below which a smaller one is no less probable
MAX_ROUNDS = 8  # in which the variances of the best set settle


@dataclass(frozen=True)
class VisitedSet:
    """A fitted set of effects beside those of the given model.

    ``channels`` has by balance and signal the number of readings and the sum of their log variances, ``sizes`` the
    size of every effect over its typical size, ``cost`` the sum of squares over the number of readings.
    """

    effects: tuple[str, ...]
    channels: Mapping[str, tuple[float, float]]
    sizes: Mapping[str, float]
    cost: float


@dataclass(frozen=True)
class SetProbability:
    """A set, its log evidence over that of the given model, and its share of all."""

    visited: VisitedSet
    log_evidence: float
    probability: float


def set_probabilities(
    visited: Sequence[VisitedSet], kappa: float = KAPPA, prior_odds: float = PRIOR_ODDS
) -> list[SetProbability]:
    """Return the sets with their evidence, the most probable first.

    Args:
        visited: The sets, with the same channels each; the set without effects is that of the given model.
        kappa: Readings that a disturbed channel is worth.
        prior_odds: Prior odds of every effect.

    Returns:
        One entry a set. Of sets that were never fitted nothing is said.
    """
    if not visited:
        return []
    counts = np.array([[n for n, _ in one.channels.values()] for one in visited])
    logs = np.array([[total for _, total in one.channels.values()] for one in visited]) / np.maximum(counts, 1.0)
    priors = np.array([_log_prior(one, prior_odds) for one in visited])
    base = next((i for i, one in enumerate(visited) if not one.effects), 0)
    disturbance = np.exp(logs[base])
    for _ in range(MAX_ROUNDS):
        evidence = -0.5 * np.sum(_readings(counts, disturbance, kappa) * logs, axis=1) + priors
        less = np.minimum(disturbance, np.exp(logs[int(np.argmax(evidence))]))
        if np.allclose(less, disturbance):
            break
        disturbance = less
    shares = softmax(evidence)
    return [
        SetProbability(visited[i], float(evidence[i] - evidence[base]), float(shares[i]))
        for i in np.argsort(-evidence, kind="stable")
    ]


def _log_prior(visited: VisitedSet, odds: float) -> float:
    sizes = [min(max(visited.sizes.get(name, 1.0), MIN_SIZE), 1.0) for name in visited.effects]
    return math.fsum(math.log(odds) + 2.0 * math.log10(size) for size in sizes)


def _readings(counts: Array, disturbance: Array, kappa: float) -> Array:
    """Return the independent readings of each channel (S, C): all where it is noise, ``kappa`` where it is not."""
    share = np.maximum(1.0 - 1.0 / np.maximum(disturbance, 1.0), MIN_DISTURBED_SHARE)
    return np.asarray(1.0 / ((1.0 - share) / np.maximum(counts, 1.0) + share / kappa))
