"""Leave-one-recording-out cross-validation, for data without held-out recordings.

A complete fit for each fold would cost as many fits as there are recordings. Instead each fold takes one Newton step
from the fit of all recordings with its derivatives, which near a minimum gives the parameters without the recording.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pneucli.arrays import Array
from pneucli.identify.estimation.blocks import GroupSums, group_sums
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.objective import LeastSquaresProblem
from pneucli.identify.estimation.parameters import absent_value
from pneucli.identify.residuals import ResidualModel
from pneucli.simulate.model import Model, parameter_value


def folds_of(residual_models: Sequence[ResidualModel]) -> tuple[int, ...]:
    """Return the fold of each residual model, one fold a recording; nothing for a single recording."""
    names = [residual_model.experiment.recording.name for residual_model in residual_models]
    fold_of = {name: i for i, name in enumerate(dict.fromkeys(names))}
    return tuple(fold_of[name] for name in names) if len(fold_of) > 1 else ()


def leave_one_out_models(fit: Fit, residual_models: Sequence[ResidualModel], folds: Sequence[int]) -> list[Model]:
    """Return for each residual model the model fitted without its fold."""
    problem = LeastSquaresProblem(fit.model, residual_models, fit.free, fit.initial_state_sensitivities)
    sizes = [residual_model.experiment.time.size * len(residual_model.channels) for residual_model in residual_models]
    rows = np.repeat(np.asarray(folds), sizes)
    (sums,) = group_sums(fit.jacobian, fit.residual, [rows])
    models = {fold: problem.model_at(parameters_without(fit, problem, sums, fold)) for fold in set(folds)}
    return [models[fold] for fold in folds]


def parameters_without(fit: Fit, problem: LeastSquaresProblem, sums: GroupSums, fold: int) -> Array:
    """Return the fit's coordinates (k,) without a fold, from the scores and curvatures of each.

    Parameters that the remaining recordings do not identify keep their value. An effect's own parameters are shrunk to
    their null by one pseudo-observation of their size.
    """
    z = np.array([f.to_coordinate(parameter_value(fit.model, f.name)) for f in fit.free])
    if not z.size:
        return z
    scores, curvatures = (np.delete(one, fold, axis=0).sum(axis=0) for one in sums)
    prior = problem.prior_jacobian(z)
    sizes = _distances_from_null(fit, z)
    inverse_size = np.divide(1.0, sizes, out=np.zeros_like(sizes), where=sizes != 0.0)
    gradient = scores + prior.T @ problem.prior_residuals(z) + inverse_size
    curvature = curvatures + prior.T @ prior + np.diag(inverse_size**2)
    step = np.linalg.pinv(curvature, hermitian=True) @ gradient
    return np.asarray(np.clip(z - step, *problem.bounds()))


def _distances_from_null(fit: Fit, z: Array) -> Array:
    """Return the distance of each parameter of an effect from its null (k,), 0 where it has none."""
    effects = fit.model.effects
    declared = {f"{e.name}.{p.name}": p for e in effects for p in e.in_model_with(effects).parameters}
    nulls = [absent_value(declared[f.name], fit.model, f.upper) if f.name in declared else None for f in fit.free]
    return np.array([0.0 if n is None else c - f.to_coordinate(n) for n, f, c in zip(nulls, fit.free, z, strict=True)])
