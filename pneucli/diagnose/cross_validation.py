"""Holding out by turns where no recording is set apart: each one is judged by a model that has not seen it.

Not a fit for each turn, which would cost as many fits as there are recordings, but one Newton step from the fit of all,
with the derivatives that it has left: near a minimum that is what leaving the recording out does to the parameters.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.parameters import absent_value
from pneucli.identify.estimation.problem import LeastSquaresProblem
from pneucli.identify.residuals import ResidualModel
from pneucli.simulate.model import Model, parameter_value

Array = NDArray[np.float64]


def folds_of(views: Sequence[ResidualModel]) -> tuple[int, ...]:
    """Return the turn in which each view is held out: one a recording, none where there is but one."""
    names = [view.experiment.recording.name for view in views]
    each = {name: i for i, name in enumerate(dict.fromkeys(names))}
    return tuple(each[name] for name in names) if len(each) > 1 else ()


def leave_one_out_models(found: Fit, views: Sequence[ResidualModel], folds: Sequence[int]) -> list[Model]:
    """Return for each view the model as it is fitted without the view's turn."""
    problem = LeastSquaresProblem(found.model, views, found.free, found.initial_state_sensitivities)
    sizes = [view.experiment.time.size * len(view.channels) for view in views]
    rows = np.repeat(np.asarray(folds), sizes)
    models = {turn: problem.model_at(parameters_without(found, problem, rows == turn)) for turn in set(folds)}
    return [models[turn] for turn in folds]


def parameters_without(found: Fit, problem: LeastSquaresProblem, out: NDArray[np.bool_]) -> Array:
    """Return the fit's coordinates (k,) without the residuals that are ``out`` (N,).

    What the others do not tell stays where it is, but an effect of which they tell nothing is absent: its own size,
    one way or the other, counts as one more reading.
    """
    z = np.array([f.to_coordinate(parameter_value(found.model, f.name)) for f in found.free])
    if not z.size:
        return z
    jacobian, known = found.jacobian[~out], problem.prior_jacobian(z)
    sizes = _distances_from_null(found, z)
    own = np.divide(1.0, sizes, out=np.zeros_like(sizes), where=sizes != 0.0)
    gradient = jacobian.T @ found.residual[~out] + known.T @ problem.prior_residuals(z) + own
    curvature = jacobian.T @ jacobian + known.T @ known + np.diag(own**2)
    step = np.linalg.pinv(curvature, hermitian=True) @ gradient
    return np.clip(z - step, *problem.bounds())


def _distances_from_null(found: Fit, z: Array) -> Array:
    """Return by how much each parameter of an effect is off the value at which it is absent (k,), 0 without one."""
    effects = found.model.effects
    declared = {f"{e.name}.{p.name}": p for e in effects for p in e.in_model_with(effects).parameters}
    absent = [absent_value(declared[f.name], found.model, f.upper) if f.name in declared else None for f in found.free]
    return np.array(
        [0.0 if n is None else c - f.to_coordinate(n) for n, f, c in zip(absent, found.free, z, strict=True)]
    )
