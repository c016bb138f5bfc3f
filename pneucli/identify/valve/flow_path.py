"""One flow path of a valve on a steady bench: C, b, m and cracking pressure, with their intervals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pneucli.arrays import Array
from pneucli.figure import Figure
from pneucli.identify.valve.steady_rows import FlowRows
from pneucli.physics.iso_flow import FlowCharacteristics, iso_mass_flow


@dataclass(frozen=True)
class FlowPath:
    """The characteristics of one flow path, and how far its rows lie from them.

    Attributes:
        rows: The rows that were fitted.
        characteristics: C, b, m and cracking pressure.
        C: Sonic conductance in m^3/(s Pa) at the reference atmosphere.
        b: Critical ratio.
        m: Subsonic index.
        cracking: Cracking pressure in Pa; None where the rows show none.
        covariance: Covariance of (log C, b, m, cracking pressure in Pa), shape (4, 4).
        quantile: Student quantile of the intervals.
        deviation: Standard deviation of the noise of each row in kg/s, shape (n,).
    """

    rows: FlowRows
    characteristics: FlowCharacteristics
    C: Figure
    b: Figure
    m: Figure
    cracking: Figure | None
    covariance: Array
    quantile: float
    deviation: Array

    @property
    def residual(self) -> Array:
        """Measured less fitted flow in kg/s, shape (n,)."""
        return self.rows.flow - self.flow(self.rows.upstream, self.rows.downstream, self.rows.temperature)

    def flow(self, upstream: Array, downstream: Array, temperature: Array | float) -> Array:
        """Return the flow in kg/s at pressures (Pa) and temperatures (K), each (n,)."""
        return iso_mass_flow(self.characteristics, upstream, downstream, temperature)

    def flow_error(self, upstream: Array, downstream: Array, temperature: float) -> Array:
        """Return the half width of the 95 % interval of the flow in kg/s, shape (n,)."""
        z = coordinates_of(self.characteristics)
        steps = np.array([1e-4, 1e-4, 1e-4, max(1e-3 * self.characteristics.cracking_pressure, 1.0)])
        rows = []
        for i, step in enumerate(steps):
            ends = []
            for side in (step, -step):
                moved = z.copy()
                moved[i] += side
                at = characteristics_at(moved, abrupt=self.characteristics.opens_abruptly)
                ends.append(iso_mass_flow(at, upstream, downstream, temperature))
            rows.append((ends[0] - ends[1]) / (2 * step))
        slope = np.array(rows)
        variance = np.einsum("in,ij,jn->n", slope, self.covariance, slope)
        return np.asarray(self.quantile * np.sqrt(np.maximum(variance, 0.0)))


def characteristics_at(z: Array, *, abrupt: bool) -> FlowCharacteristics:
    """Return the characteristics at z, shape (4,): log C (m^3/(s Pa)), b, m, cracking pressure in Pa."""
    return FlowCharacteristics(float(np.exp(z[0])), float(z[1]), float(z[2]), max(float(z[3]), 0.0), abrupt)


def coordinates_of(of: FlowCharacteristics) -> Array:
    """Return the coordinates, shape (4,), of characteristics: log C (m^3/(s Pa)), b, m, cracking pressure in Pa."""
    return np.array([np.log(of.sonic_conductance), of.critical_ratio, of.subsonic_index, of.cracking_pressure])
