"""The flow function over whole arrays: :mod:`pneucli.physics.gas` itself, called for each element."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pneucli.physics import gas
from pneucli.physics.effects.stribeck import dry_rise

Array = NDArray[np.float64]

flow_functions = np.vectorize(gas.flow_function, otypes=[np.float64])
_orifice_flows = np.vectorize(gas.orifice_flow, otypes=[np.float64])


def orifice_flows(p_from: Array, p_to: Array | float, b: float, k_from: float, k_to: float) -> Array:
    """Return :func:`gas.orifice_flow` (n,); NaN where a reading is none."""
    with np.errstate(invalid="ignore"):
        return np.asarray(_orifice_flows(p_from, p_to, b, k_from, k_to))


def stribeck_friction(v: Array, coulomb: float, viscous: float, static: float, velocity: float = np.inf) -> Array:
    """Return Stribeck friction in the form of Hess and Soom (3.6); 0 at standstill, where friction is a set.

    ``static`` = ``coulomb`` makes it Coulomb and viscous friction (3.3, 3.4).
    """
    rise: Array = np.asarray(dry_rise(coulomb, v, static, velocity))  # type: ignore[arg-type]
    return (coulomb + rise) * np.sign(v) + viscous * v
