"""Friction over velocity (thesis 3.1-3.6), vectorised; N, m/s, N s/m. The rise is that of the effect ``stribeck``."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pneucli.physics.effects.stribeck import dry_rise

Array = NDArray[np.float64]


def stribeck(v: Array, coulomb: float, viscous: float, static: float, velocity: float = np.inf) -> Array:
    """Return Stribeck friction in the form of Hess and Soom (3.6); 0 at standstill, where friction is a set.

    ``static`` = ``coulomb`` makes it Coulomb and viscous friction (3.3, 3.4).
    """
    rise: Array = np.asarray(dry_rise(coulomb, v, static, velocity))  # type: ignore[arg-type]
    return (coulomb + rise) * np.sign(v) + viscous * v
