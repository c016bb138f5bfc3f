"""Intervals of a fit's parameters where the model is not the whole truth.

What a model misses is a function of something: of position, speed, pressure, command or time. Blocks of time are not
independent of each other then: each time the piston comes by, the same is missing. So the samples are grouped by each
of these signals as well, and what leaving out one group after the other (a jackknife over groups) moves a parameter by,
beyond what leaving out blocks of time does, is added to its variance. A variance that ten groups tell is itself known
badly, so intervals are those of Student's t. Sources: Cameron, Gelbach and Miller, J. Bus. Econ. Stat. 29 (2011) 238,
for groups of several kinds; Bell and McCaffrey, Survey Methodology 28 (2002) 169, for the jackknife and its degrees of
freedom.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.estimation.blocks import group_curvatures, group_scores, weighted_curvature
from pneucli.identify.estimation.fit import Fit, parameter_estimates
from pneucli.identify.residuals import ResidualModel
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment

Array = NDArray[np.float64]
Labels = NDArray[np.int64]

BINS_PER_SIGNAL = 10  # of a signal, each with as many samples
COMMON_ERROR_FACTOR = (
    6.0  # times the variance that groups show where more than noise is left: what all have in common they do not
)
MAX_LEVERAGE = (
    0.9  # of what is known of a direction: a group that knows more is not left out of it, the others cannot tell
)


@dataclass(frozen=True)
class Groups:
    """The residuals of a fit in groups, by their labels (N,): G labels, of which some may have no residual."""

    found: Fit
    labels: Labels

    @cached_property
    def scores(self) -> Array:
        """The scores of each group, (G, k)."""
        return group_scores(self.found.jacobian, self.found.residual, self.labels)

    @cached_property
    def curvatures(self) -> Array:
        """The curvature that each group gives, (G, k, k)."""
        return group_curvatures(self.found.jacobian, self.labels)

    @cached_property
    def count(self) -> int:
        """How many groups have residuals."""
        return int(np.count_nonzero(np.bincount(self.labels)))


def with_intervals(found: Fit, views: Sequence[ResidualModel]) -> Fit:
    """Return a fit whose covariance and intervals allow for what the model misses, from the views it was fitted to."""
    if not found.free or not found.residual.size:
        return found
    growth, freedom = variance_inflation(found, group_labels(views))
    covariance = found.covariance * np.outer(np.sqrt(growth), np.sqrt(growth))
    return replace(
        found, covariance=covariance, estimates=parameter_estimates(found.free, found.model, covariance, freedom)
    )


def variance_inflation(found: Fit, groups: Iterator[Labels]) -> tuple[Array, Array]:
    """Return by how much each parameter's variance grows (k,), at least 1, and its degrees of freedom (k,).

    ``groups`` number the residuals (N,). What they add has one degree less than there are groups, as of equal ones,
    that tell of the parameter; what blocks of time tell is taken for known. The sum has the degrees of Welch and
    Satterthwaite. A law that the model lacks moves a parameter also by what all groups have in common, which none of
    them shows: so what they add counts UNSHOWN times, as far as the squares that tell of it are beyond noise.
    """
    by_time, variance = Groups(found, found.blocks), np.diag(found.covariance)
    blocks, usual = _sandwich_variance(by_time), _jackknife_variance(by_time)
    more, unsure = np.zeros(len(found.free)), np.zeros(len(found.free))
    for labels in groups:
        others = Groups(found, labels)
        beyond = _sandwich_variance(others) > blocks
        if beyond.any():
            part = np.where(beyond, np.maximum(_jackknife_variance(others) - usual, 0.0), 0.0)
            more, unsure = more + part, unsure + part**2 / _effective_degrees_of_freedom(others)
    scale = 1.0 + (COMMON_ERROR_FACTOR - 1.0) * _excess_variance_share(found)
    more, unsure = scale * more, scale**2 * unsure
    growth = 1.0 + np.divide(more, variance, out=np.zeros_like(more), where=variance > 0.0)
    freedom = np.divide((variance + more) ** 2, unsure, out=np.full_like(more, np.inf), where=unsure > 0.0)
    return growth, np.maximum(freedom, 1.0)


def _excess_variance_share(found: Fit) -> Array:
    """Return the share beyond noise of the squares of the residuals that tell of each parameter, shape (k,)."""
    total, squares = (
        np.diag(found.inverse_hessian),
        _parameter_information(found, weighted_curvature(found.jacobian, found.residual)),
    )
    return np.asarray(1.0 - np.divide(total, squares, out=np.ones_like(total), where=squares > total))


def _parameter_information(found: Fit, curvatures: Array) -> Array:
    """Return how much residuals with these curvatures (..., k, k) tell of each parameter, shape (..., k)."""
    return np.asarray(np.einsum("ji,...jk,ki->...i", found.inverse_hessian, curvatures, found.inverse_hessian))


def _effective_degrees_of_freedom(groups: Groups) -> Array:
    """Return one less than how many groups, as of equal ones, tell of each parameter, shape (k,)."""
    each = _parameter_information(groups.found, groups.curvatures)
    squares = (each**2).sum(axis=0)
    number = np.divide(each.sum(axis=0) ** 2, squares, out=np.ones_like(squares), where=squares > 0.0)
    return np.asarray(np.maximum(number - 1.0, 1.0))


def group_labels(views: Sequence[ResidualModel]) -> Iterator[Labels]:
    """Yield the number of the group of each residual (N,): by recording, then by bins of each signal in turn."""
    names = {name: i for i, name in enumerate(dict.fromkeys(v.experiment.recording.name for v in views))}
    yield _residual_labels(views, [np.full(v.experiment.time.size, names[v.experiment.recording.name]) for v in views])
    kinds = {kind: i for i, kind in enumerate(dict.fromkeys(type(v) for v in views))}
    for name in ("time", "x", "v", "p1", "p2", "u"):
        signals = [_signal(v.experiment, name) for v in views]
        edges = np.unique(np.quantile(np.concatenate(signals), np.linspace(0.0, 1.0, BINS_PER_SIGNAL + 1)[1:-1]))
        bins = [np.searchsorted(edges, signal) for signal in signals]
        yield _residual_labels(
            views, [b + (BINS_PER_SIGNAL + 1) * kinds[type(v)] for b, v in zip(bins, views, strict=True)]
        )


def _signal(e: Experiment, name: str) -> Array:
    """Return a signal of an experiment as the kernel takes it, shape (n,); time counts from the recording's start."""
    return e.time - e.time[0] if name == "time" else np.asarray(e.inputs[:, at.INPUTS.index(name)])


def _residual_labels(views: Sequence[ResidualModel], labels: Sequence[Labels]) -> Labels:
    """Return labels of samples as those of residuals: channel after channel of each view."""
    return np.concatenate([np.tile(mine, len(view.channels)) for view, mine in zip(views, labels, strict=True)])


def _sandwich_variance(groups: Groups) -> Array:
    """Return the variance of each parameter (k,) by the sums of the scores in groups."""
    return np.asarray(((groups.scores @ groups.found.inverse_hessian) ** 2).sum(axis=0))


def _jackknife_variance(groups: Groups) -> Array:
    """Return the variance of each parameter (k,): what leaving out each group moves it by, in one step, squared."""
    root = _matrix_square_root(groups.found.inverse_hessian)
    moved = np.zeros(len(root))
    for score, curved in zip(groups.scores, groups.curvatures, strict=True):
        share, own = np.linalg.eigh(root.T @ curved @ root)  # of what all data together know of a direction
        left = own.T @ (root.T @ score) / (1.0 - np.minimum(share, MAX_LEVERAGE))
        moved += (root @ (own @ left)) ** 2
    return np.asarray(moved * (groups.count - 1) / groups.count)


def _matrix_square_root(matrix: Array) -> Array:
    """Return R (k, k) with R R^T the matrix, whose scales may differ much."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    level = np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 0.0)
    values, vectors = np.linalg.eigh(matrix * np.outer(level, level))
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))
