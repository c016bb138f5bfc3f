"""Motion under a given driving force and tabulated friction with hysteresis, sticking exactly (numba)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pneucli.caches import compiled

Array = NDArray[np.float64]


@compiled()
def level(tables: Array, side: int, branch: int, step: float, speed: float) -> float:
    """Return friction (N) at ``speed`` from a table at speeds step/2, 3 step/2, ...; held beyond both ends."""
    at, last = speed / step - 0.5, tables.shape[2] - 1
    if at <= 0.0:
        return float(tables[side, branch, 0])
    k = int(at)
    if k >= last:
        return float(tables[side, branch, last])
    low = tables[side, branch, k]
    return float(low + (at - k) * (tables[side, branch, k + 1] - low))


@compiled()
def net(along: float, speed: float, tables: Array, side: int, step: float, speeding_up: bool) -> tuple[float, bool]:
    """Return the net force along the motion (N) and the branch.

    Where the drive lies between both branches neither holds and the velocity stays (Filippov); where it would agree
    with both, the branch stays.
    """
    rising, falling = level(tables, side, 0, step, speed), level(tables, side, 1, step, speed)
    if along > rising and (along >= falling or speeding_up):
        return along - rising, True
    if along < falling:
        return along - falling, False
    return 0.0, speeding_up


@compiled()
def acceleration(drive: float, v: float, mass: float, tables: Array, step: float, speeding_up: bool) -> float:
    """Return dv/dt in m/s^2 (0 where friction holds); ``tables`` is (2, 2, n): toward +x, -x; speeding up, slowing."""
    toward = v if v != 0.0 else drive
    side, direction = (0, 1.0) if toward > 0.0 else (1, -1.0)
    if v == 0.0:
        return float(direction * max(direction * drive - tables[side, 0, 0], 0.0) / mass)
    force, _ = net(direction * drive, direction * v, tables, side, step, speeding_up)
    return direction * force / mass


@compiled()
def advance(
    drive: float, v: float, h: float, mass: float, tables: Array, step: float, speeding_up: bool
) -> tuple[float, bool]:
    """Return velocity and branch after h (s) of midpoint steps; a piston that would turn rests first."""
    if v == 0.0:
        a = acceleration(drive, v, mass, tables, step, True)
        return 0.5 * h * (a + acceleration(drive, a * h, mass, tables, step, True)) if a != 0.0 else 0.0, True
    side, direction = (0, 1.0) if v > 0.0 else (1, -1.0)
    along, speed = direction * drive, direction * v
    force, _ = net(along, speed, tables, side, step, speeding_up)
    middle = max(speed + 0.5 * h * force / mass, 0.0)
    force, speeding_up = net(along, middle, tables, side, step, speeding_up)
    return direction * max(speed + h * force / mass, 0.0), speeding_up


@compiled()
def run(time: Array, drive: Array, v_start: float, mass: float, tables: Array, step: float, h_max: float) -> Array:
    """Return v (m/s) and a (m/s^2), shape (2, n), at ``time`` (s) under ``drive`` (N), linear between the samples."""
    out = np.zeros((2, time.size))
    v, speeding_up = v_start, True
    for k in range(time.size):
        out[0, k] = v
        out[1, k] = acceleration(drive[k], v, mass, tables, step, speeding_up)
        if k == time.size - 1:
            break
        dt = time[k + 1] - time[k]
        parts = max(1, int(np.ceil(dt / h_max - 1e-9)))
        for j in range(parts):
            now = drive[k] + (j + 0.5) / parts * (drive[k + 1] - drive[k])
            v, speeding_up = advance(now, v, dt / parts, mass, tables, step, speeding_up)
    return out
