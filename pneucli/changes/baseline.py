"""The baseline of a fitted model for later comparisons: its parameters, and the influence of each block of data on
them.

All recordings are fitted together, held out or not. A later comparison asks whether the same model fits other
recordings with the same parameters, not whether the model is correct.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pneucli.arrays import Array
from pneucli.identify.estimation.blocks import group_scores
from pneucli.identify.estimation.fit import Fit, fit
from pneucli.identify.estimation.least_squares import pseudo_inverse
from pneucli.identify.estimation.model_fit import free_parameters
from pneucli.identify.estimation.objective import LeastSquaresProblem
from pneucli.identify.estimation.parameters import null_value
from pneucli.identify.estimation.score_test import initial_guesses, residual_changes
from pneucli.identify.residuals import ResidualModel
from pneucli.physics.declaration import Effect
from pneucli.physics.scales import RigQuantities
from pneucli.simulate.model import Model
from pneucli.simulate.rig_quantities import rig_quantities

MIN_RELATIVE_POWER = 1e-6  # of a signature: the model's parameters span an effect with less orthogonal power


@dataclass(frozen=True)
class Coordinate:
    """One parameter as it is compared: its value, or the logarithm of it."""

    name: str
    unit: str
    value: float
    logarithmic: bool
    at_bound: bool

    @property
    def transformed(self) -> float:
        """The value or its logarithm."""
        return float(np.log(self.value)) if self.logarithmic else self.value

    def with_transformed(self, transformed: float) -> Coordinate:
        """Return the parameter at another value or logarithm."""
        return replace(self, value=float(np.exp(transformed)) if self.logarithmic else transformed)


@dataclass(frozen=True)
class TypicalEffect:
    """An effect at typical values (by EFFECT.PARAMETER), which a step of 1 turns on.

    ``one_sided``: its null is a bound, so that a negative step has no meaning.
    """

    effect: str
    values: Mapping[str, float]
    one_sided: bool = False


@dataclass(frozen=True)
class Baseline:
    """A fit in its coordinates (k,), and absent effects at typical values (m,).

    ``influence`` (B, k): the influence of each of B blocks of data on the estimates; ``white_noise_covariance`` (k, k):
    their covariance for white residuals. ``steps`` (m,): the linear estimate of each effect's step, ``step_influence``
    (B, m) the influence of each block on it, ``power`` (m,): the inverse of its variance for white residuals, ``bias``
    (k, m): the change of the estimates that a step causes if it is not modelled. ``levels`` (B,): the logarithm of each
    block's mean squared residual in units of noise. ``gram`` (m, m): the inner products of the effects' changes of the
    residual, where known. Not stored: ``step_cross_influence`` (m, B, k), the change of ``influence`` by a step, and
    ``block_power_share`` (B, m), the share of each block in the power.
    """

    coordinates: tuple[Coordinate, ...]
    typical_effects: tuple[TypicalEffect, ...]
    influence: Array
    white_noise_covariance: Array
    steps: Array
    step_influence: Array
    power: Array
    bias: Array
    levels: Array
    gram: Array | None = None
    step_cross_influence: Array | None = None
    block_power_share: Array | None = None

    @property
    def estimates(self) -> Array:
        """The estimates (k,)."""
        return np.array([c.transformed for c in self.coordinates])

    def restricted_to(self, names: Sequence[str], typical_effects: Sequence[TypicalEffect]) -> Baseline:
        """Return the baseline with these coordinates and effects only; the others are free."""
        k = [[c.name for c in self.coordinates].index(n) for n in names]
        m = [self.typical_effects.index(s) for s in typical_effects]
        return replace(
            self,
            coordinates=tuple(self.coordinates[i] for i in k),
            typical_effects=tuple(typical_effects),
            influence=self.influence[:, k],
            white_noise_covariance=self.white_noise_covariance[np.ix_(k, k)],
            steps=self.steps[m],
            step_influence=self.step_influence[:, m],
            power=self.power[m],
            bias=self.bias[np.ix_(k, m)],
            step_cross_influence=None
            if self.step_cross_influence is None
            else self.step_cross_influence[np.ix_(m, range(len(self.step_cross_influence[0])), k)]
            if m
            else None,
            gram=None if self.gram is None else self.gram[np.ix_(m, m)],
            block_power_share=None if self.block_power_share is None else self.block_power_share[:, m],
        )

    def with_effect_free(self, i: int) -> Baseline:
        """Return the baseline with one effect added as a free parameter, to first order."""
        if self.gram is None or self.power[i] <= 0.0:
            return self
        projection = self.gram[i] / self.gram[i, i]
        gram = self.gram - np.outer(projection, self.gram[i])
        power = np.where(np.diag(gram) > MIN_RELATIVE_POWER * self.power, np.diag(gram), 0.0)
        inverse_power = np.divide(1.0, power, out=np.zeros_like(power), where=power > 0.0)
        scores, by_block = self.power * self.steps, self.power * self.step_influence
        bias, estimates = self.bias[:, i], self.estimates - self.bias[:, i] * self.steps[i]
        return replace(
            self,
            coordinates=tuple(c.with_transformed(float(p)) for c, p in zip(self.coordinates, estimates, strict=True)),
            influence=self.influence - np.outer(self.step_influence[:, i], bias),
            white_noise_covariance=self.white_noise_covariance + np.outer(bias, bias) / self.power[i],
            steps=(scores - projection * scores[i]) * inverse_power,
            step_influence=(by_block - np.outer(by_block[:, i], projection)) * inverse_power,
            power=power,
            bias=self.bias - np.outer(bias, projection),
            gram=gram,
            step_cross_influence=None,
            block_power_share=None,
        )


def align(old: Baseline, new: Baseline) -> tuple[Baseline, Baseline]:
    """Return both baselines with their common coordinates and effects, in the order of the old one."""
    names = [c.name for c in old.coordinates if c.name in {n.name for n in new.coordinates}]
    typical_effects = [s for s in old.typical_effects if s in new.typical_effects]
    return old.restricted_to(names, typical_effects), new.restricted_to(names, typical_effects)


def fit_baseline(
    model: Model,
    residual_models: Sequence[ResidualModel],
    effects: Iterable[Effect],
    typical_effects: Sequence[TypicalEffect] | None = None,
) -> tuple[Fit, Baseline]:
    """Fit a model to all data; return the fit and its baseline.

    ``effects`` are those that it lacks. They are at their typical values, or at the ``typical_effects`` of another
    baseline, so that both are comparable.
    """
    fitted = fit(model, residual_models, free_parameters(model, residual_models))
    return fitted, baseline_at_fit(fitted, residual_models, effects, typical_effects)


def baseline_at_fit(
    fitted: Fit,
    residual_models: Sequence[ResidualModel],
    effects: Iterable[Effect],
    typical_effects: Sequence[TypicalEffect] | None = None,
) -> Baseline:
    """Return the baseline of a fit, see :func:`fit_baseline`."""
    inverse_hessian, scale = _inverse_hessian(fitted, residual_models), _scales(fitted)
    absent = {e.name: e for e in effects}
    typical_list = (
        list(_typical_effects(absent, fitted, residual_models))
        if typical_effects is None
        else [s for s in typical_effects if s.effect in absent]
    )
    set_valued = [absent[typical.effect].is_set_valued for typical in typical_list]
    projected, rows = np.zeros((len(typical_list), fitted.residual.size), dtype=np.float32), []
    for i, (change, is_set_valued) in enumerate(
        zip(_residual_changes(typical_list, absent, fitted, residual_models), set_valued, strict=True)
    ):
        row, projected[i] = _effect_step(fitted, inverse_hessian, change, has_scatter=not is_set_valued)
        rows.append(row)
    power, steps, step_influence, bias, cross, share = zip(*rows, strict=True) if rows else ((),) * 6
    count, k = int(fitted.blocks.max()) + 1, len(fitted.free)
    return Baseline(
        coordinates=tuple(_coordinate(fitted, name.name, name.unit, name.logarithmic) for name in fitted.free),
        typical_effects=tuple(typical_list),
        influence=-group_scores(fitted.jacobian, fitted.residual, fitted.blocks) @ inverse_hessian * scale,
        white_noise_covariance=inverse_hessian * np.outer(scale, scale),
        steps=np.array(steps, dtype=np.float64),
        step_influence=np.array(step_influence).reshape(len(rows), count).T,
        power=np.array(power, dtype=np.float64),
        bias=np.array(bias).reshape(len(rows), k).T * scale[:, None],
        levels=_levels(fitted),
        gram=np.asarray(projected @ projected.T, dtype=np.float64),
        step_cross_influence=np.array(cross).reshape(len(rows), count, k) * scale,
        block_power_share=np.array(share).reshape(len(rows), count).T,
    )


def _inverse_hessian(fitted: Fit, residual_models: Sequence[ResidualModel]) -> Array:
    """Return the inverse of the Gauss-Newton Hessian of data and prior (k, k)."""
    problem = LeastSquaresProblem(fitted.model, residual_models, fitted.free, fitted.initial_state_sensitivities)
    z = np.array([f.to_coordinate(fitted[f.name].value) for f in fitted.free])
    prior = problem.prior_jacobian(z)
    return pseudo_inverse(fitted.curvature + prior.T @ prior)


def _scales(fitted: Fit) -> Array:
    """Return d coordinate / d (the fit's coordinate), shape (k,)."""
    return np.array([1.0 if f.logarithmic else f.scale for f in fitted.free])


def _coordinate(fitted: Fit, name: str, unit: str, logarithmic: bool) -> Coordinate:
    estimate = fitted[name]
    return Coordinate(name, unit, estimate.value, logarithmic, estimate.at_bound)


def _typical_effects(
    effects: Mapping[str, Effect], fitted: Fit, residual_models: Sequence[ResidualModel]
) -> Iterable[TypicalEffect]:
    rig: RigQuantities = rig_quantities(fitted.model, [v.experiment for v in residual_models])
    for name, effect in effects.items():
        declared = effect.in_model_with(fitted.model.effects)
        with_null = [p for p in declared.main_parameters if p.null is not None]
        one_sided = len(with_null) == 1 and null_value(with_null[0], fitted.model) == with_null[0].range_on(rig).lower
        yield from (
            TypicalEffect(name, values, one_sided) for values in initial_guesses(effect, rig, fitted.model.rig.priors)
        )


def _residual_changes(
    typical_list: Sequence[TypicalEffect],
    effects: Mapping[str, Effect],
    fitted: Fit,
    residual_models: Sequence[ResidualModel],
) -> Iterable[Array]:
    for typical in typical_list:
        change = next(
            iter(residual_changes(effects[typical.effect], fitted, residual_models, [dict(typical.values)])), None
        )
        yield np.zeros(fitted.residual.size) if change is None else change


def _effect_step(
    fitted: Fit, inverse_hessian: Array, change: Array, *, has_scatter: bool
) -> tuple[tuple[Any, ...], Array]:
    """Return an effect's power, step, block influence (B,), bias (k,), cross influence (B, k) and block shares (B,),
    and its change of the residual (N,) orthogonal to the parameters.

    A set-valued law (``has_scatter`` false) takes noise out within its bounds, so that its cross influence is unknown.
    """
    count = int(fitted.blocks.max()) + 1
    change = np.where(np.isfinite(change), change, 0.0)
    bias = inverse_hessian @ (fitted.jacobian.T @ change)
    orthogonal = change - fitted.jacobian @ bias
    power = float(orthogonal @ orthogonal)
    if power <= MIN_RELATIVE_POWER * float(change @ change):
        zeros = 0.0, 0.0, np.zeros(count), np.zeros(bias.size), np.zeros((count, bias.size)), np.zeros(count)
        return zeros, np.zeros(change.size)
    cross = -group_scores(fitted.jacobian, orthogonal, fitted.blocks) @ inverse_hessian
    share = np.bincount(fitted.blocks, weights=orthogonal**2, minlength=count) / power
    block_scores = np.bincount(fitted.blocks, weights=orthogonal * fitted.residual, minlength=count)
    scatter = (cross, share) if has_scatter else (np.zeros_like(cross), np.zeros_like(share))
    return (power, -float(block_scores.sum()) / power, -block_scores / power, bias, *scatter), orthogonal


def _levels(fitted: Fit) -> Array:
    """Return the logarithm of each block's mean square (B,), NaN without residuals that count."""
    count = np.bincount(fitted.blocks, weights=fitted.residual != 0.0)
    squares = np.bincount(fitted.blocks, weights=fitted.residual**2)
    return np.log(np.where(count > 0.0, squares, np.nan) / np.maximum(count, 1.0))
