r"""The expected entropy of "which effect" after recordings, and the power to find an effect.

Hypothesis :math:`i` predicts residuals :math:`a_i D_i` with a size :math:`a_i \sim N(1, s_i^2)`. The statistics
:math:`z = D^T \Sigma^{-1} y` are sufficient, so the posterior follows from the Gram matrix :math:`G` of the rivals
alone.

References:
    Box, G. E. P. and Hill, W. J., Technometrics 9 (1967) 57.
    Lindley, D. V., Ann. Math. Statist. 27 (1956) 986 (expected information of an experiment).

"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp, ndtr

Array = NDArray[np.float64]

DRAWS = 300  # of readings, for each hypothesis
SEED = 1965
MIN_SIZE_VARIANCE = 1e-6  # of an effect's relative size
DETECTION_LEVEL = 3.16  # standard errors that a catalogue of effects takes: 4 less the 0.84 of 80 % power
POWER_80 = 0.8416  # standard errors from there to a power of 80 %


def expected_entropy(gram: Array, prior: Sequence[float], size_errors: Sequence[float]) -> float:
    """Return the expected entropy of the posterior over hypotheses.

    Args:
        gram: Gram matrix of the rivals' differences from the first hypothesis, shape (K, K).
        prior: Prior weights of the first hypothesis and of the K rivals, shape (K + 1,).
        size_errors: Relative standard error of the size of each rival's effect, shape (K,).

    Returns:
        Entropy in bits.

    >>> expected_entropy(np.zeros((1, 1)), [0.5, 0.5], [0.1])
    1.0
    >>> expected_entropy(np.array([[1e4]]), [0.5, 0.5], [0.1]) < 1e-6
    True
    """
    probabilities = np.asarray(prior) / np.sum(prior)
    posterior = posterior_draws(gram, probabilities, size_errors)
    with np.errstate(divide="ignore", invalid="ignore"):
        bits = -np.nansum(np.where(posterior > 0.0, posterior * np.log2(posterior), 0.0), axis=2)
    return float(probabilities @ bits.mean(axis=1))


def posterior_draws(gram: Array, probabilities: Array, size_errors: Sequence[float]) -> Array:
    """Draw posteriors under each hypothesis.

    Args:
        gram: Gram matrix, shape (K, K).
        probabilities: Prior probabilities, shape (K + 1,).
        size_errors: Relative standard errors of the sizes, shape (K,).

    Returns:
        Posterior probabilities, shape (K + 1, DRAWS, K + 1): true hypothesis, draw, hypothesis.
    """
    k = gram.shape[0]
    variance = np.maximum(np.asarray(size_errors) ** 2, MIN_SIZE_VARIANCE)
    rng = np.random.default_rng(SEED)
    values, vectors = np.linalg.eigh(gram)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    noise = rng.standard_normal((DRAWS, k)) @ root.T
    size = 1.0 + np.sqrt(variance) * rng.standard_normal((DRAWS, k))
    truths = [noise] + [noise + size[:, [i]] * gram[:, i] for i in range(k)]
    z = np.array(truths)
    diagonal = np.diag(gram)
    evidence = 0.5 * ((z + 1.0 / variance) ** 2 / (diagonal + 1.0 / variance) - 1.0 / variance)
    evidence -= 0.5 * np.log1p(variance * diagonal)
    logs = np.concatenate([np.zeros((k + 1, DRAWS, 1)), evidence], axis=2) + np.log(probabilities)
    return np.asarray(np.exp(logs - logsumexp(logs, axis=2, keepdims=True)))


def powers_to_decide(gram: Array, prior: Sequence[float], size_errors: Sequence[float]) -> list[float]:
    """Return for each rival the probability that it is found if it is true: its posterior exceeds one half.

    The posteriors of rivals that the recordings do not tell from it count with it: an answer names one of them, and
    states the others as indistinguishable.

    Args:
        gram: Gram matrix, shape (K, K).
        prior: Prior weights of the first hypothesis and of the K rivals, shape (K + 1,).
        size_errors: Relative standard errors of the sizes, shape (K,).

    >>> gram = np.array([[100.0, 100.0], [100.0, 100.0]])
    >>> powers_to_decide(gram, [0.8, 0.1, 0.1], [0.1, 0.1])  # each alone has a posterior of one half
    [1.0, 1.0]
    """
    draws = posterior_draws(gram, np.asarray(prior) / np.sum(prior), size_errors)
    squares = np.diag(gram)
    apart = squares[:, None] + squares[None, :] - 2.0 * gram
    nearer = 0.25 * np.minimum(squares[:, None], squares[None, :])  # than half the way to the first hypothesis
    alike = (apart < np.minimum(nearer, DETECTION_LEVEL**2)) | np.eye(len(squares), dtype=bool)
    return [
        float(np.mean(draws[i + 1][:, 1 + np.flatnonzero(alike[i])].sum(axis=1) > 0.5)) for i in range(len(squares))
    ]


def detection_power(size_over_error: float) -> float:
    """Return the probability that an effect is found whose size is so many standard errors.

    >>> round(detection_power(4.0), 2)
    0.8
    """
    if not np.isfinite(size_over_error):
        return 1.0
    return float(ndtr(size_over_error - DETECTION_LEVEL) + ndtr(-size_over_error - DETECTION_LEVEL))


def minimum_detectable_size(size: float, size_over_error: float, power_margin: float = POWER_80) -> float:
    """Return the size that is found with a power of 80 %, from a size and how many standard errors it is.

    >>> round(minimum_detectable_size(2.0, 8.0), 2)
    1.0
    """
    if not size_over_error > 0.0:
        return float("inf")
    return size * (DETECTION_LEVEL + power_margin) / size_over_error
