"""The flow function over whole arrays: :mod:`pneucli.physics.gas` itself, called for each element."""

import numpy as np

from pneucli.physics import gas

flow_functions = np.vectorize(gas.flow_function, otypes=[np.float64])
orifice_flows = np.vectorize(gas.orifice_flow, otypes=[np.float64])
