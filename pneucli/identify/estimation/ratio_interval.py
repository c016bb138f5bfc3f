"""The interval of a parameter that acts as a product with another one, such as a relative growth of Coulomb friction.

References:
    Fieller, E. C., J. R. Stat. Soc. B 16 (1954) 175.

"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pneucli.quantities import Z95


def best_determined_mean(covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the weights of the mean of some levels that the data determine best.

    A relative growth of dry friction multiplies all of it, Coulomb friction and what a Stribeck curve adds. Where the
    piston moves too slowly or too fast to tell these apart, neither is certain, and a mean of both is.

    Args:
        covariance: Covariance of the levels, shape (m, m).

    Returns:
        Weights, none negative, with the sum 1, shape (m,); of two levels those of the least variance, of more those
        that pairs in turn give.

    >>> best_determined_mean(np.array([[4.0, -1.0], [-1.0, 1.0]])).round(3).tolist()
    [0.286, 0.714]
    >>> best_determined_mean(np.array([[36.0, 3.0], [3.0, 0.25]])).tolist()
    [0.0, 1.0]
    """
    weights: NDArray[np.float64] = np.eye(len(covariance))[0]
    for j in range(1, len(covariance)):
        own, other, cross = weights @ covariance @ weights, covariance[j, j], weights @ covariance[:, j]
        spread = own + other - 2.0 * cross
        share = min(max((own - cross) / spread, 0.0), 1.0) if spread > 0.0 else 0.0
        weights *= 1.0 - share
        weights[j] = share
    return weights


def ratio_interval(ratio: float, factor: float, covariance: NDArray[np.float64]) -> tuple[float, float]:
    """Return the 95 % interval of a ratio whose product with a factor is what the data determine.

    A symmetric interval of the ratio grows without limit as the factor becomes uncertain, though the product may be
    certainly not 0. Here a value g belongs to the interval if the product less g times the factor does not differ from
    0; the interval contains 0 exactly where that of the product does.

    Args:
        ratio: Estimate of the ratio.
        factor: Estimate of the factor, in any unit.
        covariance: Covariance of ratio and factor, shape (2, 2).

    Returns:
        Lower and upper end; infinite where the factor may be 0.

    References:
        E. C. Fieller, J. R. Stat. Soc. B 16 (1954) 175-185.

    >>> [round(end, 3) for end in ratio_interval(0.4, 2.0, np.array([[0.09, -0.45], [-0.45, 2.25]]))]
    [0.162, inf]
    >>> [round(end, 3) for end in ratio_interval(0.4, 2.0, np.diag([0.04, 0.0]))]
    [0.008, 0.792]
    """
    (ratio_variance, cross), (_, factor_variance) = covariance.tolist()
    with_product = factor * cross + ratio * factor_variance  # covariance of product and factor
    product_variance = factor**2 * ratio_variance + 2.0 * ratio * factor * cross + ratio**2 * factor_variance
    square = factor**2 - Z95**2 * factor_variance  # of g in the inequality square g^2 - 2 middle g + constant <= 0
    middle = ratio * factor**2 - Z95**2 * with_product
    constant = (ratio * factor) ** 2 - Z95**2 * product_variance
    root = math.sqrt(max(middle**2 - square * constant, 0.0))
    if square > 0.0:
        return (middle - root) / square, (middle + root) / square
    if constant <= 0.0:
        return -math.inf, math.inf
    return (constant / (middle + root), math.inf) if ratio > 0.0 else (-math.inf, constant / (middle - root))
