"""Holding out by turns where no recording is set apart: each one is judged by a model that has not seen it.

Not a fit for each turn, which would cost as many fits as there are recordings, but one Newton step from the fit of all,
with the derivatives that it has left: near a minimum that is what leaving the recording out does to the parameters.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.parameters import absent_value, value_of
from pneucli.identify.estimation.problem import Problem
from pneucli.identify.residuals import View
from pneucli.simulate.model import Model

Array = NDArray[np.float64]


def turns_of(views: Sequence[View]) -> tuple[int, ...]:
    """Return the turn in which each view is held out: one a recording, none where there is but one."""
    names = [view.experiment.recording.name for view in views]
    each = {name: i for i, name in enumerate(dict.fromkeys(names))}
    return tuple(each[name] for name in names) if len(each) > 1 else ()


def models_by_turn(found: Fit, views: Sequence[View], turns: Sequence[int]) -> list[Model]:
    """Return for each view the model as it is fitted without the view's turn."""
    problem = Problem(found.model, views, found.free, found.errors)
    sizes = [view.experiment.time.size * len(view.channels) for view in views]
    rows = np.repeat(np.asarray(turns), sizes)
    models = {turn: problem.model_at(without(found, problem, rows == turn)) for turn in set(turns)}
    return [models[turn] for turn in turns]


def without(found: Fit, problem: Problem, out: NDArray[np.bool_]) -> Array:
    """Return the fit's coordinates (k,) without the residuals that are ``out`` (N,).

    What the others do not tell stays where it is, but an effect of which they tell nothing is absent: its own size,
    one way or the other, counts as one more reading.
    """
    z = np.array([f.inward(value_of(found.model, f.name)) for f in found.free])
    if not z.size:
        return z
    jacobian, known = found.jacobian[~out], problem.prior_jacobian(z)
    sizes = _sizes(found, z)
    own = np.divide(1.0, sizes, out=np.zeros_like(sizes), where=sizes != 0.0)
    gradient = jacobian.T @ found.residual[~out] + known.T @ problem.prior(z) + own
    curvature = jacobian.T @ jacobian + known.T @ known + np.diag(own**2)
    step = np.linalg.pinv(curvature, hermitian=True) @ gradient
    return np.clip(z - step, *problem.bounds())


def _sizes(found: Fit, z: Array) -> Array:
    """Return by how much each parameter of an effect is off the value at which it is absent (k,), 0 without one."""
    declared = {f"{e.name}.{p.name}": p for e in found.model.effects for p in e.parameters}
    absent = [absent_value(declared[f.name], found.model, f.upper) if f.name in declared else None for f in found.free]
    return np.array([0.0 if n is None else c - f.inward(n) for n, f, c in zip(absent, found.free, z, strict=True)])
