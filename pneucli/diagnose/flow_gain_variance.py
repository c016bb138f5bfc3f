"""The flow through the valve in recordings that were not fitted: by how much it may be another one there.

A recording at a command that no other one has measures the valve's area there before all else, and a valve's gain moves
from one recording to the next. What looks like that says nothing of the effect that is tried. So in each stretch
between restarts the flow has an error of its own while filling and while venting, of which only the variance is known,
the most likely one: a discrepancy of the model in the sense of Kennedy and O'Hagan, JRSS B 63 (2001) 425.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from pneucli.identify.residuals import ResidualModel
from pneucli.identify.residuals.initial_state import apply_whitening
from pneucli.simulate.model import Model

Array = NDArray[np.float64]
ErrorsByChannel = Mapping[str, Array]  # by channel (k, n), in units of the noise

MIN_FLOW_ERROR, MAX_FLOW_ERROR = 1e-4, 0.5  # of the flow, within which its error is sought


def with_flow_gain_errors(
    models: Sequence[Model],
    views: Sequence[ResidualModel],
    residuals: Sequence[ErrorsByChannel],
    initial_state_errors: Sequence[ErrorsByChannel],
) -> list[ErrorsByChannel]:
    """Return the errors of the ``initial_state_errors`` and those of the flow, of the most likely size, of each view by its model.

    ``residuals`` are measured minus model by channel (n,), SI, not whitened.
    """
    flows = [view.flow_gain_sensitivity(model) for view, model in zip(views, models, strict=True)]
    parts = [_flow_error_projections(*one) for one in zip(views, residuals, initial_state_errors, flows, strict=True)]
    size = flow_gain_deviation(np.concatenate([np.zeros((2, 0)), *parts], axis=1))
    return [
        {**known, **{c: np.vstack([*known.get(c, ()), size * e]) for c, e in flow.items()}} if size else known
        for known, flow in zip(initial_state_errors, flows, strict=True)
    ]


def _flow_error_projections(
    view: ResidualModel, residual: ErrorsByChannel, starts: ErrorsByChannel, flows: ErrorsByChannel
) -> Array:
    """Return (2, m): the power of an error of the flow in each stretch, and the residual along it, axis by axis."""
    at, parts = view.experiment.restarts, [np.zeros((2, 0))]
    for channel, flow in flows.items():
        known = starts.get(channel, np.zeros((0, flow.shape[1])))
        errors = np.array([apply_whitening(error, known, at) for error in flow])
        seen = apply_whitening(residual[channel] / view.noise[channel], known, at)
        products = np.array([[np.add.reduceat(a * b, at) for a in errors] for b in errors])
        power, axes = np.linalg.eigh(np.moveaxis(products, -1, 0))
        along = np.array([np.add.reduceat(error * seen, at) for error in errors]).T
        parts.append(np.array([power.ravel(), np.einsum("nij,ni->nj", axes, along).ravel()]))
    return np.concatenate(parts, axis=1)


def flow_gain_deviation(parts: Array) -> float:
    """Return the standard deviation of the flow's error, relative, that is most likely; 0 where none is likelier.

    ``parts`` (2, m) are powers P and residuals along them A: with the variance s^2 the -2 log likelihood changes by
    log(1 + s^2 P) - s^2 A^2 / (1 + s^2 P).
    """
    power, along = parts

    def cost(log_size: float) -> float:
        more = np.exp(2.0 * log_size)
        return float(np.sum(np.log1p(more * power) - more * along**2 / (1.0 + more * power)))

    found = minimize_scalar(cost, bounds=(np.log(MIN_FLOW_ERROR), np.log(MAX_FLOW_ERROR)), method="bounded")
    return float(np.exp(found.x)) if found.fun < 0.0 else 0.0
