"""The lack of fit of a model by channel: is the residual more than noise, and is it a function of a variable?"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.compare.error_regions import locator_signals
from pneucli.distributions import chi_square_tail, normal_quantile, student_t_tail
from pneucli.identify.estimation.blocks import block_labels
from pneucli.identify.estimation.fit import MAX_DERIVATIVE, Fit
from pneucli.identify.estimation.objective import LeastSquaresProblem
from pneucli.identify.residuals import ResidualModel
from pneucli.messages.compare import GOOD_ERROR_RATIO, GOOD_TEST_ERROR_RATIO
from pneucli.quantities import Z95
from pneucli.simulate.model import Model, parameter_value

NOISE_DRAWS = 1  # of each recording; many recordings and restarts are pooled
NOISE_SEED = 11
BINS = 12
TRIMMED_SHARE = 0.005  # of the samples
FRICTION_SIGNALS = ("time", "x", "p1", "p2", "u")  # of which friction may be a function
MIN_BLOCKS_PER_BIN = 4  # in a bin, for the variance of its mean
UNTRIMMED_FACTOR = 2.0  # times these limits for the untrimmed rms
MIN_SHAPE_SHARE = 0.2  # of the squared residual
MIN_TRIMMED_RATIO = 1.06  # with a smaller ratio a shape is immaterial


@dataclass(frozen=True)
class Shape:
    """The residual as a function of one variable: the ``share`` of the squares that bin means hold in excess of chance.

    ``p_value`` is that of such means where the residual does not depend on the variable.
    """

    variable: str
    share: float
    p_value: float


@dataclass(frozen=True)
class LackOfFit:
    """The residual of one channel of one kind of residual model, over all recordings of a use.

    ``ratio`` is its rms over that of a correct model, ``trimmed_ratio`` the same without the worst samples, at the ends
    of segments or at an end stop, which no sampling resolves. ``parameter_uncertainty``: the rms in held-out recordings
    that the parameters' uncertainty causes, in the same unit.
    """

    kind: type[ResidualModel]
    channel: str
    ratio: float
    trimmed_ratio: float
    shapes: tuple[Shape, ...]
    parameter_uncertainty: float = 0.0


def lack_of_fit_by_channel(model: Model, residual_models: Sequence[ResidualModel]) -> list[LackOfFit]:
    """Return the lack of fit of each channel of each kind of residual model."""
    groups: dict[tuple[type[ResidualModel], str], list[tuple[ResidualModel, Array, float]]] = {}
    for residual_model in residual_models:
        errors = residual_model.initial_state_sensitivity(model)
        residual, expected = residual_model.residual(model, errors), expected_rms(model, residual_model, errors)
        is_predicted = residual.get("gap", np.zeros(1)) < 0.5  # a set-valued law predicts no force here
        for channel in residual_model.channels:
            scaled = np.where(is_predicted, residual[channel] / residual_model.noise[channel], 0.0)
            if np.any(scaled):
                groups.setdefault((type(residual_model), channel), []).append(
                    (residual_model, scaled, expected[channel])
                )
    return [_channel_lack_of_fit(kind, channel, members) for (kind, channel), members in groups.items()]


def held_out_lack_of_fit(fit: Fit, residual_models: Sequence[ResidualModel]) -> list[LackOfFit]:
    """Return the lack of fit on held-out data, with the part that the parameters' uncertainty may cause.

    That part is linearised with the parameters' covariance. It costs a simulation for each parameter and is computed
    only where a channel exceeds the limit.
    """
    lacks = lack_of_fit_by_channel(fit.model, residual_models)
    if not fit.free or not any(_exceeds(r, GOOD_TEST_ERROR_RATIO) for r in lacks):
        return lacks
    uncertainty = _parameter_uncertainty(fit, residual_models)
    return [replace(r, parameter_uncertainty=uncertainty.get((r.kind, r.channel), 0.0)) for r in lacks]


def _parameter_uncertainty(
    fit: Fit, residual_models: Sequence[ResidualModel]
) -> dict[tuple[type[ResidualModel], str], float]:
    """Return by kind and channel the rms that the parameters' uncertainty causes, over the expected rms."""
    problem = LeastSquaresProblem(fit.model, residual_models, fit.free)
    z = np.array([f.to_coordinate(parameter_value(fit.model, f.name)) for f in fit.free])
    derivatives = problem.jacobian(z)
    derivatives[~(np.abs(derivatives) < MAX_DERIVATIVE)] = 0.0  # of a diverging model
    variance = np.einsum("ij,jk,ik->i", derivatives, fit.covariance, derivatives)
    parts: dict[tuple[type[ResidualModel], str], list[Array]] = {}
    first = 0
    for residual_model, errors in zip(residual_models, problem.errors, strict=True):
        expected = expected_rms(fit.model, residual_model, errors)
        for channel in residual_model.channels:
            last = first + residual_model.experiment.time.size
            parts.setdefault((type(residual_model), channel), []).append(variance[first:last] / expected[channel] ** 2)
            first = last
    return {key: float(np.sqrt(np.mean(np.concatenate(variances)))) for key, variances in parts.items()}


def expected_rms(model: Model, residual_model: ResidualModel, errors: Mapping[str, Array]) -> dict[str, float]:
    """Return the rms by channel of a correct model, in units of the sensors' noise, at least 1.

    ``errors`` are the sensitivities to the initial states. A smaller Monte Carlo rms may be chance.
    """
    return {c: max(r, 1.0) for c, r in drawn_rms(model, residual_model, errors).items()}


def drawn_rms(model: Model, residual_model: ResidualModel, errors: Mapping[str, Array]) -> dict[str, float]:
    """Return the rms by channel of random noise sent through the model, in units of the sensors' noise."""
    return residual_model.monte_carlo_rms(model, errors, NOISE_DRAWS, NOISE_SEED)


def _channel_lack_of_fit(
    kind: type[ResidualModel], channel: str, members: list[tuple[ResidualModel, Array, float]]
) -> LackOfFit:
    relative = np.concatenate([(r / e)[r != 0.0] for _, r, e in members])
    blocks = block_labels([_one_channel(residual_model) for residual_model, _, _ in members])
    residual = np.concatenate([r for _, r, _ in members])
    variables = [locator_signals(residual_model.experiment) for residual_model, _, _ in members]
    over = {
        name: np.concatenate([v[name] - (v[name][0] if name == "time" else 0.0) for v in variables])
        for name in variables[0]
        if name not in ("a", channel) and all(name in v for v in variables)  # noise is in both
    }
    shapes = [binned_shape(name, values, residual, blocks) for name, values in over.items()]
    if channel == "force" and "direction" in over:
        friction = residual * over["direction"]
        signals = {name: over[name] for name in FRICTION_SIGNALS if name in over}
        shapes += [binned_shape(name, values, friction, blocks) for name, values in signals.items()]
    ranked = tuple(sorted((s for s in shapes if s is not None), key=lambda s: -s.share))
    return LackOfFit(kind, channel, float(np.sqrt(np.mean(relative**2))), trimmed_rms(relative), ranked)


def trimmed_rms(values: Array) -> float:
    """Return the rms without the TRIMMED_SHARE largest values, over that of a normal distribution trimmed alike."""
    cut = float(normal_quantile(1.0 - TRIMMED_SHARE / 2.0))
    kept = np.sort(values**2)[: max(int(values.size * (1.0 - TRIMMED_SHARE)), 1)]
    density = math.exp(-0.5 * cut**2) / math.sqrt(2.0 * math.pi)
    normal = 1.0 - 2.0 * cut * density / (1.0 - TRIMMED_SHARE)  # variance of a normal cut at +-cut
    return float(np.sqrt(np.mean(kept) / normal))


def _one_channel(residual_model: ResidualModel) -> ResidualModel:
    single = type(residual_model)(residual_model.experiment)
    single.__dict__["channels"] = residual_model.channels[:1]
    return single


def binned_shape(variable: str, values: Array, residual: Array, blocks: NDArray[np.int64]) -> Shape | None:
    """Return the shape of the residual over a variable, None where that is constant.

    All bins hold equally many samples; the variance of a bin's mean comes from the sums of blocks.
    """
    valid = np.isfinite(values) & (residual != 0.0)
    values, residual, blocks = values[valid], residual[valid], blocks[valid]
    bin_index = bins_of(values, BINS)
    if bin_index.max(initial=0) == 0:
        return None
    cells = int(blocks.max()) + 1
    keys = bin_index * cells + blocks
    counts = np.bincount(keys)
    filled = np.flatnonzero(counts)
    bins, sums, counts = filled // cells, np.bincount(keys, residual)[filled], counts[filled]
    total = np.bincount(bins, counts)
    means = np.bincount(bins, sums) / np.maximum(total, 1)
    scatter = np.bincount(bins, (sums - counts * means[bins]) ** 2)
    block_count = total**2 / np.maximum(np.bincount(bins, counts**2.0), 1)  # equivalent number of equal blocks in a bin
    resolved = np.bincount(bins) >= MIN_BLOCKS_PER_BIN
    if not resolved.any():
        return None
    means, total, block_count = means[resolved], total[resolved], block_count[resolved]
    freedom = np.maximum(block_count - 1.0, 1.0)
    errors = np.sqrt(scatter[resolved] * block_count / freedom) / total
    explained = float(np.sum(total * (means**2 - errors**2)))
    share = max(explained, 0.0) / max(float(np.sum(residual**2)), 1e-300)
    return Shape(variable, share, _p_value(means / np.maximum(errors, 1e-12), freedom))


def _p_value(ratios: Array, freedom: Array) -> float:
    """Return the p value of means over standard errors that have so many degrees of freedom each."""
    normal = -normal_quantile(np.maximum(student_t_tail(np.abs(ratios), freedom), 1e-300))
    return chi_square_tail(float(normal @ normal), normal.size)


def bins_of(values: Array, max_bins: int) -> NDArray[np.int64]:
    """Return the bin of each value: one a level where these are few, else ``max_bins`` of equally many values."""
    levels = np.unique(values[: max_bins**2])  # of a signal with more levels these show enough, without sorting it
    if levels.size <= max_bins:
        levels = np.unique(values)
    edges = levels[1:] if levels.size <= max_bins else np.unique(np.quantile(values, np.arange(1, max_bins) / max_bins))
    return np.searchsorted(edges, values, side="right").astype(np.int64)


def significant_lack_of_fit(train: Sequence[LackOfFit], test: Sequence[LackOfFit]) -> list[LackOfFit]:
    """Return the channels whose lack of fit exceeds noise and parameter uncertainty, worst first."""
    significant = [
        r for r in train if _exceeds(r, GOOD_ERROR_RATIO) or (r.trimmed_ratio > MIN_TRIMMED_RATIO and _has_shape(r))
    ]
    significant += [
        r for r in test if _exceeds(r, GOOD_TEST_ERROR_RATIO * float(np.hypot(1.0, Z95 * r.parameter_uncertainty)))
    ]
    return sorted(significant, key=lambda r: -r.ratio)


def within_parameter_uncertainty(test: Sequence[LackOfFit]) -> list[LackOfFit]:
    """Return the channels whose lack of fit exceeds noise, but not the parameters' uncertainty."""
    return [r for r in test if _exceeds(r, GOOD_TEST_ERROR_RATIO) and not significant_lack_of_fit([], [r])]


def _exceeds(r: LackOfFit, limit: float) -> bool:
    return r.trimmed_ratio > limit or r.ratio > UNTRIMMED_FACTOR * limit


def _has_shape(r: LackOfFit) -> bool:
    return bool(r.shapes) and r.shapes[0].share > MIN_SHAPE_SHARE and r.shapes[0].p_value < 1e-6
