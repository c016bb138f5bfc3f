"""The flow function, and the flow of gas through an orifice (thesis 2.34-2.46).

Functions take and return scalars and use nothing but ``math`` and the constants here, since the simulation kernel
compiles their source. :mod:`pneucli.physics.vectorised` calls them for whole arrays.
"""

import math

PSI_MAX = 0.484  # maximum of the flow function for kappa = 1.4 (thesis 2.38)
VISCOSITY = 1.82e-5  # Pa s, of air at 20 degC
CRITICAL_RATIO = 0.528  # pressure ratio at which it is reached (thesis 2.37)


def flow_function(r: float, b: float) -> float:
    """Return the elliptic approximation of the outflow function.

    Args:
        r: Pressure ratio, downstream over upstream, both absolute.
        b: Critical pressure ratio; the flow is choked for r <= b.

    Returns:
        Psi'(r), dimensionless: 0.484 for r <= b, 0 for r >= 1, an ellipse in between. With b = 0.528 it differs from
        the isentropic function of air by at most 0.2 % of the maximum.

    References:
        Thesis 2.42, 2.43; ISO 6358-1:2013.

    >>> flow_function(0.4, 0.528)
    0.484
    >>> round(flow_function(0.9, 0.528), 4)
    0.2979
    """
    if r <= b:
        return PSI_MAX
    if r >= 1.0:
        return 0.0
    s = (r - b) / (1.0 - b)
    return PSI_MAX * math.sqrt(1.0 - s * s)


def orifice_flow(p_from: float, p_to: float, b: float, k_from: float, k_to: float) -> float:
    """Return the mass flow through an orifice per effective area.

    Args:
        p_from: Absolute pressure on the side where a positive flow leaves, in Pa.
        p_to: Absolute pressure on the other side, in Pa.
        b: Critical pressure ratio.
        k_from: :func:`flow_constant` of the gas on that first side, in s/m.
        k_to: The same of the gas on the other side; the upstream one counts.

    Returns:
        Mass flow over effective area in kg/(s m^2); negative where ``p_to`` is higher.

    References:
        Thesis 2.46.

    >>> k = flow_constant(287.0, 293.15, 1.4)
    >>> round(orifice_flow(7e5, 1e5, 0.528, k, k), 1)
    1651.9
    >>> orifice_flow(1e5, 7e5, 0.528, k, k) == -orifice_flow(7e5, 1e5, 0.528, k, k)
    True
    """
    if p_from >= p_to:
        return p_from * k_from * flow_function(p_to / p_from, b)
    return -p_to * k_to * flow_function(p_from / p_to, b)


def isentropic_flow_function(r: float, kappa: float) -> float:
    """Return the outflow function of isentropic flow.

    Args:
        r: Pressure ratio, downstream over upstream, both absolute.
        kappa: Ratio of heat capacities.

    Returns:
        Psi(r), dimensionless; its maximum below the critical ratio.

    References:
        Thesis 2.34.

    >>> round(isentropic_flow_function(0.9, 1.4), 4)
    0.2988
    """
    r = min(max(r, choked_ratio(kappa)), 1.0)
    return math.sqrt(kappa / (kappa - 1.0) * (r ** (2.0 / kappa) - r ** ((kappa + 1.0) / kappa)))


def flow_scale(kappa: float) -> float:
    """Return the maximum of the outflow function relative to that of a gas with kappa = 1.4.

    Args:
        kappa: Ratio of heat capacities.

    Returns:
        The ratio of both maxima, dimensionless.

    References:
        Thesis 2.37, 2.38.

    >>> round(flow_scale(5.0 / 3.0), 4)
    1.0605
    """
    return choked_maximum(kappa) / choked_maximum(1.4)


def choked_maximum(kappa: float) -> float:
    """Return the maximum of the outflow function, reached at the critical ratio.

    Args:
        kappa: Ratio of heat capacities.

    Returns:
        Psi of choked flow, dimensionless.

    References:
        Thesis 2.38.

    >>> round(choked_maximum(1.4), 4)
    0.4842
    """
    return math.sqrt(kappa / (kappa + 1.0)) * math.pow(2.0 / (kappa + 1.0), 1.0 / (kappa - 1.0))


def critical_ratio_of(kappa: float) -> float:
    """Return the critical pressure ratio of a gas, scaled to ``CRITICAL_RATIO`` for kappa = 1.4.

    Args:
        kappa: Ratio of heat capacities.

    Returns:
        Critical ratio, dimensionless.

    References:
        Thesis 2.37.

    >>> critical_ratio_of(1.4)
    0.528
    >>> round(critical_ratio_of(5.0 / 3.0), 4)
    0.4869
    """
    return CRITICAL_RATIO * choked_ratio(kappa) / choked_ratio(1.4)


def choked_ratio(kappa: float) -> float:
    """Return the pressure ratio at which the outflow function has its maximum.

    Args:
        kappa: Ratio of heat capacities.

    Returns:
        Critical ratio, dimensionless.

    References:
        Thesis 2.37.

    >>> round(choked_ratio(1.4), 4)
    0.5283
    """
    return math.pow(2.0 / (kappa + 1.0), kappa / (kappa - 1.0))


def flow_constant(gas_constant: float, temperature: float, kappa: float) -> float:
    """Return the factor sqrt(2 / (R T)) of :func:`orifice_flow`, scaled for the gas.

    Args:
        gas_constant: Specific gas constant in J/(kg K).
        temperature: Absolute temperature upstream in K.
        kappa: Ratio of heat capacities.

    Returns:
        Flow constant in s/m.

    References:
        Thesis 2.46.

    >>> round(flow_constant(287.0, 293.15, 1.4), 6)
    0.004876
    """
    return flow_scale(kappa) * math.sqrt(2.0 / (gas_constant * temperature))
