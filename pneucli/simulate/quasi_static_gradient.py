"""The pressure gradient of a valve on a vessel at held commands, by the kernel's own equations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.simulate import layout as at
from pneucli.simulate.derivatives import Directions
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.run import base_vector, kernel_for

NO_SHAPES = np.zeros((0, 0))


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
        return self._run(u, p, supply, NO_SHAPES)[0]

    def area_derivatives(self, u: Array, p: Array, supply: Array, changes: Directions) -> Array:
        """Return the derivatives of the gradient by parameters of the valve's areas, of this model's changes.

        Args:
            u: Command in V from the null command.
            p: Pressure in Pa.
            supply: Supply pressure in Pa; all three of one shape.
            changes: The changes of the areas.

        Returns:
            Pa/s a unit of the parameter, shape ``u.shape + (parameters,)``.
        """
        return self._run(u, p, supply, changes.area_slopes(self.experiment.recording.chamber, self._largest))[1]

    def _run(self, u: Array, p: Array, supply: Array, shapes: Array) -> tuple[Array, Array]:
        out, derivatives = np.empty(u.size), np.empty((u.size, shapes.shape[1]))
        self._gradient(u.ravel(), p.ravel(), supply.ravel(), *self._fixed, out, shapes, derivatives)
        return out.reshape(u.shape), derivatives.reshape((*u.shape, shapes.shape[1]))

    @property
    def _largest(self) -> float:
        """The largest opening of the table of areas in V."""
        valve = self.model.valve_of_chamber(self.experiment.recording.chamber)
        return max(float(self.experiment.flags[at.U_MAX]), *map(abs, valve.commands))

    @cached_property
    def _fixed(self) -> tuple[Array, Array, NDArray[np.uint8], float, Array]:
        kernel = kernel_for(self.model.effects)
        active = kernel.effect_switches(self.experiment.active_effects(self.model.effects))
        base, th = base_vector(self.model, self.experiment), kernel.effect_vector(self.model.effect_values())
        valve = self.model.valve_of_chamber(self.experiment.recording.chamber)
        return base, th, active, self._largest, valve.table(self._largest)

    @cached_property
    def _gradient(self):  # type: ignore[no-untyped-def]
        return kernel_for(self.model.effects).functions.run_gradient
