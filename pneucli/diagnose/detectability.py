"""The minimum detectable size of each effect: an absent effect differs from an undetectable one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from pneucli.diagnose.candidate import Decision
from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.score import FittedModel
from pneucli.identify.estimation.parameters import null_value
from pneucli.identify.estimation.score_test import ScoreTest
from pneucli.physics.declaration import Effect, Parameter

MDE_SIGMA = 4.0  # standard errors: detected in 80 of 100 data sets at a level of 5 % for the catalogue


@dataclass(frozen=True)
class MinimumDetectableEffect:
    """The size of an effect's leading parameter from which it is detectable, in the parameter's unit.

    ``size`` is inf where no plausible size is detectable; ``typical``: a typical size is. ``where`` has the values of
    the parameters without a null, which say where, when or how fast the effect acts; other values have another
    detectable size.
    """

    effect: Effect
    parameter: Parameter
    size: float
    plausible: bool
    typical: bool
    where: Mapping[Parameter, float] = field(default_factory=dict)


def minimum_detectable_effects(
    data: DiagnosisData, fitted: FittedModel, *, complete: bool = True
) -> list[MinimumDetectableEffect]:
    """Return the minimum detectable size of every observable effect that the model lacks.

    Where more than noise is left (not ``complete``) the standard errors are larger by as much as model error widens
    the intervals of the fitted parameters: a named effect has to stand beyond these.
    """
    absent = data.absent_effects(fitted.model)
    tests_by_effect = {e.name: tests for e, tests in data.signatures_of(fitted, absent)}
    sigma = MDE_SIGMA * (1.0 if complete else _error_inflation(data, fitted))
    return [
        _minimum_detectable_effect(effect, tests_by_effect.get(effect.name, []), fitted, sigma) for effect in absent
    ]


def _error_inflation(data: DiagnosisData, fitted: FittedModel) -> float:
    """Return how much model error widens the intervals of a model's parameters: the median ratio, at least 1."""
    by_blocks, of_intervals = data.contrast_variances(fitted, np.eye(len(fitted.fit.covariance)))
    known = (by_blocks > 0.0) & np.isfinite(of_intervals)
    return max(float(np.sqrt(np.median(of_intervals[known] / by_blocks[known]))), 1.0) if known.any() else 1.0


def undetectable_effects(data: DiagnosisData, sizes: Sequence[MinimumDetectableEffect]) -> list[Decision]:
    """Return decisions about effects without a sensitive residual, or without a detectable plausible size."""
    insensitive = [e for e in data.effects.values() if not data.is_observable(e)]
    return [Decision(e, "cannot-show") for e in [*(d.effect for d in sizes if not d.plausible), *insensitive]]


def _minimum_detectable_effect(
    effect: Effect, tests: list[ScoreTest], fitted: FittedModel, sigma: float
) -> MinimumDetectableEffect:
    """Return the detectable size: the typical value nearest to the null, scaled by ``sigma`` standard errors."""
    effect = effect.in_model_with(fitted.model.effects)
    leading = effect.leading_parameter
    name = f"{effect.name}.{leading.name}"
    finite = [s for s in tests if not s.direct and np.isfinite(s.step_error) and s.step_error > 0.0]
    if not finite:
        return MinimumDetectableEffect(effect, leading, np.inf, plausible=False, typical=False)
    best = min(finite, key=lambda s: s.step_error)
    null = null_value(leading, fitted.model)
    where = {
        p: best.values[f"{effect.name}.{p.name}"] for p in effect.main_parameters if p.null is None and p is not leading
    }
    relative_size = sigma * best.step_error
    if null is None:
        detectable = relative_size < 1.0
        return MinimumDetectableEffect(
            effect, leading, best.values[name], plausible=detectable, typical=detectable, where=where
        )
    distance = relative_size * abs(best.values[name] - null)
    return MinimumDetectableEffect(
        effect, leading, distance, plausible=relative_size < 3.0, typical=relative_size < 1.0, where=where
    )
