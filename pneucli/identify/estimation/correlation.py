"""What the data say of parameters together: their correlation, and what a change of each does to each channel."""

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
    """What a change of a parameter by 1 % of its value does to a channel: rms over all samples, times the noise."""

    name: str
    channel: str
    times_noise: float


def parameter_correlation(found: Fit) -> Array:
    """Return the correlation of the fitted parameters (k, k), in the order of ``found.estimates``.

    From the curvature of the data at the end of the fit: what recordings of this kind can tell only together. Priors
    and chance, which the intervals hold as well, are left out. A parameter that does not show has 0 with all others.
    """
    deviation = np.sqrt(np.maximum(np.diag(found.inverse_hessian), 0.0))
    scale = np.where(deviation > 0.0, deviation, np.inf)
    together = found.inverse_hessian / scale[:, None] / scale
    np.fill_diagonal(together, 1.0)
    return np.clip(together, -1.0, 1.0)


def sensitivities(found: Fit, views: Sequence[ResidualModel]) -> list[Sensitivity]:
    """Return what each parameter does to each channel that it changes; one of value 0 has none.

    The derivatives are those of the fit at its end: of one subsystem at a time, the rest fed with measurements.
    """
    power = np.zeros((len(found.free), 0))
    channels: list[str] = []
    counts: list[int] = []
    first = 0
    for view in views:
        size = view.experiment.time.size
        for channel in view.channels:
            if channel not in channels:
                channels.append(channel)
                counts.append(0)
                power = np.pad(power, ((0, 0), (0, 1)))
            place = channels.index(channel)
            part = found.jacobian[first : first + size]
            power[:, place] += np.einsum("ij,ij->j", part, part)  # without a copy: it is large
            counts[place] += size
            first += size
    size_of = [
        RELATIVE_CHANGE * abs(e.value) / f.derivative(e.value) for f, e in zip(found.free, found.estimates, strict=True)
    ]
    rms = np.sqrt(power / np.maximum(counts, 1)) * np.abs(np.array(size_of))[:, None]
    return [
        Sensitivity(f.name, channel, float(rms[j, c]))
        for j, f in enumerate(found.free)
        for c, channel in enumerate(channels)
        if rms[j, c] > 0.0
    ]
