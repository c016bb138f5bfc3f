"""What follows from the covariance of a fit (docs/method.md): correlations, sensitivities, draws of the parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pneucli.arrays import Array
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.residuals import ResidualModel
from pneucli.simulate.model import parameter_value

DRAWS = 6
SEED = 20261
RELATIVE_CHANGE = 0.01


class Sensitivity(NamedTuple):
    """The rms change of a channel, in units of its noise, where a parameter changes by 1 % of its value."""

    name: str
    channel: str
    times_noise: float


def parameter_correlation(fitted: Fit) -> Array:
    """Compute the correlation of the fitted parameters.

    The correlation comes from the curvature of the data at the end of the fit. It leaves out priors and the scatter of
    blocks, which the intervals contain as well. A parameter that changes no residual has correlation 0 with all others.

    Args:
        fitted: The fit.

    Returns:
        The correlation, dimensionless, shape (k, k), in the order of ``fitted.estimates``.

    """
    deviation = np.sqrt(np.maximum(np.diag(fitted.inverse_hessian), 0.0))
    scale = np.where(deviation > 0.0, deviation, np.inf)
    correlation = fitted.inverse_hessian / scale[:, None] / scale
    np.fill_diagonal(correlation, 1.0)
    return np.clip(correlation, -1.0, 1.0)


def sensitivities(fitted: Fit, residual_models: Sequence[ResidualModel]) -> list[Sensitivity]:
    """Compute the sensitivity of each channel to each parameter.

    The derivatives are those of the residual models at the end of the fit: one subsystem at a time, the rest fed with
    measurements. A parameter of value 0 has no sensitivity.

    Args:
        fitted: The fit.
        residual_models: The residual models it was fitted to.

    Returns:
        One entry for each parameter and each channel that it changes.

    """
    power = np.zeros((len(fitted.free), 0))
    channels: list[str] = []
    counts: list[int] = []
    first = 0
    for residual_model in residual_models:
        size = residual_model.experiment.time.size
        for channel in residual_model.channels:
            if channel not in channels:
                channels.append(channel)
                counts.append(0)
                power = np.pad(power, ((0, 0), (0, 1)))
            column = channels.index(channel)
            part = fitted.jacobian[first : first + size]
            power[:, column] += np.einsum("ij,ij->j", part, part)  # without a copy: it is large
            counts[column] += size
            first += size
    steps = [
        RELATIVE_CHANGE * abs(e.value) / f.derivative(e.value)
        for f, e in zip(fitted.free, fitted.estimates, strict=True)
    ]
    rms = np.sqrt(power / np.maximum(counts, 1)) * np.abs(np.array(steps))[:, None]
    return [
        Sensitivity(f.name, channel, float(rms[j, c]))
        for j, f in enumerate(fitted.free)
        for c, channel in enumerate(channels)
        if rms[j, c] > 0.0
    ]


def draw_parameters(fitted: Fit, draws: int = DRAWS, seed: int = SEED) -> list[dict[str, float]]:
    """Draw parameters as uncertain as sensor noise leaves them, kept within their bounds.

    The distribution is that of a correct model: of the inverse curvature of the data, which the residuals of a wrong
    model do not widen. They would excuse themselves.

    Args:
        fitted: The fit, with its derivatives.
        draws: Number of draws.
        seed: Seed of the generator.

    Returns:
        For each draw the value of every free parameter by name, in its own unit. Parameters that no residual depends
        on may be anything between their bounds, as recordings that were not fitted may show.
    """
    z = np.array([f.to_coordinate(parameter_value(fitted.model, f.name)) for f in fitted.free])
    low = np.array([f.to_coordinate(f.lower) for f in fitted.free])
    high = np.array([f.to_coordinate(f.upper) for f in fitted.free])
    covariance = fitted.inverse_hessian
    deviation = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    scale = np.where(deviation > 0.0, deviation, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    root = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    rng = np.random.default_rng(seed)
    steps = rng.standard_normal((draws, z.size)) @ root.T
    drawn = np.clip(z + steps, np.minimum(low, z), np.maximum(high, z))
    is_open = (deviation == 0.0) & np.isfinite(low) & np.isfinite(high)
    drawn[:, is_open] = rng.uniform(low[is_open], high[is_open], (draws, np.count_nonzero(is_open)))
    return [{f.name: f.from_coordinate(c) for f, c in zip(fitted.free, row, strict=True)} for row in drawn.tolist()]
