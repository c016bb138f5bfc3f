"""What a fitted model leaves for later comparisons: its parameters, and what each block of data says of them.

All recordings are fitted together, held out or not: what is asked later is not whether the model is right, but whether
the same model fits other recordings with the same parameters.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.estimation.blocks import group_scores
from pneucli.identify.estimation.fit import Fit, fit
from pneucli.identify.estimation.least_squares import pseudo_inverse
from pneucli.identify.estimation.model_fit import free_parameters
from pneucli.identify.estimation.parameters import null_value
from pneucli.identify.estimation.problem import LeastSquaresProblem
from pneucli.identify.estimation.score_test import initial_guesses, residual_changes
from pneucli.identify.residuals import ResidualModel
from pneucli.physics.declaration import Effect
from pneucli.physics.scales import RigQuantities
from pneucli.simulate.model import Model
from pneucli.simulate.rig_quantities import rig_quantities

Array = NDArray[np.float64]

MIN_RELATIVE_POWER = (
    1e-6  # of the power of an effect's signature: less is left of it where the model's parameters do the same
)


@dataclass(frozen=True)
class Coordinate:
    """One parameter of the model as it is compared: its value, or the logarithm of it."""

    name: str
    unit: str
    value: float
    logarithmic: bool
    at_bound: bool

    @property
    def transformed(self) -> float:
        """The coordinate."""
        return float(np.log(self.value)) if self.logarithmic else self.value

    def with_transformed(self, place: float) -> Coordinate:
        """Return the parameter at another place."""
        return replace(self, value=float(np.exp(place)) if self.logarithmic else place)


@dataclass(frozen=True)
class TypicalEffect:
    """An effect at typical values (by EFFECT.PARAMETER), which one step turns on by degrees.

    ``one_sided``: its null is a bound, so that a step below none means nothing.
    """

    effect: str
    values: Mapping[str, float]
    one_sided: bool = False


@dataclass(frozen=True)
class Baseline:
    """A fit in its coordinates (k,), and effects that it lacks, by their starts (m,).

    ``influence`` (B, k): by how much each of B blocks of data moves the estimates; ``white_noise_covariance`` (k, k): their covariance
    were the residuals white. ``steps`` (m,): by how many of its starts each effect is wanted, ``step_influence`` (B, m)
    what each block says of it, ``power`` (m,): the inverse of its variance were the residuals white, ``bias`` (k, m):
    what a step of it, not modelled, does to the estimates. ``levels`` (B,): the logarithm of each block's mean squared
    residual in units of noise. ``gram`` (m, m): the products of the effects' changes of the residual, where known.
    What is not kept for later: ``step_cross_influence`` (m, B, k), by how much a step taken changes what each block adds to
    ``influence``, and ``block_power_share`` (B, m), the part of the power that stands in each block.
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

    def restricted_to(self, names: Sequence[str], starts: Sequence[TypicalEffect]) -> Baseline:
        """Return the reference with these coordinates and starts alone; what is left out is let free."""
        k = [[c.name for c in self.coordinates].index(n) for n in names]
        m = [self.typical_effects.index(s) for s in starts]
        return replace(
            self,
            coordinates=tuple(self.coordinates[i] for i in k),
            typical_effects=tuple(starts),
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
        """Return the reference with the effect of one start in the model, let free, so far as a linear step tells."""
        if self.gram is None or self.power[i] <= 0.0:
            return self
        leans = self.gram[i] / self.gram[i, i]
        gram = self.gram - np.outer(leans, self.gram[i])
        power = np.where(np.diag(gram) > MIN_RELATIVE_POWER * self.power, np.diag(gram), 0.0)
        inverted = np.divide(1.0, power, out=np.zeros_like(power), where=power > 0.0)
        scores, by_block = self.power * self.steps, self.power * self.step_influence
        bias, places = self.bias[:, i], self.estimates - self.bias[:, i] * self.steps[i]
        return replace(
            self,
            coordinates=tuple(c.with_transformed(float(p)) for c, p in zip(self.coordinates, places, strict=True)),
            influence=self.influence - np.outer(self.step_influence[:, i], bias),
            white_noise_covariance=self.white_noise_covariance + np.outer(bias, bias) / self.power[i],
            steps=(scores - leans * scores[i]) * inverted,
            step_influence=(by_block - np.outer(by_block[:, i], leans)) * inverted,
            power=power,
            bias=self.bias - np.outer(bias, leans),
            gram=gram,
            step_cross_influence=None,
            block_power_share=None,
        )


def align(old: Baseline, new: Baseline) -> tuple[Baseline, Baseline]:
    """Return both with the coordinates and starts that both have, in the order of the old one."""
    names = [c.name for c in old.coordinates if c.name in {n.name for n in new.coordinates}]
    starts = [s for s in old.typical_effects if s in new.typical_effects]
    return old.restricted_to(names, starts), new.restricted_to(names, starts)


def fit_baseline(
    model: Model,
    views: Sequence[ResidualModel],
    effects: Iterable[Effect],
    typical_effects: Sequence[TypicalEffect] | None = None,
) -> tuple[Fit, Baseline]:
    """Fit a model to all views; return the fit and what it leaves for comparisons.

    ``effects`` are those that it lacks; they stand at their typical values, or at the ``typical_effects`` starts of another
    reference, so that both can be compared.
    """
    found = fit(model, views, free_parameters(model, views))
    return found, baseline_at_fit(found, views, effects, typical_effects)


def baseline_at_fit(
    found: Fit,
    views: Sequence[ResidualModel],
    effects: Iterable[Effect],
    typical_effects: Sequence[TypicalEffect] | None = None,
) -> Baseline:
    """Return what a fit leaves for comparisons, as :func:`fit_baseline`."""
    bread, scale = _inverse_hessian(found, views), _scales(found)
    lacking = {e.name: e for e in effects}
    asked = (
        list(_typical_effects(lacking, found, views))
        if typical_effects is None
        else [s for s in typical_effects if s.effect in lacking]
    )
    bounded = [lacking[start.effect].is_set_valued for start in asked]
    beyond, rows = np.zeros((len(asked), found.residual.size), dtype=np.float32), []
    for i, (change, only) in enumerate(zip(_residual_changes(asked, lacking, found, views), bounded, strict=True)):
        row, beyond[i] = _effect_step(found, bread, change, known=not only)
        rows.append(row)
    power, steps, step_influence, bias, cross, share = zip(*rows, strict=True) if rows else ((),) * 6
    count, k = int(found.blocks.max()) + 1, len(found.free)
    return Baseline(
        coordinates=tuple(_coordinate(found, name.name, name.unit, name.logarithmic) for name in found.free),
        typical_effects=tuple(asked),
        influence=-group_scores(found.jacobian, found.residual, found.blocks) @ bread * scale,
        white_noise_covariance=bread * np.outer(scale, scale),
        steps=np.array(steps, dtype=np.float64),
        step_influence=np.array(step_influence).reshape(len(rows), count).T,
        power=np.array(power, dtype=np.float64),
        bias=np.array(bias).reshape(len(rows), k).T * scale[:, None],
        levels=_levels(found),
        gram=np.asarray(beyond @ beyond.T, dtype=np.float64),
        step_cross_influence=np.array(cross).reshape(len(rows), count, k) * scale,
        block_power_share=np.array(share).reshape(len(rows), count).T,
    )


def _inverse_hessian(found: Fit, views: Sequence[ResidualModel]) -> Array:
    """Return the inverse of the curvature that data and prior give (k, k)."""
    problem = LeastSquaresProblem(found.model, views, found.free, found.initial_state_sensitivities)
    at = np.array([f.to_coordinate(found[f.name].value) for f in found.free])
    prior = problem.prior_jacobian(at)
    return pseudo_inverse(found.jacobian.T @ found.jacobian + prior.T @ prior)


def _scales(found: Fit) -> Array:
    """Return d coordinate / d (the fit's coordinate), shape (k,)."""
    return np.array([1.0 if f.logarithmic else f.scale for f in found.free])


def _coordinate(found: Fit, name: str, unit: str, logarithmic: bool) -> Coordinate:
    estimate = found[name]
    return Coordinate(name, unit, estimate.value, logarithmic, estimate.at_bound)


def _typical_effects(
    effects: Mapping[str, Effect], found: Fit, views: Sequence[ResidualModel]
) -> Iterable[TypicalEffect]:
    facts: RigQuantities = rig_quantities(found.model, [v.experiment for v in views])
    for name, effect in effects.items():
        declared = effect.in_model_with(found.model.effects)
        alone = [p for p in declared.main_parameters if p.null is not None]
        only = len(alone) == 1 and null_value(alone[0], found.model) == alone[0].range_on(facts).lower
        yield from (
            TypicalEffect(name, values, only) for values in initial_guesses(effect, facts, found.model.rig.priors)
        )


def _residual_changes(
    asked: Sequence[TypicalEffect], effects: Mapping[str, Effect], found: Fit, views: Sequence[ResidualModel]
) -> Iterable[Array]:
    for start in asked:
        change = next(iter(residual_changes(effects[start.effect], found, views, [dict(start.values)])), None)
        yield np.zeros(found.residual.size) if change is None else change


def _effect_step(found: Fit, bread: Array, change: Array, *, known: bool) -> tuple[tuple[Any, ...], Array]:
    """Return of an effect's change of the residual (N,) what the parameters cannot do (N,), and before that its power,
    step, influence of each block (B,), bias (k,), what a step changes of the parameters' influence (B, k), and the
    blocks' shares (B,).

    What it leaves is not ``known`` where it states bounds: within them it takes noise out as well.
    """
    count = int(found.blocks.max()) + 1
    change = np.where(np.isfinite(change), change, 0.0)
    bias = bread @ (found.jacobian.T @ change)
    new = change - found.jacobian @ bias
    power = float(new @ new)
    if power <= MIN_RELATIVE_POWER * float(change @ change):
        none = 0.0, 0.0, np.zeros(count), np.zeros(bias.size), np.zeros((count, bias.size)), np.zeros(count)
        return none, np.zeros(change.size)
    cross = -group_scores(found.jacobian, new, found.blocks) @ bread
    share = np.bincount(found.blocks, weights=new**2, minlength=count) / power
    scored = np.bincount(found.blocks, weights=new * found.residual, minlength=count)
    kept = (cross, share) if known else (np.zeros_like(cross), np.zeros_like(share))
    return (power, -float(scored.sum()) / power, -scored / power, bias, *kept), new


def _levels(found: Fit) -> Array:
    """Return the logarithm of each block's mean square (B,), NaN where nothing in it counts."""
    count = np.bincount(found.blocks, weights=found.residual != 0.0)
    squares = np.bincount(found.blocks, weights=found.residual**2)
    return np.log(np.where(count > 0.0, squares, np.nan) / np.maximum(count, 1.0))
