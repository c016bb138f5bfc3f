"""The variance of the valve's flow gain in held-out recordings.

A held-out recording at a new command first of all measures the valve's area there, and a valve's gain changes from one
recording to the next. This difference is no evidence about a candidate effect. The flow therefore has a random gain
error in each segment between restarts, one while filling and one while venting, with the variance of highest
likelihood: a model discrepancy in the sense of Kennedy and O'Hagan, JRSS B 63 (2001) 425.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.residuals import ResidualModel
from pneucli.identify.residuals.initial_state import apply_whitening
from pneucli.simulate.model import Model

Array = NDArray[np.float64]
ErrorsByChannel = Mapping[str, Array]  # by channel (k, n), in units of the noise

MIN_FLOW_ERROR, MAX_FLOW_ERROR = 1e-4, 0.5  # of the flow: the search range of the deviation
SEARCH_POINTS, SEARCH_ROUNDS = 33, 5  # of that search: each round narrows the range to 1/16, at last to 1e-5


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
    low, high, sizes, costs = math.log(MIN_FLOW_ERROR), math.log(MAX_FLOW_ERROR), np.zeros(0), np.zeros(0)
    for _ in range(SEARCH_ROUNDS):
        sizes = np.linspace(low, high, SEARCH_POINTS)
        variance = np.exp(2.0 * sizes)[:, None]
        costs = np.sum(np.log1p(variance * power) - variance * along**2 / (1.0 + variance * power), axis=1)
        lowest = int(np.argmin(costs))
        low, high = sizes[max(lowest - 1, 0)], sizes[min(lowest + 1, SEARCH_POINTS - 1)]
    return float(np.exp(sizes[np.argmin(costs)])) if costs.min() < 0.0 else 0.0
