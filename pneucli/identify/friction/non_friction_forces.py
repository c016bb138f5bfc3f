"""The model's forces, mass and sensor faults that are not friction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.simulate import layout as at
from pneucli.simulate.build import Kernel
from pneucli.simulate.force_clock import shifted
from pneucli.simulate.model import Model
from pneucli.simulate.run import kernel_for, read_only

REMOVED_BALANCES = {
    "mechanics",
    "pressure sensor",
}  # of ports; an accelerometer's bias is found from the motion itself


@dataclass(frozen=True)
class NonFrictionForces:
    """The equations of a model's effects at the ports of ``REMOVED_BALANCES``."""

    model: Model

    @property
    def effect_names(self) -> tuple[str, ...]:
        """The effects whose forces are removed before friction is identified."""
        return tuple(e.name for e in self.model.effects if REMOVED_BALANCES & e.balances)

    @property
    def added_mass(self) -> float:
        """The mass in kg that effects add to the rig's."""
        return self.model.sum_of_port("mass")

    def corrected_readings(self, time: Array, readings: Mapping[str, Array]) -> dict[str, Array]:
        """Return readings, each (n,), with the faults of the sensors of p1, p2 and force removed."""
        inputs = np.full((time.size, len(at.INPUTS)), self.model.rig.ambient_pressure)
        columns = {"p1": at.IN_P1, "p2": at.IN_P2}
        for name in columns.keys() & readings.keys():
            inputs[:, columns[name]] = readings[name]
        self._kernel.functions.run_true_pressures(read_only(time), inputs, *self._vectors)
        corrected = {n: inputs[:, columns[n]] if n in columns else y for n, y in readings.items()}
        if "force" in corrected and (delay := self.model.sum_of_port("force_delay")):
            corrected["force"] = shifted(time, corrected["force"], delay)
        return corrected

    def forces(self, x: Array, v: Array) -> Array:
        """Return the effects' forces toward +x in N, shape (n,), at positions in m and velocities in m/s."""
        out = np.zeros(x.size)
        self._kernel.functions.run_forces(x, v, *self._vectors, out)
        return out

    def simulate_driven(
        self, time: Array, drive: Array, x: Array, start: float, mass: float, tables: Array, step: float, parts: int
    ) -> Array:
        """Return v (m/s) and a (m/s^2), shape (2, n); see :func:`pneucli.simulate.kernel.table_friction.run_driven`."""
        out = np.zeros((2, time.size))
        self._kernel.functions.run_table_friction(
            time, drive, x, float(start), float(mass), tables, float(step), parts, *self._vectors, out
        )
        return out

    @property
    def _kernel(self) -> Kernel:
        return kernel_for(self.model.effects)

    @cached_property
    def _vectors(self) -> tuple[Array, Array, NDArray[np.uint8]]:
        base = self.model.base_values()
        return (
            np.array([base[name] for name in at.BASE_NAMES]),
            self._kernel.effect_vector(self.model.effect_values()),
            self._kernel.effect_switches([e.name for e in self.model.effects]),
        )
