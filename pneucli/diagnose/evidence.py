"""What a fall of the residual is worth: blocks of time instead of samples, since residuals are correlated.

All costs are sums of squared residuals in units of noise, block by block; a block is a stretch of one view, longer
than the residual's memory (:func:`pneucli.identify.estimation.blocks.block_numbers`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as fisher
from scipy.stats import t as student

from pneucli.identify.estimation.blocks import group_scores
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.least_squares import pseudo_inverse
from pneucli.identify.estimation.parameters import null_value
from pneucli.identify.estimation.problem import LeastSquaresProblem
from pneucli.identify.estimation.score_test import initial_guesses, residual_changes
from pneucli.identify.residuals import ResidualModel
from pneucli.physics.declaration import Effect, Parameter
from pneucli.physics.scales import RigQuantities
from pneucli.simulate.model import parameter_value

Array = NDArray[np.float64]

RESAMPLES = 2000
SEED = 7
TINY = 1e-300


def block_costs(residual: Array, blocks: NDArray[np.int64]) -> Array:
    """Return the sum of squares of each block."""
    return np.bincount(blocks, weights=residual**2).astype(np.float64)


@dataclass(frozen=True)
class ScoreGain:
    """The fall of a cost over all blocks, its one-sided 95 % lower bound, and the chance that there is none.

    ``effective_blocks`` tells in how many blocks it shows, counted as :func:`effective_degrees_of_freedom` does.
    """

    total: float
    lower_95: float
    p_value: float
    effective_blocks: float

    @property
    def significant(self) -> bool:
        """Whether the lower bound excludes zero."""
        return self.lower_95 > 0.0


def score_gain(before: Array, after: Array) -> ScoreGain:
    """Return how far the cost falls from ``before`` to ``after``, both by block; the interval by block bootstrap.

    The chance is that of a paired t test over the blocks, with as many degrees of freedom as blocks that matter
    (Vuong's test where neither model contains the other).
    """
    fall = before - after
    total = float(fall.sum())
    if fall.size < 2 or not np.any(fall):
        return ScoreGain(total, min(total, 0.0), 1.0, 0.0)
    rng = np.random.default_rng(SEED)
    drawn = fall[rng.integers(fall.size, size=(RESAMPLES, fall.size))].sum(axis=1)
    spread = float(np.std(fall, ddof=1) * np.sqrt(fall.size))
    freedom = effective_degrees_of_freedom(fall - fall.mean())
    p_value = float(student.sf(total / max(spread, TINY), freedom))
    return ScoreGain(total, float(np.quantile(drawn, 0.05)), p_value, freedom)


def effective_degrees_of_freedom(parts: Array) -> float:
    """Return how many equal normal parts vary as much as these do: rare large ones count as few."""
    squares = parts**2
    fourth = float((squares**2).sum())
    return max(3.0 * float(squares.sum()) ** 2 / fourth - 2.0, 1.0) if fourth > 0.0 else 1.0


@dataclass(frozen=True)
class WaldDistance:
    """How far an effect's parameters are from their nulls, and what the noise of blocks makes of that by chance.

    ``squared`` is the distance d^T C^-1 d with the covariance C of blocks, ``parameter_count`` of how many parameters,
    ``degrees_of_freedom`` of how many blocks; ``one_sided``: all nulls are bounds that can be left to one side only.
    """

    squared: float
    parameter_count: int
    degrees_of_freedom: float
    one_sided: bool


def wald_distance(found: Fit, effect: Effect, views: Sequence[ResidualModel] = ()) -> WaldDistance | None:
    """Return the distance of the effect's fitted values from their nulls; None where it has no null.

    Where the null is infinite the reciprocal counts. Parameters without a null are held at their values: where the
    effect is absent they mean nothing (Davies, Biometrika 74, 1987). Beside effects that make the nulls meaningless
    the distance is that of a switch at 1 from 0 (:func:`switch_distance`). ``views`` are those of the fit.
    """
    if effect.in_model_with(found.model.effects) is not effect:
        return switch_distance(found, effect, views)
    held = {f"{effect.name}.{p.name}" for p in effect.parameters if p.null is None}
    free = [f for f in found.free if f.name not in held]
    names = [f.name for f in free]
    rows, away, bounded = [], [], True
    for p in effect.parameters:
        name = f"{effect.name}.{p.name}"
        if name not in names:
            continue
        row, value, null = np.zeros(len(names)), parameter_value(found.model, name), null_value(p, found.model)
        row[names.index(name)] = 1.0 if null is not None else -1.0 / value**2
        if isinstance(p.null, str) and p.null in names:
            row[names.index(p.null)] = -1.0
        rows.append(row)
        away.append(value - null if null is not None else 1.0 / value)
        bounded &= null is None or p.lower == null
    if not rows:
        return None
    contrast = np.array(rows) * [f.derivative(parameter_value(found.model, f.name)) for f in free]
    jacobian = found.jacobian[:, [f.name not in held for f in found.free]]
    influence = jacobian @ (pseudo_inverse(jacobian.T @ jacobian) @ contrast.T)
    scored = group_scores(influence, found.residual, found.blocks)
    from_null = np.array(away)
    tested = pseudo_inverse(scored.T @ scored) @ from_null
    return WaldDistance(float(from_null @ tested), len(away), effective_degrees_of_freedom(scored @ tested), bounded)


def residual_change_without(found: Fit, effect: Effect, views: Sequence[ResidualModel]) -> Array:
    """Return by how much the residuals (N,) change when an effect of the model is switched off, all else being held."""
    off = replace(found.model, effects=tuple(e for e in found.model.effects if e.name != effect.name))
    problem = LeastSquaresProblem(off, views, (), found.initial_state_sensitivities)
    return np.asarray(np.concatenate(problem.data_residuals(off)) - found.residual)


def switch_distance(found: Fit, effect: Effect, views: Sequence[ResidualModel]) -> WaldDistance:
    """Return the distance of an effect that is on from off: that of a switch at 1 from 0.

    The switch moves the residuals in a straight line from those of the fit to those without the effect. The model's
    other parameters adjust, the effect's own are held: without it they mean nothing. The switch stands where the
    residuals want it: at 1 where the effect explains them, at 0 where they are better without.
    """
    own = [f.name.startswith(f"{effect.name}.") for f in found.free]
    others = replace(found, jacobian=found.jacobian[:, np.logical_not(own)])
    change = others.project_out_nuisance(residual_change_without(found, effect, views))
    power = float(change @ change)
    if not np.isfinite(power) or power <= TINY:
        return WaldDistance(0.0, 1, 1.0, one_sided=False)
    scored = np.bincount(found.blocks, weights=change * found.residual) / power
    switch = max(1.0 + float(scored.sum()), 0.0)  # where the residuals want it on that line
    distance = switch**2 / max(float(scored @ scored), TINY)
    return WaldDistance(distance, 1, effective_degrees_of_freedom(scored), one_sided=False)


def wald_p_value(found: Fit, effect: Effect, views: Sequence[ResidualModel] = ()) -> float:
    """Return the chance of the effect's fitted values where its nulls are true; NaN where it has no null.

    A Wald test, halved where the null is a bound that can be left to one side only.
    """
    away = wald_distance(found, effect, views)
    if away is None:
        return float("nan")
    chance = float(fisher.sf(away.squared / away.parameter_count, away.parameter_count, away.degrees_of_freedom))
    return chance / (2.0 if away.one_sided and away.parameter_count == 1 else 1.0)


def significance(found: Fit, effect: Effect, views: Sequence[ResidualModel] = ()) -> float:
    """Return how far an effect is from where it is absent, over its standard error.

    Of an effect that no value makes absent it is its first parameter over its own.
    """
    away = wald_distance(found, effect, views)
    if away is not None:
        return math.sqrt(max(away.squared, 0.0))
    first = next((e for e in found.estimates if e.name == f"{effect.name}.{effect.parameters[0].name}"), None)
    return abs(first.value) / max(first.error, TINY) if first is not None else 0.0


def disagreement(
    found: Fit, effect: Effect, recordings: NDArray[np.int64], views: Sequence[ResidualModel] = ()
) -> float:
    """Return by which share of its size single recordings want the effect changed, as a root mean square.

    ``recordings`` (N,) numbers the recording of each residual; each counts by what it knows of the effect, the other
    parameters adjusting. Near 0 one law holds for all; near 1 what the recordings show is not this effect.
    """
    rest = found.jacobian[:, [not f.name.startswith(f"{effect.name}.") for f in found.free]]
    if effect.in_model_with(found.model.effects) is effect:
        change = found.jacobian @ _offsets_from_null(found, effect, without_null=1.0)
    else:
        change = -residual_change_without(found, effect, views)
    change -= rest @ (pseudo_inverse(rest.T @ rest) @ (rest.T @ change))
    known = np.bincount(recordings, change**2)
    wanted = np.bincount(recordings, change * found.residual)[known > 0.0] / known[known > 0.0]
    return float(np.sqrt(np.average(wanted**2, weights=known[known > 0.0]))) if wanted.size else 0.0


def offset_from_null(found: Fit, effect: Effect) -> Array | None:
    """Return how far the fit's coordinates (k,) are from where an effect is absent; None where no value makes it so."""
    away = _offsets_from_null(found, effect, without_null=0.0)
    return away if np.any(away) and np.all(np.isfinite(away)) else None


def _offsets_from_null(found: Fit, effect: Effect, *, without_null: float) -> Array:
    """Return how far the fit's coordinates (k,) of an effect are from their nulls, those of all others being 0."""
    away = np.zeros(len(found.free))
    for j, f in enumerate(found.free):
        for p in effect.in_model_with(found.model.effects).parameters:
            if f.name == f"{effect.name}.{p.name}":
                null = null_value(p, found.model)
                away[j] = (
                    without_null
                    if null is None
                    else f.to_coordinate(parameter_value(found.model, f.name)) - f.to_coordinate(null)
                )
    return away


def holm_adjusted(p_values: Sequence[float], hypotheses: int) -> list[float]:
    """Return p values adjusted for a family of ``hypotheses``, of which these are the smallest (S. Holm, 1979)."""
    order = np.argsort(p_values, kind="stable")
    adjusted = np.empty(len(p_values))
    adjusted[order] = np.maximum.accumulate(np.asarray(p_values)[order] * (hypotheses - np.arange(len(p_values))))
    return [float(p) for p in np.minimum(adjusted, 1.0)]


def relative_effect_size(
    found: Fit, effect: Effect, facts: RigQuantities, views: Sequence[ResidualModel] = ()
) -> float:
    """Return the distance of an effect from where it is absent over that of usual values, on the rig of these facts.

    Usual is the geometric mean of the typical values' distances: sizes of rigs differ by factors. Of several parameters
    the one that is farthest counts. Of an effect that no value makes absent nothing is said: 1. Beside effects that
    make the nulls meaningless, what it changes in the residuals (``views`` are those of the fit) is the distance.
    """
    if effect.in_model_with(found.model.effects) is not effect:
        return _relative_residual_change(found, effect, facts, views)
    fitted = {e.name for e in found.estimates}
    mine = [p for p in effect.parameters if p.null is not None and f"{effect.name}.{p.name}" in fitted]
    return max((_relative_parameter_size(found, effect, p, facts) for p in mine), default=1.0)


def _relative_residual_change(
    found: Fit, effect: Effect, facts: RigQuantities, views: Sequence[ResidualModel]
) -> float:
    """Return what an effect changes in the residuals over what it would change at usual values."""
    off = residual_change_without(found, effect, views)
    usual = initial_guesses(effect, facts, found.model.rig.priors)
    sizes = [float(np.linalg.norm(change - off)) for change in residual_changes(effect, found, views, usual)]
    sizes = [size for size in sizes if size > 0.0 and math.isfinite(size)]
    return float(np.linalg.norm(off)) / _geometric_mean(sizes) if sizes else 1.0


def _relative_parameter_size(found: Fit, effect: Effect, parameter: Parameter, facts: RigQuantities) -> float:
    """Return the same by one parameter; where its null is infinite the reciprocal is what grows from nothing."""
    null, typical = null_value(parameter, found.model), parameter.range_on(facts).typical
    value = parameter_value(found.model, f"{effect.name}.{parameter.name}")
    if null is None:
        return _geometric_mean(typical) / max(abs(value), TINY) if typical else 1.0
    distances = [abs(one - null) for one in typical if one != null]
    return abs(value - null) / _geometric_mean(distances) if distances else 1.0


def _geometric_mean(values: Sequence[float]) -> float:
    return math.exp(math.fsum(map(math.log, values)) / len(values))
