"""Flow and friction over whole arrays: the scalar functions of the simulator, called for each element."""

import numpy as np

from pneucli.arrays import Array
from pneucli.physics import gas
from pneucli.physics.effects.stribeck import dry_rise


def flow_functions(r: Array, b: float) -> Array:
    """Return :func:`pneucli.physics.gas.flow_function` of an array.

    Args:
        r: Pressure ratio, downstream over upstream, both absolute, shape (n,).
        b: Critical pressure ratio.

    Returns:
        Psi'(r), dimensionless, shape (n,); NaN where the ratio is NaN.

    References:
        Thesis 2.42, 2.43.

    >>> flow_functions(np.array([0.4, 0.9, 1.2, np.nan]), 0.528).round(4)
    array([0.484 , 0.2979, 0.    ,    nan])
    """
    s = (np.asarray(r, dtype=np.float64) - b) / (1.0 - b)
    inside = gas.PSI_MAX * np.sqrt(np.maximum(1.0 - s * s, 0.0))
    return np.asarray(np.where(r <= b, gas.PSI_MAX, np.where(r >= 1.0, 0.0, inside)))


def orifice_flows(p_from: Array, p_to: Array | float, b: float, k_from: float, k_to: float) -> Array:
    """Return the mass flow through an orifice per effective area for arrays of pressures.

    Args:
        p_from: Absolute pressure on the side where a positive flow leaves, in Pa, shape (n,).
        p_to: Absolute pressure on the other side, in Pa, shape (n,) or a number.
        b: Critical pressure ratio.
        k_from: Flow constant of the gas on the first side, in s/m (:func:`pneucli.physics.gas.flow_constant`).
        k_to: The same of the other side.

    Returns:
        Mass flow over effective area in kg/(s m^2), shape (n,); NaN where a pressure is NaN.

    References:
        Thesis 2.46.

    >>> k = gas.flow_constant(287.0, 293.15, 1.4)
    >>> orifice_flows(np.array([7e5, 1e5, np.nan]), 1e5, 0.528, k, k).round(1)
    array([1651.9,    0. ,    nan])
    """
    forward = np.asarray(p_from >= p_to)
    upstream, downstream = np.where(forward, p_from, p_to), np.where(forward, p_to, p_from)
    return np.asarray(upstream * np.where(forward, k_from, -k_to) * flow_functions(downstream / upstream, b))


def stribeck_friction(v: Array, coulomb: float, viscous: float, static: float, velocity: float = np.inf) -> Array:
    """Return Stribeck friction in the form of Hess and Soom.

    Args:
        v: Velocity in m/s, shape (n,).
        coulomb: Coulomb friction in N.
        viscous: Viscous friction in N s/m.
        static: Static friction in N; equal to ``coulomb`` it leaves Coulomb and viscous friction.
        velocity: Stribeck velocity in m/s.

    Returns:
        Friction in N with the sign of v, shape (n,); 0 at standstill, where friction is a set of forces.

    References:
        Thesis 3.3, 3.4, 3.6; D. P. Hess and A. Soom, ASME J. Tribology 112 (1990) 147-152.

    >>> stribeck_friction(np.array([-0.02, 0.0, 0.02]), 3.0, 15.0, 5.0, 0.02)
    array([-4.3,  0. ,  4.3])
    """
    rise: Array = np.asarray(dry_rise(coulomb, v, static, velocity))  # type: ignore[arg-type]
    return (coulomb + rise) * np.sign(v) + viscous * v
