"""The correlation of the fitted parameters, and the sensitivity of each channel to each parameter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.estimation.fit import Fit
from pneucli.identify.residuals import ResidualModel

Array = NDArray[np.float64]

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
        The correlation, shape (k, k), in the order of ``fitted.estimates``.

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
