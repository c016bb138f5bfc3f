"""A piston under measured forces whose friction is a table over speed, with exact sticking.

A table holds N, shape (2, 2, n): toward +x and -x, speeding up and slowing, at speeds step/2, 3 step/2, ... in m/s.
"""

from pneucli.simulate.kernel.ports import force, scalars
from pneucli.simulate.layout import *


def table_friction_force(tables, side, branch, step, speed):
    """Return friction in N at a speed; constant beyond both ends of the table.

    Args:
        tables: Friction in N, shape (2, 2, n), as above.
        side: 0 toward +x, 1 toward -x.
        branch: 0 while speeding up, 1 while slowing.
        step: Step of the table in m/s.
        speed: Speed in m/s.

    >>> import numpy as np
    >>> tables = np.array([[[10.0, 20.0, 30.0]] * 2] * 2)
    >>> [float(table_friction_force(tables, 0, 0, 0.1, speed)) for speed in (0.0, 0.1, 9.0)]
    [10.0, 15.0, 30.0]
    """
    at, last = speed / step - 0.5, tables.shape[2] - 1
    if at <= 0.0:
        return tables[side, branch, 0]
    i = int(at)
    if i >= last:
        return tables[side, branch, last]
    low = tables[side, branch, i]
    return low + (at - i) * (tables[side, branch, i + 1] - low)


def table_net_force(along, speed, side, tables, step, speeding_up):
    """Return the net force along the motion in N and the branch.

    Where the drive lies between both branches neither holds and the velocity is constant (Filippov); where it agrees
    with both, the branch is kept.
    """
    rising, falling = (
        table_friction_force(tables, side, 0, step, speed),
        table_friction_force(tables, side, 1, step, speed),
    )
    if along > rising and (along >= falling or speeding_up):
        return along - rising, True
    if along < falling:
        return along - falling, False
    return 0.0, speeding_up


def table_acceleration(drive, x, v, m, tables, step, speeding_up, stroke, th, on):
    """Return dv/dt in m/s^2 under the drive and the effects' forces; 0 while friction holds."""
    push = drive + force(x, v, stroke, th, on)
    toward = v if v != 0.0 else push
    side, direction = (0, 1.0) if toward > 0.0 else (1, -1.0)
    if v == 0.0:
        return direction * max(direction * push - tables[side, 0, 0], 0.0) / m
    net, _ = table_net_force(direction * push, direction * v, side, tables, step, speeding_up)
    return direction * net / m


def table_slide(drive, x, v, h, m, tables, step, speeding_up, stroke, th, on):
    """Return velocity and branch after a midpoint step of h; a piston that would reverse stops first."""
    if v == 0.0:
        a = table_acceleration(drive, x, v, m, tables, step, True, stroke, th, on)
        if a == 0.0:
            return 0.0, True
        return 0.5 * h * (a + table_acceleration(drive, x, a * h, m, tables, step, True, stroke, th, on)), True
    side, direction = (0, 1.0) if v > 0.0 else (1, -1.0)
    speed = direction * v
    along = direction * (drive + force(x, v, stroke, th, on))
    net, _ = table_net_force(along, speed, side, tables, step, speeding_up)
    middle = max(speed + 0.5 * h * net / m, 0.0)
    along = direction * (drive + force(x, direction * middle, stroke, th, on))
    net, speeding_up = table_net_force(along, middle, side, tables, step, speeding_up)
    return direction * max(speed + h * net / m, 0.0), speeding_up


def run_table_friction(time, drive, x, v_start, m, tables, step, parts, base_values, th_values, on_values, out):
    """Write velocity and acceleration of a piston under measured forces.

    Drive and position are linear between samples.

    Args:
        time: Time stamps in s, shape (n,).
        drive: Driving force in N, shape (n,).
        x: Measured position in m, shape (n,).
        v_start: Velocity at the first sample in m/s.
        m: Mass in kg.
        tables: Friction in N, shape (2, 2, k).
        step: Step of the tables in m/s.
        parts: Steps between two samples.
        base_values: Base parameters, shape (19,).
        th_values: Parameters of effects.
        on_values: Switches of effects.
        out: Filled with v in m/s and a in m/s^2, shape (2, n).
    """
    base, th, on = scalars(base_values, th_values, on_values)
    stroke, v, speeding_up = base[STROKE], v_start, True
    for k in range(time.size):
        out[0, k] = v
        out[1, k] = table_acceleration(drive[k], x[k], v, m, tables, step, speeding_up, stroke, th, on)
        if k == time.size - 1:
            break
        h = (time[k + 1] - time[k]) / parts
        for j in range(parts):
            w = (j + 0.5) / parts
            now, place = drive[k] + w * (drive[k + 1] - drive[k]), x[k] + w * (x[k + 1] - x[k])
            v, speeding_up = table_slide(now, place, v, h, m, tables, step, speeding_up, stroke, th, on)


def run_forces(x, v, base_values, th_values, on_values, out):
    """Write the forces of effects on the piston.

    Args:
        x: Position in m, shape (n,).
        v: Velocity in m/s, shape (n,).
        base_values: Base parameters, shape (19,).
        th_values: Parameters of effects.
        on_values: Switches of effects.
        out: Filled with the force in N toward +x, shape (n,).
    """
    base, th, on = scalars(base_values, th_values, on_values)
    for k in range(x.size):
        out[k] = force(x[k], v[k], base[STROKE], th, on)
