"""Intervals of a fit under model error, and what else follows from its covariance (docs/method.md).

A missing effect depends on something: position, speed, pressure, command or time. Blocks of time are then not
independent, because the same error returns each time the piston passes the same place. The samples are therefore also
grouped by each of these signals. A sandwich over these groups, with the bias reduction of Bell and McCaffrey, gives a
variance of each parameter; its excess over that of blocks of time is added, for each grouping. Model error also moves
a parameter by the part that all groups have in common, which no grouping shows: it is taken to be as large as what the
groupings show, as far as the squared residuals exceed noise.

References:
    Cameron, A. C., Gelbach, J. B. and Miller, D. L., J. Bus. Econ. Stat. 29 (2011) 238 (several groupings).
    Bell, R. M. and McCaffrey, D. F., Survey Methodology 28 (2002) 169 (bias reduction).

"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.identify.estimation.blocks import group_sums, weighted_curvature
from pneucli.identify.estimation.fit import Estimate, Fit, parameter_estimates
from pneucli.identify.estimation.least_squares import pseudo_inverse
from pneucli.identify.residuals import ResidualModel
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import parameter_value

Labels = NDArray[np.int64]

BINS_PER_SIGNAL = 10  # of a signal, each with as many samples
MAX_LEVERAGE = 0.9  # of the curvature of a direction: beyond it the other groups do not determine that direction


def with_intervals(fitted: Fit, residual_models: Sequence[ResidualModel]) -> Fit:
    """Widen covariance and intervals of a fit by the variance that model error causes.

    The interval of a parameter that the residuals do not determine, alone or together with another one, is its whole
    range: a constant force and the rest position of a spring are one.

    Args:
        fitted: The fit.
        residual_models: The residual models it was fitted to.

    Returns:
        The fit with the wider covariance and intervals; unchanged without parameters or data.

    References:
        K.-Y. Liang and S. L. Zeger, Biometrika 73 (1986) 13-22 (covariance by groups).
    """
    if not fitted.free or not fitted.residual.size:
        return fitted
    inflation = variance_inflation(fitted, group_labels(residual_models))
    covariance = fitted.covariance * np.outer(np.sqrt(inflation), np.sqrt(inflation))
    estimates = [
        e if variance > 0.0 and e.name not in fitted.undetermined else replace(e, ci95=(f.lower, f.upper))
        for e, f, variance in zip(
            parameter_estimates(fitted.free, fitted.model, covariance), fitted.free, covariance.diagonal(), strict=True
        )
    ]
    return replace(fitted, covariance=covariance, estimates=tuple(estimates))


def with_intervals_over_models(fitted: Fit, alternatives: Sequence[Fit]) -> Fit:
    """Widen the intervals of a fit to contain those of the same parameters in other models that the data allow.

    An effect that is not probable enough to be named may still be there in a small amount. Left out, it moves what
    resembles it, which no residual shows: a lag of 28 ms and a hose of 4 ms look much like a lag of 32 ms.

    Args:
        fitted: The fit, with intervals.
        alternatives: Fits of the other models, with intervals.

    Returns:
        The fit with the wider intervals; its covariance stays.

    """
    estimates = list[Estimate]()
    for e in fitted.estimates:
        intervals = [e.ci95, *(other.ci95 for fit in alternatives for other in fit.estimates if other.name == e.name)]
        estimates.append(replace(e, ci95=(min(low for low, _ in intervals), max(high for _, high in intervals))))
    return replace(fitted, estimates=tuple(estimates))


def variance_inflation(fitted: Fit, groups: Iterator[Labels]) -> Array:
    """Compute how much model error inflates the variance of each parameter.

    A parameter at a bound is held there: its score is not zero, which the groups would take for model error.

    Args:
        fitted: The fit.
        groups: Groupings of the residuals, each with labels of shape (N,).

    Returns:
        The factor of each variance, at least 1, shape (k,).

    """
    inside = np.array([j for j, f in enumerate(fitted.free) if not fitted[f.name].at_bound], dtype=np.intp)
    both = np.ix_(inside, inside)
    inverse_hessian = pseudo_inverse(fitted.curvature[both])
    root = _matrix_square_root(inverse_hessian)
    by_time, *others = (
        _bias_reduced_variance(sums.scores[:, inside], sums.curvatures[:, inside[:, None], inside], root)
        for sums in group_sums(fitted.jacobian, fitted.residual, [fitted.blocks, *groups])
    )
    variance, shown = np.diag(fitted.covariance)[inside], np.zeros(inside.size)
    for one in others:
        shown += np.maximum(one - by_time, 0.0)
    by_square = weighted_curvature(fitted.jacobian, fitted.residual)[both]
    added = (1.0 + _excess_variance_share(inverse_hessian, by_square)) * shown
    factor = np.ones(len(fitted.free))
    factor[inside] += np.divide(added, variance, out=np.zeros_like(added), where=variance > 0.0)
    return factor


def _excess_variance_share(inverse_hessian: Array, by_square: Array) -> Array:
    """Return the share of the squared residuals that inform each parameter and exceed noise, shape (k,).

    ``by_square`` (k, k) is the curvature with each residual's square as weight.
    """
    expected = np.diag(inverse_hessian)
    observed = np.diag(inverse_hessian @ by_square @ inverse_hessian)
    return np.asarray(1.0 - np.divide(expected, observed, out=np.ones_like(expected), where=observed > expected))


def group_labels(residual_models: Sequence[ResidualModel]) -> Iterator[Labels]:
    """Yield groupings of the residuals: by recording, then by bins of each signal in turn.

    A signal that does not change, and a single recording, make one group of all residuals, which shows nothing.

    Args:
        residual_models: The residual models whose residuals are stacked.

    Yields:
        The group of each residual, shape (N,).

    """
    names = {name: i for i, name in enumerate(dict.fromkeys(v.experiment.recording.name for v in residual_models))}
    if len(names) > 1:
        yield _residual_labels(
            residual_models,
            [np.full(v.experiment.time.size, names[v.experiment.recording.name]) for v in residual_models],
        )
    kinds = {kind: i for i, kind in enumerate(dict.fromkeys(type(v) for v in residual_models))}
    for name in ("time", "x", "v", "p1", "p2", "u"):
        signals = [_signal(v.experiment, name) for v in residual_models]
        edges = np.unique(np.quantile(np.concatenate(signals), np.linspace(0.0, 1.0, BINS_PER_SIGNAL + 1)[1:-1]))
        bins = [np.searchsorted(edges, signal) for signal in signals]
        if np.ptp(np.concatenate(bins)) == 0:
            continue
        yield _residual_labels(
            residual_models,
            [b + (BINS_PER_SIGNAL + 1) * kinds[type(v)] for b, v in zip(bins, residual_models, strict=True)],
        )


def _signal(e: Experiment, name: str) -> Array:
    """Return a kernel input of an experiment, shape (n,); time counts from the recording's start."""
    return e.time - e.time[0] if name == "time" else np.asarray(e.inputs[:, at.INPUTS.index(name)])


def _residual_labels(residual_models: Sequence[ResidualModel], labels: Sequence[Labels]) -> Labels:
    """Repeat labels of samples for each channel of their residual model."""
    return np.concatenate(
        [
            np.tile(sample_labels, len(view.channels))
            for view, sample_labels in zip(residual_models, labels, strict=True)
        ]
    )


def _bias_reduced_variance(scores: Array, curvatures: Array, root: Array) -> Array:
    """Return the variance of each parameter (k,) from the scores of groups, each over the root of 1 - leverage.

    A fit follows the groups of high leverage, so their residuals are too small. ``scores`` (G, k) and ``curvatures``
    (G, k, k) are those of each group; ``root`` R (k, k) has R R^T equal to the inverse of the curvature of all.
    """
    leverage, axes = np.linalg.eigh(root.T @ curvatures @ root)  # what of a direction each group determines
    along = (scores @ root)[:, None, :] @ axes / np.sqrt(1.0 - np.minimum(leverage, MAX_LEVERAGE))[:, None, :]
    steps = along @ axes.transpose(0, 2, 1) @ root.T
    return np.asarray(np.sum(steps[:, 0, :] ** 2, axis=0))


def _matrix_square_root(matrix: Array) -> Array:
    """Return R (k, k) with R R^T equal to the matrix, also where the scales of its entries differ much."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    level = np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 0.0)
    values, vectors = np.linalg.eigh(matrix * np.outer(level, level))
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))


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
