"""Costs of a model: sums of squared residuals in units of noise by block of time, for fitted and for held-out data.

The costs of different models are comparable. They exclude the noise that a correct model of the kind would show, they
charge for residuals that a model does not predict, and they include the log determinant of the marginalised errors.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from pneucli.arrays import Array
from pneucli.diagnose.adequacy import drawn_rms
from pneucli.identify.estimation.blocks import block_labels, channel_slices
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.objective import in_noise_units
from pneucli.identify.residuals import ResidualModel
from pneucli.identify.residuals.base import apply_whitening
from pneucli.physics.declaration import Effect
from pneucli.simulate.model import Model

ErrorsByChannel = Mapping[str, Array]  # by channel (k, n), in units of the noise
MIN_FLOW_ERROR, MAX_FLOW_ERROR = 1e-4, 0.5  # of the flow: the search range of the deviation
SEARCH_POINTS, SEARCH_ROUNDS = 33, 5  # of that search: each round narrows the range to 1/16, at last to 1e-5
MIN_NOISE_POWER = 0.8  # of the power of the sensors' noise, which is known no better
MIN_STATED_SHARE = 0.02  # of the readings; a model that predicts a force for fewer is charged as for this share
ErrorsByUse = Mapping[str, float | None]


class ErrorsOfModel(Protocol):
    """Return the errors {"train": ..., "test": ...} of a model; None where no recording has that use."""

    def __call__(self, model: Model, reference: Model | None = None) -> ErrorsByUse:
        """Return them in units of the error of the reference if it were correct, by default of the model itself."""

    def limits(self, model: Model) -> ErrorsByUse:
        """Return the errors that a correct model of this kind exceeds once in a hundred times, in the same units."""


class ChannelCost(NamedTuple):
    """The cost of a channel of one recording in units of noise, and the number of its residuals."""

    cost: float
    residual_count: float


class Costs(NamedTuple):
    """Costs and numbers of residuals by block (B,), and by channel of each residual model."""

    by_block: Array
    residual_counts: Array
    channels: tuple[ChannelCost, ...]


@dataclass(frozen=True, eq=False)
class FittedModel:
    """A fitted model and its costs by block: ``train_costs`` on fitted data, ``test_costs`` on held-out data.

    ``costs`` counts each reading once, as held out where it is held out. ``residual_counts`` has the number of
    residuals of each block, without the zeros of residuals that do not count. ``channels`` has the same costs and
    numbers by channel of each residual model.
    """

    fit: Fit
    train_costs: Array
    test_costs: Array
    costs: Array
    residual_counts: Array
    channels: tuple[ChannelCost, ...] = ()

    @property
    def residual_count(self) -> int:
        """The number of residuals behind the costs, which is the expected cost of noise alone."""
        return int(self.residual_counts.sum())

    @property
    def model(self) -> Model:
        """The fitted model."""
        return self.fit.model

    @property
    def effect_names(self) -> list[str]:
        """The names of the model's effects."""
        return [e.name for e in self.fit.model.effects]

    @property
    def cost(self) -> float:
        """The sum of all costs."""
        return float(self.costs.sum())


def fitted_costs(fit: Fit, residual_models: Sequence[ResidualModel]) -> Costs:
    """Return the costs of the data that the model was fitted to."""
    drawn = [
        drawn_rms(fit.model, residual_model, residual_model.initial_state_sensitivity(fit.model))
        for residual_model in residual_models
    ]
    coverage = np.concatenate([coverage_weights(fit.model, residual_model) for residual_model in residual_models])
    costs = likelihood_costs(residual_models, drawn, coverage * fit.residual, fit.initial_state_sensitivities)
    return _summed(residual_models, costs, fit.residual)


def held_out_costs(
    models: Sequence[Model],
    residual_models: Sequence[ResidualModel],
    initial_state_errors: Sequence[Mapping[str, Array]],
) -> Costs:
    """Return the costs of held-out data, each residual model with its own model.

    ``initial_state_errors`` are the sensitivities to the initial states. The flow through the valve may have another
    gain in each held-out recording, too (:func:`with_flow_gain_errors`).
    """
    plain = [residual_model.residual(model, {}) for residual_model, model in zip(residual_models, models, strict=True)]
    errors = with_flow_gain_errors(models, residual_models, plain, initial_state_errors)
    whitened = [
        in_noise_units(v, v.apply_whitening(r, e)) for v, r, e in zip(residual_models, plain, errors, strict=True)
    ]
    drawn = [drawn_rms(m, v, e) for m, v, e in zip(models, residual_models, errors, strict=True)]
    coverage = np.concatenate(
        [coverage_weights(model, residual_model) for model, residual_model in zip(models, residual_models, strict=True)]
    )
    residual = np.concatenate(whitened)
    costs = likelihood_costs(residual_models, drawn, coverage * residual, errors)
    return _summed(residual_models, costs, residual)


def _summed(residual_models: Sequence[ResidualModel], costs: Array, residual: Array) -> Costs:
    """Sum the costs (N,) of residuals (N,) by block and by channel; zeros are residuals that do not count."""
    blocks, counted = block_labels(residual_models), (residual != 0.0).astype(np.float64)
    by_block, counts = (np.bincount(blocks, weights=one).astype(np.float64) for one in (costs, counted))
    channels = [ChannelCost(float(costs[r].sum()), float(counted[r].sum())) for r in channel_slices(residual_models)]
    return Costs(by_block, counts, tuple(channels))


def likelihood_costs(
    residual_models: Sequence[ResidualModel],
    drawn: Sequence[Mapping[str, float]],
    residual: Array,
    errors: Sequence[Mapping[str, Array]],
) -> Array:
    """Return the costs (N,) of residuals (N,): squares, and log determinants of the initial-state errors."""
    log_determinants = np.concatenate(
        [residual_model.log_determinant(mine) for residual_model, mine in zip(residual_models, errors, strict=True)]
    )
    return np.asarray(correct_for_model_noise(residual_models, drawn, residual) ** 2 + log_determinants)


def correct_for_model_noise(
    residual_models: Sequence[ResidualModel], drawn: Sequence[Mapping[str, float]], residual: Array
) -> Array:
    """Return residuals (N,) scaled by channel for the noise that a correct model of this kind would show.

    A model that inverts a lag amplifies noise; a model that smooths over it (a lag in the force balance, a delay of
    half a sample) reduces noise, and a wrong model could cost less without this correction. The assumed noise is at
    most the residual itself, and a channel is reduced below the sensors' noise only by MIN_NOISE_POWER.
    """
    parts, first = [], 0
    for residual_model, noises in zip(residual_models, drawn, strict=True):
        for channel in residual_model.channels:
            part = residual[first : first + residual_model.experiment.time.size]
            first += part.size
            cost, noise = float(part @ part), float(np.count_nonzero(part))
            more = max(noises[channel] ** 2, MIN_NOISE_POWER)
            fair = max(cost - (more - 1.0) * min(noise, cost / more), MIN_NOISE_POWER * min(cost, noise))
            parts.append(part * np.sqrt(fair / cost) if cost > 0.0 else part)
    return np.concatenate(parts)


class Bounds(NamedTuple):
    """Readings for which a model gives only bounds of a force: the probability of that (n,), and their distance (n,) in
    units of noise.
    """

    probability: Array
    width: Array

    @classmethod
    def none(cls) -> Bounds:
        """Return the bounds of a model that predicts every reading."""
        return cls(np.zeros(0), np.zeros(0))


class RecordingCost(NamedTuple):
    """The cost of a channel of one recording, the number of its residuals, and what of it is only bounded."""

    cost: float
    residual_count: float
    bounds: Bounds

    def log_variance(self) -> float:
        """Return n log s^2: -2 log of the predictive density of the channel but for a constant.

        s^2 is the maximum-likelihood variance of the residuals that the model predicts, noise and discrepancy together,
        and no less than the noise. A bounded reading has the density of a uniform distribution over its bounds with
        that error added: that of a normal distribution with the variance s^2 + width^2 / (2 pi e), by entropy.
        """
        variance, (probability, width) = max(self.cost / self.residual_count, 1.0), self.bounds
        bounded = probability @ np.log(variance + width**2 / (2.0 * math.pi * math.e))
        return float((self.residual_count - probability.sum()) * math.log(variance) + bounded)


def bounds_of(model: Model, residual_model: ResidualModel) -> Bounds:
    """Return the readings of which a model gives only bounds."""
    if not residual_model.predicts_force or not any(effect.is_set_valued for effect in model.effects):
        return Bounds.none()
    residual = residual_model.residual(model)
    if "gap" not in residual:
        return Bounds.none()
    inside = (residual["gap"] > 0.0) & (residual["force"] != 0.0)
    return Bounds(residual["gap"][inside], residual["width"][inside] / residual_model.noise["force"])


def coverage_weights(model: Model, residual_model: ResidualModel) -> Array:
    """Return the weight of each residual (N,): 0 where the model predicts only bounds of a force, more for the others.

    A model that predicts bounds explains nothing there: such a reading costs as much as the others do on average.
    """
    parts, n = [], residual_model.experiment.time.size
    bounded = any(effect.is_set_valued for effect in model.effects)
    residual = residual_model.residual(model) if bounded and residual_model.predicts_force else {}
    for channel in residual_model.channels:
        stated = 1.0 - residual["gap"] if channel == "force" and "gap" in residual else np.ones(n)
        seen = residual[channel] != 0.0 if "gap" in residual else np.ones(n, dtype=bool)
        share = max(float(np.mean(stated[seen])), MIN_STATED_SHARE) if seen.any() else 1.0
        parts.append(np.sqrt(stated / share))
    return np.concatenate(parts)


def with_flow_gain_errors(
    models: Sequence[Model],
    residual_models: Sequence[ResidualModel],
    residuals: Sequence[ErrorsByChannel],
    initial_state_errors: Sequence[ErrorsByChannel],
) -> list[ErrorsByChannel]:
    """Return the sensitivities to the initial states and those to the flow gain, scaled to its most likely deviation.

    ``residuals`` are measured minus model by channel (n,), SI, not whitened.
    """
    flows = [
        residual_model.flow_gain_sensitivity(model)
        for residual_model, model in zip(residual_models, models, strict=True)
    ]
    parts = [
        _flow_error_projections(*one)
        for one in zip(residual_models, residuals, initial_state_errors, flows, strict=True)
    ]
    deviation = flow_gain_deviation(np.concatenate([np.zeros((2, 0)), *parts], axis=1))
    return [
        {**start, **{c: np.vstack([*start.get(c, ()), deviation * e]) for c, e in flow.items()}} if deviation else start
        for start, flow in zip(initial_state_errors, flows, strict=True)
    ]


def _flow_error_projections(
    residual_model: ResidualModel,
    residual: ErrorsByChannel,
    initial_state_errors: ErrorsByChannel,
    flows: ErrorsByChannel,
) -> Array:
    """Return (2, m): the power of a flow-gain error in each segment, and the residual along it, by principal axis."""
    restarts, parts = residual_model.experiment.restarts, [np.zeros((2, 0))]
    for channel, flow in flows.items():
        start = initial_state_errors.get(channel, np.zeros((0, flow.shape[1])))
        errors = np.array([apply_whitening(error, start, restarts) for error in flow])
        whitened = apply_whitening(residual[channel] / residual_model.noise[channel], start, restarts)
        products = np.array([[np.add.reduceat(a * b, restarts) for a in errors] for b in errors])
        power, axes = np.linalg.eigh(np.moveaxis(products, -1, 0))
        along = np.array([np.add.reduceat(error * whitened, restarts) for error in errors]).T
        parts.append(np.array([power.ravel(), np.einsum("nij,ni->nj", axes, along).ravel()]))
    return np.concatenate(parts, axis=1)


def flow_gain_deviation(parts: Array) -> float:
    """Return the most likely standard deviation of the relative flow-gain error; 0 where none is more likely.

    ``parts`` (2, m) are powers P and residuals along them A: with the variance s^2 the -2 log likelihood changes by
    log(1 + s^2 P) - s^2 A^2 / (1 + s^2 P).
    """
    power, along = parts
    low, high, sizes, costs = math.log(MIN_FLOW_ERROR), math.log(MAX_FLOW_ERROR), np.zeros(0), np.zeros(0)
    for _ in range(SEARCH_ROUNDS):
        sizes = np.linspace(low, high, SEARCH_POINTS)
        variance = np.exp(2.0 * sizes)[:, None]
        costs = np.sum(np.log1p(variance * power) - variance * along**2 / (1.0 + variance * power), axis=1)
        lowest = int(np.argmin(costs))
        low, high = sizes[max(lowest - 1, 0)], sizes[min(lowest + 1, SEARCH_POINTS - 1)]
    return float(np.exp(sizes[np.argmin(costs)])) if costs.min() < 0.0 else 0.0


def log_variances(residual_models: Sequence[ResidualModel], fitted: FittedModel) -> dict[str, tuple[float, float]]:
    """Return by balance and signal the number of readings and n log s^2 of all recordings."""
    found: dict[str, tuple[float, float]] = {}
    channels = [(m, channel) for m in residual_models for channel in m.channels]
    for (m, channel), cost in zip(channels, fitted.channels, strict=True):
        if cost.residual_count:
            bounds = bounds_of(fitted.model, m) if channel == "force" else Bounds.none()
            count, total = found.get(key := f"{type(m).__name__} {channel}", (0.0, 0.0))
            more = RecordingCost(*cost, bounds).log_variance()
            found[key] = count + cost.residual_count, total + more
    return found


def exclusive_channel_cost(model: Model, residual_models: Sequence[ResidualModel], effect: Effect) -> RecordingCost:
    """Return the cost of an effect's exclusive channels."""
    residuals = [m.residual(model)[c] / m.noise[c] for m in residual_models for c in m.exclusive_channels(effect)]
    return RecordingCost(
        float(sum(r @ r for r in residuals)), float(sum(np.count_nonzero(r) for r in residuals)), Bounds.none()
    )
