"""What a model leaves over: is it more than noise, and over which variable does it have a shape?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, norm
from scipy.stats import t as student

from pneucli.compare.error_regions import locator_signals
from pneucli.identify.estimation.blocks import block_labels
from pneucli.identify.estimation.fit import MAX_DERIVATIVE, Fit
from pneucli.identify.estimation.problem import LeastSquaresProblem
from pneucli.identify.residuals import ResidualModel
from pneucli.simulate.model import Model, parameter_value

Array = NDArray[np.float64]

NOISE_DRAWS = 1  # of each view; many views and restarts are pooled
NOISE_SEED = 11
BINS = 12
TRIMMED_SHARE = 0.005  # share of the samples
FRICTION_SIGNALS = ("time", "x", "p1", "p2", "u")  # over which friction may change
MIN_BLOCKS_PER_BIN = 4  # in a bin, to know how its mean scatters
TRAIN_LIMIT = 1.2  # of the rms that a correct model would show; measured on exams: docs/method.md
TEST_LIMIT = 1.4  # commands between the fitted ones are interpolated
UNTRIMMED_FACTOR = 2.0  # times these limits for the rms with the worst samples
MIN_SHAPE_SHARE = 0.2  # share of the squared residual that a shape may hold
NORMAL_QUANTILE = float(norm.ppf(0.975))  # standard errors by which a parameter may be off
MIN_TRIMMED_RATIO = 1.06  # a ratio below which a shape is too small to matter


@dataclass(frozen=True)
class Shape:
    """The residual over one variable: the ``share`` of the squares that means over bins hold beyond what scatter gives.

    ``p_value`` is the chance of such means where the residual does not depend on the variable.
    """

    variable: str
    share: float
    p_value: float


@dataclass(frozen=True)
class LackOfFit:
    """One channel seen through one kind of view, over all recordings of a use.

    ``ratio`` is its rms over what a correct model would show, ``trimmed_ratio`` the same without the worst samples: those at
    the edge of a stretch or at a stop, which no sampling resolves. ``parameter_uncertainty``, in the same unit: how much of it the
    parameters' own uncertainty may cause, in recordings that were not fitted.
    """

    kind: type[ResidualModel]
    channel: str
    ratio: float
    trimmed_ratio: float
    shapes: tuple[Shape, ...]
    parameter_uncertainty: float = 0.0


def lack_of_fit_by_channel(model: Model, views: Sequence[ResidualModel]) -> list[LackOfFit]:
    """Return what the model leaves over in each channel of each kind of view."""
    groups: dict[tuple[type[ResidualModel], str], list[tuple[ResidualModel, Array, float]]] = {}
    for view in views:
        errors = view.initial_state_sensitivity(model)
        residual, expected = view.residual(model, errors), expected_rms(model, view, errors)
        stated = residual.get("gap", np.zeros(1)) < 0.5  # bounds are kept by anything within them
        for channel in view.channels:
            scaled = np.where(stated, residual[channel] / view.noise[channel], 0.0)
            if np.any(scaled):
                groups.setdefault((type(view), channel), []).append((view, scaled, expected[channel]))
    return [_channel_lack_of_fit(kind, channel, members) for (kind, channel), members in groups.items()]


def held_out_lack_of_fit(found: Fit, views: Sequence[ResidualModel]) -> list[LackOfFit]:
    """Return what a fitted model leaves over in views that were not fitted, and what its parameters leave open there.

    To first order, by their covariance; asked for only where something is large, since it costs a simulation for each
    parameter.
    """
    left = lack_of_fit_by_channel(found.model, views)
    if not found.free or not any(_exceeds(r, TEST_LIMIT) for r in left):
        return left
    known = _parameter_uncertainty(found, views)
    return [replace(r, parameter_uncertainty=known.get((r.kind, r.channel), 0.0)) for r in left]


def _parameter_uncertainty(found: Fit, views: Sequence[ResidualModel]) -> dict[tuple[type[ResidualModel], str], float]:
    """Return by channel of each kind of view the rms that the parameters' uncertainty makes, of what is expected."""
    problem = LeastSquaresProblem(found.model, views, found.free)
    at = np.array([f.to_coordinate(parameter_value(found.model, f.name)) for f in found.free])
    derivatives = problem.jacobian(at)
    derivatives[~(np.abs(derivatives) < MAX_DERIVATIVE)] = 0.0  # of a model that runs away nothing is known
    variance = np.einsum("ij,jk,ik->i", derivatives, found.covariance, derivatives)
    parts: dict[tuple[type[ResidualModel], str], list[Array]] = {}
    first = 0
    for view, errors in zip(views, problem.errors, strict=True):
        expected = expected_rms(found.model, view, errors)
        for channel in view.channels:
            last = first + view.experiment.time.size
            parts.setdefault((type(view), channel), []).append(variance[first:last] / expected[channel] ** 2)
            first = last
    return {key: float(np.sqrt(np.mean(np.concatenate(each)))) for key, each in parts.items()}


def expected_rms(model: Model, view: ResidualModel, errors: Mapping[str, Array]) -> dict[str, float]:
    """Return the rms by channel that a correct model would show in this view, in units of the sensors' noise.

    ``errors`` of the starts are what the view says is carried. No less than that noise: what a draw lacks of it may be
    chance.
    """
    return {c: max(r, 1.0) for c, r in drawn_rms(model, view, errors).items()}


def drawn_rms(model: Model, view: ResidualModel, errors: Mapping[str, Array]) -> dict[str, float]:
    """Return the rms by channel of drawn noise sent through the model, in units of the sensors' noise."""
    return view.monte_carlo_rms(model, errors, NOISE_DRAWS, NOISE_SEED)


def _channel_lack_of_fit(
    kind: type[ResidualModel], channel: str, members: list[tuple[ResidualModel, Array, float]]
) -> LackOfFit:
    relative = np.concatenate([(r / e)[r != 0.0] for _, r, e in members])
    blocks = block_labels([_one_channel(view) for view, _, _ in members])
    residual = np.concatenate([r for _, r, _ in members])
    variables = [locator_signals(view.experiment) for view, _, _ in members]
    over = {
        name: np.concatenate([v[name] - (v[name][0] if name == "time" else 0.0) for v in variables])
        for name in variables[0]
        if name not in ("a", channel) and all(name in v for v in variables)  # noise is in both
    }
    shapes = [binned_shape(name, values, residual, blocks) for name, values in over.items()]
    if channel == "force" and "direction" in over:
        friction = residual * over["direction"]
        laws = {name: over[name] for name in FRICTION_SIGNALS if name in over}
        shapes += [binned_shape(name, values, friction, blocks) for name, values in laws.items()]
    ranked = tuple(sorted((s for s in shapes if s is not None), key=lambda s: -s.share))
    return LackOfFit(kind, channel, float(np.sqrt(np.mean(relative**2))), trimmed_rms(relative), ranked)


def trimmed_rms(values: Array) -> float:
    """Return the rms (over that of a normal distribution cut alike) without the WORST share of the values."""
    cut = float(norm.ppf(1.0 - TRIMMED_SHARE / 2.0))
    kept = np.sort(values**2)[: max(int(values.size * (1.0 - TRIMMED_SHARE)), 1)]
    normal = 1.0 - 2.0 * cut * float(norm.pdf(cut)) / (1.0 - TRIMMED_SHARE)  # variance of a normal cut at +-cut
    return float(np.sqrt(np.mean(kept) / normal))


def _one_channel(view: ResidualModel) -> ResidualModel:
    single = type(view)(view.experiment)
    single.__dict__["channels"] = view.channels[:1]
    return single


def binned_shape(variable: str, values: Array, residual: Array, blocks: NDArray[np.int64]) -> Shape | None:
    """Return the residual's shape over a variable, None where that does not vary.

    Each bin holds as many samples as the others; the scatter of its mean comes from the blocks' sums.
    """
    seen = np.isfinite(values) & (residual != 0.0)
    values, residual, blocks = values[seen], residual[seen], blocks[seen]
    place = bins_of(values, BINS)
    if place.max(initial=0) == 0:
        return None
    keys, inverse = np.unique(place * (int(blocks.max()) + 1) + blocks, return_inverse=True)
    bins = keys // (int(blocks.max()) + 1)
    sums, counts = np.bincount(inverse, residual), np.bincount(inverse)
    total = np.bincount(bins, counts)
    means = np.bincount(bins, sums) / np.maximum(total, 1)
    scatter = np.bincount(bins, (sums - counts * means[bins]) ** 2)
    number = total**2 / np.maximum(np.bincount(bins, counts**2.0), 1)  # of blocks in a bin, as of equal ones
    enough = np.bincount(bins) >= MIN_BLOCKS_PER_BIN
    if not enough.any():
        return None
    means, total, number = means[enough], total[enough], number[enough]
    freedom = np.maximum(number - 1.0, 1.0)
    errors = np.sqrt(scatter[enough] * number / freedom) / total
    held = float(np.sum(total * (means**2 - errors**2)))
    share = max(held, 0.0) / max(float(np.sum(residual**2)), 1e-300)
    return Shape(variable, share, _p_value(means / np.maximum(errors, 1e-12), freedom))


def _p_value(ratios: Array, freedom: Array) -> float:
    """Return the chance of means so far from zero, over errors that are known with so many degrees of freedom each."""
    normal = norm.isf(np.maximum(student.sf(np.abs(ratios), freedom), 1e-300))
    return float(chi2.sf(normal @ normal, normal.size))


def bins_of(values: Array, most: int) -> NDArray[np.int64]:
    """Return the bin of each value: one a level where they are few, else ``most`` that hold as many values each."""
    levels = np.unique(values)
    edges = levels[1:] if levels.size <= most else np.unique(np.quantile(values, np.arange(1, most) / most))
    return np.searchsorted(edges, values, side="right").astype(np.int64)


def significant_lack_of_fit(train: Sequence[LackOfFit], test: Sequence[LackOfFit]) -> list[LackOfFit]:
    """Return the remainders that are more than noise and known uncertainty, worst first."""
    rest = [r for r in train if _exceeds(r, TRAIN_LIMIT) or (r.trimmed_ratio > MIN_TRIMMED_RATIO and _has_shape(r))]
    rest += [
        r for r in test if _exceeds(r, TEST_LIMIT * float(np.hypot(1.0, NORMAL_QUANTILE * r.parameter_uncertainty)))
    ]
    return sorted(rest, key=lambda r: -r.ratio)


def within_parameter_uncertainty(test: Sequence[LackOfFit]) -> list[LackOfFit]:
    """Return the remainders that are more than noise, but no more than the parameters leave open."""
    return [r for r in test if _exceeds(r, TEST_LIMIT) and not significant_lack_of_fit([], [r])]


def _exceeds(r: LackOfFit, limit: float) -> bool:
    return r.trimmed_ratio > limit or r.ratio > UNTRIMMED_FACTOR * limit


def _has_shape(r: LackOfFit) -> bool:
    return bool(r.shapes) and r.shapes[0].share > MIN_SHAPE_SHARE and r.shapes[0].p_value < 1e-6
