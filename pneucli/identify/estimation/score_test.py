"""The score test of an effect: its one-step gain at typical values, other parameters projected out, without a refit.

References:
    Rao, C. R., Proc. Cambridge Phil. Soc. 44 (1948) 50.

"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from pneucli.arrays import Array
from pneucli.identify.estimation.blocks import residual_counts
from pneucli.identify.estimation.direct_starts import direct_guesses
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.objective import LeastSquaresProblem
from pneucli.identify.estimation.parameters import null_value
from pneucli.identify.residuals import ResidualModel
from pneucli.physics.declaration import Effect
from pneucli.physics.scales import RigQuantities
from pneucli.recording import ParameterPrior
from pneucli.simulate.model import Model, with_effect
from pneucli.simulate.rig_quantities import rig_quantities

MIN_POWER_SHARE = 1e-10  # of the squares of a change: what rounding leaves of one that the free parameters reproduce


@dataclass(frozen=True)
class ScoreTest:
    """The predicted gain of an effect at given values.

    ``gain`` is the decrease of the squared cost by a linear ``step`` along the change of the residuals, the other
    parameters adjusting; ``step_error`` is the step's standard error, from the scores of blocks.
    ``direct``: the values are those of a direct fit, and ``gain`` is the decrease of the cost at them.
    """

    values: dict[str, float]
    gain: float
    step: float
    step_error: float
    direct: bool = False


def initial_guesses(
    effect: Effect, quantities: RigQuantities, priors: Mapping[str, ParameterPrior] = MappingProxyType({})
) -> list[dict[str, float]]:
    """Combine the typical values of an effect's parameters into start values.

    Args:
        effect: The effect.
        quantities: The quantities of the rig that scale typical values.
        priors: Values from the pipeline file by EFFECT.PARAMETER; they replace typical values.

    Returns:
        Start values by EFFECT.PARAMETER; none where a scale is unknown. A range ``from`` .. ``to`` is in order.

    """
    stated = [p for p in effect.parameters if not p.refines or f"{effect.name}.{p.name}" in priors]
    names = [f"{effect.name}.{p.name}" for p in stated]
    lists = [
        _typical_values(p.range_on(quantities).typical, priors.get(name)) for p, name in zip(stated, names, strict=True)
    ]
    combinations = [dict(zip(names, values, strict=True)) for values in itertools.product(*lists)]
    stretch = (f"{effect.name}.from", f"{effect.name}.to")
    return [c for c in combinations if stretch[0] not in c or c[stretch[0]] < c[stretch[1]]]


def _typical_values(typical: tuple[float, ...], prior: ParameterPrior | None) -> tuple[float, ...]:
    if prior is None:
        return typical
    stated = prior.start if prior.fixed is None else prior.fixed
    values = typical if stated is None else (stated,)
    return tuple(dict.fromkeys(float(np.clip(value, prior.lower, prior.upper)) for value in values))


def residual_changes(
    effect: Effect, fitted: Fit, residual_models: Sequence[ResidualModel], starts: Sequence[dict[str, float]]
) -> Iterator[Array]:
    """Yield the change of the residuals for each set of the effect's values.

    Only the residual models that are sensitive to the effect are evaluated.

    Args:
        effect: The effect.
        fitted: The fit without it.
        residual_models: The residual models of the fit.
        starts: Values of the effect's parameters.

    Yields:
        The change in units of noise, shape (N,).

    """
    affected = [i for i, residual_model in enumerate(residual_models) if residual_model.is_sensitive_to(effect)]
    sizes = residual_counts(residual_models)
    nominal = np.split(fitted.residual, np.cumsum(sizes)[:-1])
    problem = LeastSquaresProblem(
        fitted.model,
        [residual_models[i] for i in affected],
        (),
        [fitted.initial_state_sensitivities[i] for i in affected],
    )
    for values in starts if affected else ():
        part = problem.data_residuals(with_effect(fitted.model, effect, values))
        parts = [np.zeros(n) for n in sizes]
        for i, residual in zip(affected, part, strict=True):
            parts[i] = residual - nominal[i]
        yield np.concatenate(parts)


def score_tests(effect: Effect, fitted: Fit, residual_models: Sequence[ResidualModel]) -> list[ScoreTest]:
    """Compute the score test of an effect at each of its typical values, and at those of a direct fit.

    Args:
        effect: The effect.
        fitted: The fit without it.
        residual_models: The residual models of the fit.

    Returns:
        The tests, largest gain first; none where no residual model is sensitive to the effect.

    References:
        C. R. Rao, Proc. Cambridge Phil. Soc. 44 (1948) 50-57.
    """
    typical = initial_guesses(
        effect, rig_quantities(fitted.model, [one.experiment for one in residual_models]), fitted.model.rig.priors
    )
    nested = effect.in_model_with(fitted.model.effects).nested
    out = [
        _score_test(values, change, fitted, nested=nested)
        for values, change in zip(typical, residual_changes(effect, fitted, residual_models, typical), strict=False)
    ]
    guesses = direct_guesses(effect, fitted.model, residual_models)
    direct = [_direct_test(values, effect, fitted, residual_models) for values in guesses]
    return sorted([*out, *direct], key=lambda test: -test.gain)


def _direct_test(
    values: dict[str, float], effect: Effect, fitted: Fit, residual_models: Sequence[ResidualModel]
) -> ScoreTest:
    model, target = with_effect(fitted.model, effect, values), fitted.projected_residual
    problem = LeastSquaresProblem(model, residual_models, (), fitted.initial_state_sensitivities)
    gain = float(target @ target) - float(sum(part @ part for part in problem.data_residuals(model)))
    return ScoreTest(values, gain if math.isfinite(gain) else -math.inf, 1.0, math.inf, direct=True)


def _score_test(values: dict[str, float], change: Array, fitted: Fit, *, nested: bool) -> ScoreTest:
    """Return the test of a change of the residuals (N,), from sums over the blocks: no array of N numbers is projected.

    With the part t of the residuals that the free parameters leave, and the change c = n + J a that they reproduce but
    for n: n'n = c'c - a'J'c, and n't = c't, in each block less (J't)'a.
    """
    target, along = fitted.projected_residual, fitted.transposed_product(change)
    absorbed = fitted.inverse_hessian @ along
    power = float(change @ change - along @ absorbed)
    if not np.isfinite(power) or power < MIN_POWER_SHARE * max(float(change @ change), 1e-30):
        return ScoreTest(values, 0.0, 0.0, np.inf)
    by_block = np.bincount(fitted.blocks, weights=change * target) - fitted.projected_scores @ absorbed
    product, error = float(by_block.sum()), float(np.linalg.norm(by_block)) / power
    if not nested:  # it cannot be switched on by degrees
        return ScoreTest(values, -2.0 * product - power, 1.0, error)
    step = -product / power
    return ScoreTest(values, step * step * power, step, error)


def scaled_initial_guess(
    effect: Effect, test: ScoreTest, model: Model, quantities: RigQuantities, step_share: float = 1.0
) -> dict[str, float]:
    """Move the values of a score test from their nulls by a share of the predicted step.

    Args:
        effect: The effect.
        test: Its score test.
        model: The model without the effect.
        quantities: The quantities that scale the effect's range.
        step_share: Share of the predicted step, which is first limited to 0.05 .. 5.

    Returns:
        Start values by EFFECT.PARAMETER; a parameter without a null keeps the tested value.

    """
    if test.direct:
        return dict(test.values)
    step = step_share * float(np.clip(test.step, 0.05, 5.0))
    values = dict(test.values)
    for p in effect.in_model_with(model.effects).parameters:
        name = f"{effect.name}.{p.name}"
        null = null_value(p, model) if name in values else None
        if null is not None:  # steps between the typical values, no further
            size = p.range_on(quantities)
            values[name] = float(np.clip(null + step * (values[name] - null), size.lower, size.upper))
    return values
