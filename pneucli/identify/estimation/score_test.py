"""The score test of an effect: what its typical values promise, with the other parameters projected out, without a refit."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.parameters import null_value
from pneucli.identify.estimation.problem import LeastSquaresProblem
from pneucli.identify.residuals import ResidualModel
from pneucli.physics.declaration import Effect
from pneucli.physics.scales import RigQuantities
from pneucli.recording import ParameterPrior
from pneucli.simulate.model import Model, with_effect
from pneucli.simulate.rig_quantities import rig_quantities

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ScoreTest:
    """What switching an effect on at some values promises.

    ``gain`` is the fall of the cost (squared) by a linear ``step`` along what it changes in the residuals, base
    parameters adjusting; ``step_error`` is the step's standard error, from the scores of blocks.
    """

    values: dict[str, float]
    gain: float
    step: float
    step_error: float


def initial_guesses(
    effect: Effect, facts: RigQuantities, priors: Mapping[str, ParameterPrior] = MappingProxyType({})
) -> list[dict[str, float]]:
    """Return every combination of typical values by EFFECT.PARAMETER, from and to in order; none where not known.

    What the pipeline file says of a parameter takes the place of its typical values.
    """
    names = [f"{effect.name}.{p.name}" for p in effect.parameters]
    lists = [
        _typical_values(p.range_on(facts).typical, priors.get(name))
        for p, name in zip(effect.parameters, names, strict=True)
    ]
    combinations = [dict(zip(names, values, strict=True)) for values in itertools.product(*lists)]
    stretch = (f"{effect.name}.from", f"{effect.name}.to")
    return [c for c in combinations if stretch[0] not in c or c[stretch[0]] < c[stretch[1]]]


def _typical_values(typical: tuple[float, ...], known: ParameterPrior | None) -> tuple[float, ...]:
    if known is None:
        return typical
    stated = known.start if known.fixed is None else known.fixed
    values = typical if stated is None else (stated,)
    return tuple(dict.fromkeys(float(np.clip(value, known.lower, known.upper)) for value in values))


def residual_changes(
    effect: Effect, found: Fit, views: Sequence[ResidualModel], starts: Sequence[dict[str, float]]
) -> Iterator[Array]:
    """Yield what each set of the effect's values changes in the residuals (N,); only the views that feel it are run."""
    felt = [i for i, view in enumerate(views) if view.is_sensitive_to(effect)]
    sizes = [view.experiment.time.size * len(view.channels) for view in views]
    nominal = np.split(found.residual, np.cumsum(sizes)[:-1])
    problem = LeastSquaresProblem(
        found.model, [views[i] for i in felt], (), [found.initial_state_sensitivities[i] for i in felt]
    )
    for values in starts if felt else ():
        part = problem.data_residuals(with_effect(found.model, effect, values))
        parts = [np.zeros(n) for n in sizes]
        for i, residual in zip(felt, part, strict=True):
            parts[i] = residual - nominal[i]
        yield np.concatenate(parts)


def score_tests(effect: Effect, found: Fit, views: Sequence[ResidualModel]) -> list[ScoreTest]:
    """Return the effect's signatures at its typical values, best first."""
    typical = initial_guesses(
        effect, rig_quantities(found.model, [v.experiment for v in views]), found.model.rig.priors
    )
    out = [
        _score_test(values, change, found, nested=effect.nested)
        for values, change in zip(typical, residual_changes(effect, found, views, typical), strict=False)
    ]
    return sorted(out, key=lambda s: -s.gain)


def _score_test(values: dict[str, float], change: Array, found: Fit, *, nested: bool) -> ScoreTest:
    target, new = found.projected_residual, found.project_out_nuisance(change)
    power = float(new @ new)
    if not np.isfinite(power) or power < 1e-12 * max(float(change @ change), 1e-30):
        return ScoreTest(values, 0.0, 0.0, np.inf)
    error = float(np.linalg.norm(np.bincount(found.blocks, weights=new * target))) / power
    if not nested:  # it cannot be switched on by degrees
        return ScoreTest(values, float(target @ target - (target + new) @ (target + new)), 1.0, error)
    step = -float(new @ target) / power
    return ScoreTest(values, step * step * power, step, error)


def scaled_initial_guess(
    effect: Effect, test: ScoreTest, model: Model, facts: RigQuantities, step_share: float = 1.0
) -> dict[str, float]:
    """Return the signature's values, those with a null moved by a share of the promised step (within 0.05 to 5)."""
    step = step_share * float(np.clip(test.step, 0.05, 5.0))
    values = dict(test.values)
    for p in effect.parameters:
        name = f"{effect.name}.{p.name}"
        if (null := null_value(p, model)) is not None:  # steps between the typical values, no further
            size = p.range_on(facts)
            values[name] = float(np.clip(null + step * (values[name] - null), size.lower, size.upper))
    return values
