"""Residuals of a free run of all channels, and of the force that a given motion needs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pneucli.arrays import Array
from pneucli.identify.residuals.base import (
    DiscrepancyTerm,
    ResidualModel,
    bounded_difference,
    force_discrepancy_terms,
)
from pneucli.physics.ports import Balance
from pneucli.simulate.model import Model
from pneucli.simulate.outputs import simulate_outputs


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
