"""What recordings cost: squares of residuals in units of noise by block of time, of those fitted and of those not seen.

Squares that can be compared between models: less what a correct model of the kind would show of noise, more for what a
model leaves unsaid, and with the volume of what is allowed for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from pneucli.diagnose.adequacy import drawn_rms
from pneucli.diagnose.evidence import block_costs
from pneucli.diagnose.flow_gain_variance import with_flow_gain_errors
from pneucli.identify.estimation.blocks import block_labels
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.problem import in_noise_units
from pneucli.identify.residuals import ResidualModel
from pneucli.simulate.model import Model

Array = NDArray[np.float64]

MIN_NOISE_POWER = 0.8  # of the noise's power, at least
MIN_STATED_SHARE = 0.02  # of the readings: a model that states less is charged no more


def fitted_costs(found: Fit, views: Sequence[ResidualModel]) -> tuple[Array, Array]:
    """Return the cost by block of the views that a model was fitted to, and how many residuals are behind each."""
    drawn = [drawn_rms(found.model, view, view.initial_state_sensitivity(found.model)) for view in views]
    said = np.concatenate([coverage_weights(found.model, view) for view in views])
    return likelihood_costs(views, drawn, said * found.residual, found.initial_state_sensitivities), _residual_counts(
        views, found.residual
    )


def held_out_costs(
    models: Sequence[Model], views: Sequence[ResidualModel], initial_state_errors: Sequence[Mapping[str, Array]]
) -> tuple[Array, Array]:
    """Return the same of views that were not fitted, each by its model; ``initial_state_errors`` are the errors of their starts.

    The flow through the valve may err there besides (:mod:`pneucli.diagnose.flow_gain_variance`).
    """
    plain = [view.residual(model, {}) for view, model in zip(views, models, strict=True)]
    errors = with_flow_gain_errors(models, views, plain, initial_state_errors)
    settled = [in_noise_units(v, v.apply_whitening(r, e)) for v, r, e in zip(views, plain, errors, strict=True)]
    drawn = [drawn_rms(m, v, e) for m, v, e in zip(models, views, errors, strict=True)]
    said = np.concatenate([coverage_weights(model, view) for model, view in zip(models, views, strict=True)])
    residual = np.concatenate(settled)
    return likelihood_costs(views, drawn, said * residual, errors), _residual_counts(views, residual)


def _residual_counts(views: Sequence[ResidualModel], residual: Array) -> Array:
    return block_costs((residual != 0.0).astype(np.float64), block_labels(views))


def likelihood_costs(
    views: Sequence[ResidualModel],
    drawn: Sequence[Mapping[str, float]],
    residual: Array,
    errors: Sequence[Mapping[str, Array]],
) -> Array:
    """Return the cost by block of residuals (N,): their squares, and the volume of what the starts may err by."""
    blocks = block_labels(views)
    volume = np.concatenate([view.log_determinant(mine) for view, mine in zip(views, errors, strict=True)])
    return block_costs(correct_for_model_noise(views, drawn, residual), blocks) + np.bincount(blocks, weights=volume)


def correct_for_model_noise(
    views: Sequence[ResidualModel], drawn: Sequence[Mapping[str, float]], residual: Array
) -> Array:
    """Return residuals (N,) scaled, channel by channel, for what a correct model of this kind would show of noise.

    A model that undoes a lag amplifies noise, one that smooths over it (a lag in the balance of forces, a delay by half
    a sample) shows less; without the allowance a wrong one could leave less. The noise is no more than what is left; a
    channel is made smaller than the sensors' noise only so far as that is not known better.
    """
    parts, first = [], 0
    for view, noises in zip(views, drawn, strict=True):
        for channel in view.channels:
            part = residual[first : first + view.experiment.time.size]
            first += part.size
            cost, noise = float(part @ part), float(np.count_nonzero(part))
            more = max(noises[channel] ** 2, MIN_NOISE_POWER)
            fair = max(cost - (more - 1.0) * min(noise, cost / more), MIN_NOISE_POWER * min(cost, noise))
            parts.append(part * np.sqrt(fair / cost) if cost > 0.0 else part)
    return np.concatenate(parts)


def coverage_weights(model: Model, view: ResidualModel) -> Array:
    """Return by how much each residual of a view (N,) counts: those at which the model states no force but bounds, not
    at all, and the others of the channel so much more.

    Where a model states only bounds it explains nothing: such a reading costs what the others cost on average.
    """
    parts, n = [], view.experiment.time.size
    bounded = any(effect.is_set_valued for effect in model.effects)
    residual = view.residual(model) if bounded and view.predicts_force else {}
    for channel in view.channels:
        stated = 1.0 - residual["gap"] if channel == "force" and "gap" in residual else np.ones(n)
        seen = residual[channel] != 0.0 if "gap" in residual else np.ones(n, dtype=bool)
        share = max(float(np.mean(stated[seen])), MIN_STATED_SHARE) if seen.any() else 1.0
        parts.append(np.sqrt(stated / share))
    return np.concatenate(parts)
