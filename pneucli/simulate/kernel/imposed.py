"""The driving force that a model needs for a given motion."""

from pneucli.simulate.kernel.friction import bristle_force, friction_levels
from pneucli.simulate.kernel.ports import bristle_stiffness, force, mass, scalars, sensor_lag, viscous_factor
from pneucli.simulate.kernel.sensors import true_pressures
from pneucli.simulate.layout import AMBIENT, AREA_1, AREA_2, IN_V, IN_X, MASS, STROKE, VISCOUS


def net_pressure_force(pressures, k, base):
    """Return the net force in N of the pressures above ambient on the piston at sample k.

    Args:
        pressures: Pressures of both chambers in Pa, shape (n, 2).
        k: Index of the sample.
        base: Base parameters by :mod:`pneucli.simulate.layout`: areas in m^2, ambient pressure in Pa.

    References:
        Thesis (2.47); with a rod, ambient pressure acts on the difference of the areas.

    >>> import numpy as np
    >>> base = np.zeros(19)
    >>> base[AMBIENT], base[AREA_1], base[AREA_2] = 1e5, 8e-4, 6e-4
    >>> print(round(net_pressure_force(np.array([[6e5, 2e5]]), 0, base), 9))  # 8e-4 x 5e5 - 6e-4 x 1e5
    340.0
    """
    return base[AREA_1] * (pressures[k, 0] - base[AMBIENT]) - base[AREA_2] * (pressures[k, 1] - base[AMBIENT])


def run_imposed(time, inputs, a, v_still, driven, base_values, th_values, on_values, out):
    """Write the driving force that a model needs for a given motion.

    Within ``v_still`` dry friction is proportional to the velocity: there the motion does not determine its sign.

    Args:
        time: Time stamps in s, shape (n,).
        inputs: Inputs in the kernel's layout, shape (n, 8).
        a: Acceleration in m/s^2, shape (n,).
        v_still: Speed in m/s below which the direction is uncertain.
        driven: Whether a driving force was measured; the force of the pressures is then subtracted.
        base_values: Base parameters, shape (19,).
        th_values: Parameters of effects.
        on_values: Switches of effects.
        out: Filled with the force in N, shape (n,).
    """
    base, th, on = scalars(base_values, th_values, on_values)
    m, stiffness, z = base[MASS] + mass(th, on), bristle_stiffness(th, on), 0.0
    true = true_pressures(time, inputs, sensor_lag(th, on), base, th, on)
    for k in range(time.size):
        x, v, p1, p2 = inputs[k, IN_X], inputs[k, IN_V], true[k, 0], true[k, 1]
        direction = 1.0 if v >= 0.0 else -1.0
        rising, falling = friction_levels(direction, abs(v), x, p1, p2, base, th, on)
        level = falling if a[k] * direction < 0.0 else rising
        c = base[VISCOUS] * viscous_factor(direction, th, on)
        friction = level * min(max(v / v_still, -1.0), 1.0) + c * v
        if stiffness > 0.0:
            dx, h = x - inputs[max(k - 1, 0), IN_X], time[k] - time[max(k - 1, 0)]
            z, friction = bristle_force(z, dx, h, max(level, 1e-9), stiffness, th, on)
            friction += c * v
        known = net_pressure_force(true, k, base) if driven else 0.0
        out[k] = m * a[k] + friction - force(x, v, base[STROKE], th, on) - known
