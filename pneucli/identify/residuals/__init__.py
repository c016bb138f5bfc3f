"""Residual models: one subsystem of a recording at a time, the rest fed with measurements.

``ChamberPressures`` simulates the pressures with the measured motion, so friction does not matter. ``ForceBalance``
compares the friction force that measured motion and pressures imply with the set of forces that the model allows, so
the gas does not matter. ``ForceBalanceInferredP2`` does so with the model's p2 where p2 was not recorded.
``ImposedMotion`` compares the measured force with the force that the model needs for the given motion. ``FreeRun``
simulates all channels, where a subsystem has no signal. Each residual is smooth in its parameters, which a free run
with stick and slip is not. To add a subsystem, write one module and one line in :func:`residual_models`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from pneucli.identify.residuals.base import ResidualModel
from pneucli.identify.residuals.chambers import ChamberPressures
from pneucli.identify.residuals.force_balance import ForceBalance, ForceBalanceInferredP2
from pneucli.identify.residuals.free_run import FreeRun, ImposedMotion
from pneucli.simulate.experiment import Experiment

__all__ = [
    "ChamberPressures",
    "ForceBalance",
    "ForceBalanceInferredP2",
    "FreeRun",
    "ImposedMotion",
    "ResidualModel",
    "residual_models",
    "with_channel_weights",
]


def residual_models(experiments: Sequence[Experiment], *, whiten_initial_state: bool = False) -> list[ResidualModel]:
    """Build the residual models that the recorded signals of each experiment allow.

    Args:
        experiments: The experiments.
        whiten_initial_state: Whether chamber pressures are whitened for the errors of their initial states.

    Returns:
        The residual models with at least one channel.

    """
    return [
        model
        for e in experiments
        for model in _models_of_recording(e, whiten_initial_state=whiten_initial_state)
        if model.channels
    ]


def _models_of_recording(e: Experiment, *, whiten_initial_state: bool) -> list[ResidualModel]:
    if e.recording.imposed == "motion":
        return [ImposedMotion(e)]
    if e.recording.kind.vessel:
        return [ChamberPressures(e, whiten_initial_state)]
    if not e.motion_is_known:
        return [FreeRun(e)]
    if not e.recording.kind.valve:
        return [ForceBalance(e)]
    return [
        ForceBalanceInferredP2(e) if e.infers_p2 else ForceBalance(e),
        ChamberPressures(e.without_mechanics(), whiten_initial_state),
    ]


def with_channel_weights(models: Sequence[ResidualModel], weights: Mapping[Any, float]) -> list[ResidualModel]:
    """Weight the channels of residual models; a fit multiplies the residuals by these weights.

    Args:
        models: The residual models.
        weights: Weights by channel, 1 where absent.

    Returns:
        The weighted residual models.

    """
    return [replace(model, weights=weights) for model in models] if weights else list(models)
