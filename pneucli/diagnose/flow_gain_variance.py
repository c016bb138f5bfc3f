"""The variance of the valve's flow gain in held-out recordings.

A held-out recording at a new command first of all measures the valve's area there, and a valve's gain changes from one
recording to the next. This difference is no evidence about a candidate effect. The flow therefore has a random gain
error in each segment between restarts, one while filling and one while venting, with the variance of highest
likelihood: a model discrepancy in the sense of Kennedy and O'Hagan, JRSS B 63 (2001) 425.
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

MIN_FLOW_ERROR, MAX_FLOW_ERROR = 1e-4, 0.5  # of the flow: the search range of the deviation


def with_flow_gain_errors(
    models: Sequence[Model],
    residual_models: Sequence[ResidualModel],
    residuals: Sequence[ErrorsByChannel],
    initial_state_errors: Sequence[ErrorsByChannel],
) -> list[ErrorsByChannel]:
    """Return the sensitivities to the initial states and those to the flow gain, scaled to its most likely deviation.

    ``residuals`` are measured minus model by channel (n,), SI, not whitened.
    """
    flows = [
        residual_model.flow_gain_sensitivity(model)
        for residual_model, model in zip(residual_models, models, strict=True)
    ]
    parts = [
        _flow_error_projections(*one)
        for one in zip(residual_models, residuals, initial_state_errors, flows, strict=True)
    ]
    deviation = flow_gain_deviation(np.concatenate([np.zeros((2, 0)), *parts], axis=1))
    return [
        {**start, **{c: np.vstack([*start.get(c, ()), deviation * e]) for c, e in flow.items()}} if deviation else start
        for start, flow in zip(initial_state_errors, flows, strict=True)
    ]


def _flow_error_projections(
    residual_model: ResidualModel,
    residual: ErrorsByChannel,
    initial_state_errors: ErrorsByChannel,
    flows: ErrorsByChannel,
) -> Array:
    """Return (2, m): the power of a flow-gain error in each segment, and the residual along it, by principal axis."""
    restarts, parts = residual_model.experiment.restarts, [np.zeros((2, 0))]
    for channel, flow in flows.items():
        start = initial_state_errors.get(channel, np.zeros((0, flow.shape[1])))
        errors = np.array([apply_whitening(error, start, restarts) for error in flow])
        whitened = apply_whitening(residual[channel] / residual_model.noise[channel], start, restarts)
        products = np.array([[np.add.reduceat(a * b, restarts) for a in errors] for b in errors])
        power, axes = np.linalg.eigh(np.moveaxis(products, -1, 0))
        along = np.array([np.add.reduceat(error * whitened, restarts) for error in errors]).T
        parts.append(np.array([power.ravel(), np.einsum("nij,ni->nj", axes, along).ravel()]))
    return np.concatenate(parts, axis=1)


def flow_gain_deviation(parts: Array) -> float:
    """Return the most likely standard deviation of the relative flow-gain error; 0 where none is more likely.

    ``parts`` (2, m) are powers P and residuals along them A: with the variance s^2 the -2 log likelihood changes by
    log(1 + s^2 P) - s^2 A^2 / (1 + s^2 P).
    """
    power, along = parts

    def cost(log_size: float) -> float:
        variance = np.exp(2.0 * log_size)
        return float(np.sum(np.log1p(variance * power) - variance * along**2 / (1.0 + variance * power)))

    minimum = minimize_scalar(cost, bounds=(np.log(MIN_FLOW_ERROR), np.log(MAX_FLOW_ERROR)), method="bounded")
    return float(np.exp(minimum.x)) if minimum.fun < 0.0 else 0.0
