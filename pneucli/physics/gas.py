"""Gas flow through an orifice (thesis 2.34-2.46).

The functions take and return scalars and use nothing but ``math`` and the constants here, since the simulation kernel
compiles their source; :mod:`pneucli.physics.vectorised` calls them for whole arrays.
"""

import math

PSI_MAX = 0.484  # maximum of the flow function for kappa = 1.4 (thesis 2.38)
CRITICAL_RATIO = 0.528  # pressure ratio at which it is reached (thesis 2.37)


def flow_function(r: float, b: float) -> float:
    """Return Psi'(r), the ellipse that approximates the outflow function (thesis 2.42, 2.43).

    ``r`` is downstream over upstream pressure, ``b`` the critical ratio; choked for r <= b, zero for r >= 1.
    With b = 0.528 it errs by at most 0.2 % of its maximum against the exact isentropic function (2.34).
    """
    if r <= b:
        return PSI_MAX
    if r >= 1.0:
        return 0.0
    s = (r - b) / (1.0 - b)
    return PSI_MAX * math.sqrt(1.0 - s * s)


def orifice_flow(p_from: float, p_to: float, b: float, k_from: float, k_to: float) -> float:
    """Return the mass flow per effective area in kg/(s m^2), positive from ``p_from`` to ``p_to`` (thesis 2.46).

    Pressures absolute in Pa; ``k = sqrt(2 / (R T))`` of the gas on each side, of which the upstream one counts; for
    another gas than air see :func:`flow_constant`.
    """
    if p_from >= p_to:
        return p_from * k_from * flow_function(p_to / p_from, b)
    return -p_to * k_to * flow_function(p_from / p_to, b)


def exact_flow_function(r: float, kappa: float) -> float:
    """Return Psi(r) of isentropic flow (thesis 2.34), held at its maximum below the critical ratio."""
    r = min(max(r, choked_ratio(kappa)), 1.0)
    return math.sqrt(kappa / (kappa - 1.0) * (r ** (2.0 / kappa) - r ** ((kappa + 1.0) / kappa)))


def flow_scale(kappa: float) -> float:
    """Return the maximum of the flow function over that for kappa = 1.4 (thesis 2.37, 2.38)."""
    return choked_maximum(kappa) / choked_maximum(1.4)


def choked_maximum(kappa: float) -> float:
    """Return the outflow function at its critical ratio."""
    return math.sqrt(kappa / (kappa + 1.0)) * math.pow(2.0 / (kappa + 1.0), 1.0 / (kappa - 1.0))


def critical_ratio_of(kappa: float) -> float:
    """Return the critical ratio of a gas; for kappa = 1.4 it is CRITICAL_RATIO."""
    return CRITICAL_RATIO * choked_ratio(kappa) / choked_ratio(1.4)


def choked_ratio(kappa: float) -> float:
    """Return the ratio at which the outflow function has its maximum (thesis 2.37)."""
    return math.pow(2.0 / (kappa + 1.0), kappa / (kappa - 1.0))


def flow_constant(gas_constant: float, temperature: float, kappa: float) -> float:
    """Return k of :func:`orifice_flow` in s/m for a gas of R in J/(kg K) at a temperature in K."""
    return flow_scale(kappa) * math.sqrt(2.0 / (gas_constant * temperature))
