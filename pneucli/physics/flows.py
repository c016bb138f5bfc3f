"""The flow function over whole arrays: :mod:`pneucli.physics.gas` itself, called for each element."""

import numpy as np
from numpy.typing import NDArray

from pneucli.physics import gas

Array = NDArray[np.float64]

flow_functions = np.vectorize(gas.flow_function, otypes=[np.float64])
_orifice_flows = np.vectorize(gas.orifice_flow, otypes=[np.float64])


def orifice_flows(p_from: Array, p_to: Array | float, b: float, k_from: float, k_to: float) -> Array:
    """Return :func:`gas.orifice_flow` (n,); NaN where a reading is none."""
    with np.errstate(invalid="ignore"):
        return np.asarray(_orifice_flows(p_from, p_to, b, k_from, k_to))
