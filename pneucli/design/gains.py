"""Gains of the loops and observers, from their bandwidths.

The position loop has the poles of ``(s + w)(s^2 + 2 damping w s + w^2)``. Source: pole placement after Ackermann, for
example G. F. Franklin, J. D. Powell, M. Workman, Digital Control of Dynamic Systems, Addison-Wesley 1998, chapter 8.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from pneucli.arrays import Array
from pneucli.design.bandwidths import Bandwidths, Timing
from pneucli.design.requirements import Requirements

LOAD_OBSERVER_RATIO = 0.5  # corner of the load estimate over that of the pressure loop
SENSOR_LAG_BANDWIDTH_PRODUCT = 2.0  # corner of the pressure observer times the lag of its sensor; limits its noise


def controller_gains(
    bandwidths: Bandwidths, axis: Mapping[str, float], requirements: Requirements, timing: Timing
) -> dict[str, float]:
    """Return the gains of both loops and of all observers.

    Args:
        bandwidths: Corner frequencies in rad/s.
        axis: Parameters of the axis by name (C_MASS in kg).
        requirements: ``period`` in s and ``damping``.
        timing: Lags and delays in s.

    Returns:
        Gains by the names of the layout (:mod:`pneucli.controller.layout`), in SI units.

    References:
        Thesis 7.2 (position loop) and 7.3 (pressure loop).
    """
    h = requirements.period
    return {
        **loop_gains(bandwidths, requirements),
        **_motion_observer_gains(bandwidths, axis["C_MASS"], h),
        **_pressure_observer_gains(bandwidths, timing, h),
    }


def _motion_observer_gains(bandwidths: Bandwidths, mass: float, h: float) -> dict[str, float]:
    """Return the gains of the observer of position, velocity and load.

    >>> gains = _motion_observer_gains(Bandwidths(math.inf, 0.0, math.inf, 0.0), mass=2.0, h=1e-3)
    >>> {name: round(gain, 6) for name, gain in gains.items()}
    {'C_OBS_X': 1.0, 'C_OBS_V': 1500.0, 'C_OBS_LOAD': 2000000.0}
    """
    quick = math.exp(-bandwidths.motion_observer * h)
    slow = math.exp(-min(bandwidths.motion_observer, LOAD_OBSERVER_RATIO * bandwidths.pressure) * h)
    forward = np.array([[1.0, h, h * h / (2.0 * mass)], [0.0, 1.0, h / mass], [0.0, 0.0, 1.0]])
    names = ("C_OBS_X", "C_OBS_V", "C_OBS_LOAD")
    return dict(zip(names, ackermann_gains(forward, (quick, quick, slow)), strict=True))


def loop_gains(bandwidths: Bandwidths, requirements: Requirements) -> dict[str, float]:
    """Return the gains of both PIDs: poles of the position loop at ``(s + w)(s^2 + 2 damping w s + w^2)``.

    Args:
        bandwidths: Corner frequencies in rad/s.
        requirements: ``damping`` of the oscillating pair.

    Returns:
        C_KP (1/s^2), C_KD (1/s), C_KI (1/s^3) per unit mass, C_P_KP (1/s), C_P_KI (1/s^2).

    >>> gains = loop_gains(Bandwidths(300.0, 30.0, 300.0, 40.0), Requirements())
    >>> gains["C_KP"], gains["C_KD"], gains["C_KI"], gains["C_P_KP"], gains["C_P_KI"]
    (2700.0, 90.0, 27000.0, 300.0, 2500.0)

    """
    w, two_zeta = bandwidths.position, 2.0 * requirements.damping
    return {
        "C_KP": w * w * (1.0 + two_zeta),
        "C_KD": w * (1.0 + two_zeta),
        "C_KI": w**3,
        "C_P_KP": bandwidths.pressure,
        "C_P_KI": (bandwidths.pressure / 6.0) ** 2,
    }


def low_pass_share(corner: float, period: float) -> float:
    """Return the share by which a sampled first-order low-pass approaches its input in one sample.

    Args:
        corner: Corner frequency in rad/s.
        period: Sample time in s.

    >>> round(low_pass_share(100.0, 1e-3), 6)
    0.095163

    """
    return 1.0 - math.exp(-corner * period)


def _pressure_observer_gains(bandwidths: Bandwidths, timing: Timing, h: float) -> dict[str, float]:
    """Return the gains of the pressure observers for expected reading, pressure and unmodelled flow.

    >>> timing = Timing(0.0, 0.0, 0.0, sensor_lag=0.0, sensor_delay=3e-3, unmodelled_delay=0.0)
    >>> gains = _pressure_observer_gains(Bandwidths(100.0, 10.0, 100.0, 20.0), timing, h=1e-3)
    >>> gains["C_OBS_P"] == 1.0 - math.exp(-0.1), gains["C_SENSOR_SHARE"], gains["C_SENSOR_DELAY"]
    (True, 1.0, 3.0)
    """
    fast, slow = math.exp(-bandwidths.pressure * h), math.exp(-bandwidths.flow_observer * h)
    share = 1.0 - math.exp(-h / timing.sensor_lag) if timing.sensor_lag > 0.0 else 1.0
    if share > 1.0 - 1e-6:
        seen = p = 1.0 - fast
        flow = (1.0 - slow) ** 2 / h
    else:
        forward = np.array([[1.0 - share, share, share * h], [0.0, 1.0, h], [0.0, 0.0, 1.0]])
        quick = math.exp(-min(bandwidths.pressure, SENSOR_LAG_BANDWIDTH_PRODUCT / timing.sensor_lag) * h)
        seen, p, flow = ackermann_gains(forward, (quick, quick, slow))
    return {
        "C_SENSOR_SHARE": share,
        "C_SENSOR_DELAY": timing.sensor_delay / h,
        "C_OBS_SENSOR": seen,
        "C_OBS_P": p,
        "C_OBS_FLOW": flow,
    }


def ackermann_gains(forward: Array, poles: Sequence[float]) -> tuple[float, ...]:
    """Return the gains of a current observer by Ackermann's formula.

    Args:
        forward: State transition (n, n) of one sample; the first state is measured, C = (1, 0, ...).
        poles: n poles of the error dynamics (I - L C) forward.

    Returns:
        The gains L, n numbers.

    References:
        Ackermann (1972); Franklin, Powell and Workman, Digital Control of Dynamic Systems, current estimator.

    >>> ackermann_gains(np.array([[1.0]]), (0.25,))
    (0.75,)

    """
    n = len(forward)
    row = forward[0]
    observability = np.array([row @ np.linalg.matrix_power(forward, k) for k in range(n)])
    polynomial = np.eye(n)
    for pole in poles:
        polynomial = polynomial @ (forward - pole * np.eye(n))
    return tuple(float(g) for g in polynomial @ np.linalg.solve(observability, np.eye(n)[:, -1]))
