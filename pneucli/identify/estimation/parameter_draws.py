"""Parameters drawn from the uncertainty of a fit: models that the recordings allow as well."""

from __future__ import annotations

import numpy as np

from pneucli.identify.estimation.fit import Fit
from pneucli.simulate.model import parameter_value

DRAWS = 6
SEED = 20261


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
