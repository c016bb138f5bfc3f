"""How long a step of the kernel may be."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pneucli.recording import Rig

Array = NDArray[np.float64]

STEPS = 150.0  # at least, while the supply's force moves the mass over the stroke
FILLING = 300.0  # while a chamber whose volume is known would be filled at the highest rate seen
HALF = 0.5  # of a sampling period, at most: a recording at rest does not tell how fast a command fills
SHORT = 0.5e-3  # s: of a step that is shorter, a sampling period may be one
PARTS = 4.0  # of a sampling period, where the rig does not tell how fast its piston may be
USUALLY = 0.99  # of the samples: what is faster is noise or an instant


def longest_step(rig: Rig, period: float) -> float:
    """Return the longest step in s, where a piston moves; from the sampling ``period`` (s) if need be."""
    if not (rig.supply_pressure and rig.piston_area_1 and rig.stroke and rig.moving_mass):
        return period / PARTS
    force = abs(rig.supply_pressure - rig.ambient_pressure) * rig.piston_area_1
    return float(np.sqrt(rig.moving_mass * rig.stroke / force)) / STEPS if force > 0.0 else period / PARTS


def filling_step(pressure: Array, slope: Array, period: float) -> float:
    """Return the longest step in s of a chamber that showed such a pressure in Pa and its slope in Pa/s, each (n,).

    At most half the sampling ``period`` (s), or all of one that is short itself: how often a logger samples does not
    change how fast a chamber fills.
    """
    most = min(max(HALF * period, SHORT), period)
    fastest = float(np.quantile(np.abs(slope), USUALLY))
    return min(most, float(pressure.max()) / (FILLING * fastest)) if fastest > 0.0 else most
