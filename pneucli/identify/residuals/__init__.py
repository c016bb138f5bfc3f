"""What a recording says of a part of the rig: residuals of one subsystem at a time, the rest fed with measurements.

``Chambers``: the pressures are simulated with the measured motion, so friction has no say. ``Forces``: the measured
motion and pressures leave a friction force, which is held against the model's set of possible ones, so the gas has no
say. ``Inferred``: the same where p2 was not recorded, with that of the model. ``Imposed``: the force that the model
needs for the given motion against the measured one. ``Whole``: all channels simulated, where a subsystem lacks a
signal. Each view is smooth in its parameters, which a free run with stick and slip is not. One module each; a new
subsystem is one more, and a line in :func:`residual_models`.
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
    """Return the views that the recorded signals allow; ``whiten_initial_state`` chambers are so for the errors of their starts."""
    return [
        view for e in experiments for view in _models_of_recording(e, whitened=whiten_initial_state) if view.channels
    ]


def _models_of_recording(e: Experiment, *, whitened: bool) -> list[ResidualModel]:
    if e.recording.imposed == "motion":
        return [ImposedMotion(e)]
    if e.recording.kind.vessel:
        return [ChamberPressures(e, whitened)]
    if "x" not in e.raw:
        return [FreeRun(e)]
    if not e.recording.kind.valve:
        return [ForceBalance(e)]
    return [
        ForceBalanceInferredP2(e) if e.infers_p2 else ForceBalance(e),
        ChamberPressures(e.without_mechanics(), whitened),
    ]


def with_channel_weights(views: Sequence[ResidualModel], weights: Mapping[Any, float]) -> list[ResidualModel]:
    """Return the views with weights by channel, by which a fit multiplies their residuals; 1 where none is given."""
    return [replace(view, weights=weights) for view in views] if weights else list(views)
