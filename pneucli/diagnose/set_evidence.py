"""The evidence of every set of effects that a search has fitted: one number a set, and a probability of each effect.

A channel is one signal of one balance, over all recordings; its variance v in units of noise is that of the held-out
readings where there are any. A channel that only noise is left in counts with all its readings; one that an unmodelled
effect disturbs counts as ``KAPPA``. The log evidence of a set is

    L = -1/2 sum_c R_c mean(log v_c) + sum_e [log PRIOR_ODDS - 2 max(0, -log10 size_e)]

with R_c = 1 / ((1 - rho) / n + rho / KAPPA), rho = 1 - 1 / v of the best set, and the size of an effect over its
typical one, between 0.1 and 1.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import softmax

from pneucli.arrays import Array

# calibrated on fits of 27 cases of the exam and of two virtual rigs, the same with each world left out
KAPPA = 8.0  # independent readings that a disturbed channel is worth
PRIOR_ODDS = 0.02  # of an effect
MIN_DISTURBED_SHARE = 0.05  # of a channel's variance: a noise that is known to 3 % is no more exact
MIN_SIZE = 0.1  # of the typical size, below which a smaller one is no less probable
MAX_ROUNDS = 8  # in which the variances of the best set settle


@dataclass(frozen=True)
class VisitedSet:
    """A fitted set of effects beside those of the given model.

    ``channels`` has by balance and signal the number of readings and the sum of their log variances, ``sizes`` the
    size of every effect over its typical size, ``cost`` the sum of squares over the number of readings.
    """

    effects: tuple[str, ...]
    channels: Mapping[str, tuple[float, float]]
    sizes: Mapping[str, float]
    cost: float


@dataclass(frozen=True)
class SetProbability:
    """A set, its log evidence over that of the given model, and its share of all."""

    visited: VisitedSet
    log_evidence: float
    probability: float


def set_probabilities(
    visited: Sequence[VisitedSet], kappa: float = KAPPA, prior_odds: float = PRIOR_ODDS
) -> list[SetProbability]:
    """Return the sets with their evidence, the most probable first.

    Args:
        visited: The sets, with the same channels each; the set without effects is that of the given model.
        kappa: Readings that a disturbed channel is worth.
        prior_odds: Prior odds of every effect.

    Returns:
        One entry a set. Of sets that were never fitted nothing is said.
    """
    if not visited:
        return []
    counts = np.array([[n for n, _ in one.channels.values()] for one in visited])
    logs = np.array([[total for _, total in one.channels.values()] for one in visited]) / np.maximum(counts, 1.0)
    priors = np.array([_log_prior(one, prior_odds) for one in visited])
    base = next((i for i, one in enumerate(visited) if not one.effects), 0)
    disturbance = np.exp(logs[base])
    for _ in range(MAX_ROUNDS):
        evidence = -0.5 * np.sum(_readings(counts, disturbance, kappa) * logs, axis=1) + priors
        less = np.minimum(disturbance, np.exp(logs[int(np.argmax(evidence))]))
        if np.allclose(less, disturbance):
            break
        disturbance = less
    shares = softmax(evidence)
    return [
        SetProbability(visited[i], float(evidence[i] - evidence[base]), float(shares[i]))
        for i in np.argsort(-evidence, kind="stable")
    ]


def _log_prior(visited: VisitedSet, odds: float) -> float:
    sizes = [min(max(visited.sizes.get(name, 1.0), MIN_SIZE), 1.0) for name in visited.effects]
    return math.fsum(math.log(odds) + 2.0 * math.log10(size) for size in sizes)


def _readings(counts: Array, disturbance: Array, kappa: float) -> Array:
    """Return the independent readings of each channel (S, C): all where it is noise, ``kappa`` where it is not."""
    share = np.maximum(1.0 - 1.0 / np.maximum(disturbance, 1.0), MIN_DISTURBED_SHARE)
    return np.asarray(1.0 / ((1.0 - share) / np.maximum(counts, 1.0) + share / kappa))
