"""Residual models: one subsystem of a recording at a time, the rest fed with measurements.

``ChamberPressures`` simulates the pressures with the measured motion, so friction does not matter. ``ForceBalance``
compares the friction force that measured motion and pressures imply with the set of forces that the model allows, so
the gas does not matter. ``ForceBalanceInferredPressure`` does so with the model's pressures where none was recorded.
``ImposedMotion`` compares the measured force with the force that the model needs for the given motion. ``FreeRun``
simulates all channels, where a subsystem has no signal. Each residual is smooth in its parameters, which a free run
with stick and slip is not. To add a subsystem, write one module and one line in :func:`residual_models`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from pneucli.arrays import Array
from pneucli.identify.residuals.base import DiscrepancyTerm, ResidualModel, bounded_difference, force_discrepancy_terms
from pneucli.identify.residuals.chambers import ChamberPressures, ForceBalance, ForceBalanceInferredPressure
from pneucli.physics.ports import Balance
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.outputs import simulate_outputs

__all__ = [
    "ChamberPressures",
    "ForceBalance",
    "ForceBalanceInferredPressure",
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
        ForceBalanceInferredPressure(e) if e.inferred_pressures else ForceBalance(e),
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


@dataclass(frozen=True)
class FreeRun(ResidualModel):
    """All channels simulated together, where a subsystem has no signal."""

    title: ClassVar[str] = "the complete simulation"
    balances: ClassVar[frozenset[Balance]] = frozenset({"gas", "mechanics", "friction", "pressure sensor"})
    base_groups: ClassVar[frozenset[str]] = frozenset({"rig", "friction", "valve"})
    predicts_force: ClassVar[bool] = True

    def residual(self, model: Model, errors: Mapping[str, Array] | None = None) -> dict[str, Array]:
        """Return measured minus model by channel."""
        modelled = simulate_outputs(model, self.experiment)
        return {c: bounded_difference(self.measured[c], modelled[c], self.noise[c]) for c in self.channels}


@dataclass(frozen=True)
class ImposedMotion(FreeRun):
    """The measured force compared with the force that the model needs for the measured motion."""

    title: ClassVar[str] = "mechanics: friction, load or a force on the piston"
    balances: ClassVar[frozenset[Balance]] = frozenset({"mechanics", "friction", "pressure sensor"})
    base_groups: ClassVar[frozenset[str]] = frozenset({"rig", "friction"})
    predicts_force: ClassVar[bool] = False
    is_simulated: ClassVar[bool] = False

    def discrepancy_terms(self, model: Model, channel: str) -> Sequence[DiscrepancyTerm]:
        """Return the forms of a missing force or friction."""
        return force_discrepancy_terms(self.experiment, self.noise[channel])

    def apply_whitening(self, residual: Mapping[str, Array], errors: Mapping[str, Array]) -> dict[str, Array]:
        """Return the residuals, 0 where the motion does not determine the force, which is not compared there."""
        return {c: np.where(self.experiment.force_is_determined, r, 0.0) for c, r in residual.items()}
