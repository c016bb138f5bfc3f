"""The driving force that the model needs for a given motion."""

from pneucli.simulate.kernel.friction import bristle_force, friction_levels
from pneucli.simulate.kernel.ports import bristle_stiffness, force, mass, scalars, sensor_lag, viscous_factor
from pneucli.simulate.kernel.sensors import true_pressures
from pneucli.simulate.layout import AMBIENT, AREA_1, AREA_2, IN_V, IN_X, MASS, STROKE, VISCOUS


def net_pressure_force(pressures, k, base):
    """Force in N of the pressures on the piston at sample k, over that of the ambient pressure."""
    return base[AREA_1] * (pressures[k, 0] - base[AMBIENT]) - base[AREA_2] * (pressures[k, 1] - base[AMBIENT])


def run_imposed(time, inputs, a, v_still, driven, base_values, th_values, on_values, out):
    """Write the driving force in N that the model needs for a given motion, shape (n,): the net force of the pressures,
    or what is left to a measured one beside them, where it is ``driven`` by one.

    Within ``v_still`` dry friction goes through zero in a straight line: what it is at rest, motion does not tell.
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
