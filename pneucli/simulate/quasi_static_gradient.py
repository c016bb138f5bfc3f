"""The pressure gradient of a valve on a vessel at held commands, by the kernel's own equations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.run import base_vector, kernel_for

Array = NDArray[np.float64]


@dataclass(frozen=True)
class QuasiStaticGradient:
    """The pressure gradient of a model at held commands, without memory, for the vessel of a valve test."""

    model: Model
    experiment: Experiment

    def __call__(self, u: Array, p: Array, supply: Array) -> Array:
        """Return the gradient as the sensor reads it.

        Args:
            u: Command in V from the null command.
            p: Pressure in Pa.
            supply: Supply pressure in Pa; all three of one shape.

        Returns:
            Gradient in Pa/s, of the same shape.

        References:
            Thesis 7.4.
        """
        out = np.empty(u.size)
        self._gradient(u.ravel(), p.ravel(), supply.ravel(), *self._fixed, out)
        return out.reshape(u.shape)

    @cached_property
    def _fixed(self) -> tuple[Array, Array, NDArray[np.uint8], float, Array]:
        kernel = kernel_for(self.model.effects)
        active = kernel.effect_switches(self.experiment.active_effects(self.model.effects))
        base, th = base_vector(self.model, self.experiment), kernel.effect_vector(self.model.effect_values())
        valve = self.model.valve_of_chamber(self.experiment.recording.chamber)
        largest = max(float(self.experiment.flags[at.U_MAX]), *map(abs, valve.commands))
        return base, th, active, largest, valve.table(largest)

    @cached_property
    def _gradient(self):  # type: ignore[no-untyped-def]
        return kernel_for(self.model.effects).functions.run_gradient
