"""Rules for the bandwidths of loops and observers, and the gains that follow; a stated requirement has precedence.

- Pressure loop: corner 0.7 over the unpredicted lags and delays, half a sample of the hold included, at most
  0.8 / period.
- Observers: those of pressure have the corner of the pressure loop, that of motion too, at most
  ``sqrt(0.1 coulomb / (mass noise))``, so that noise of x changes the load estimate by less than a tenth of friction.
- Position loop: corner of the pressure loop / 10, poles of ``(s + w)(s^2 + 2 damping w s + w^2)``.
- Sector: steeper line ``min(0.2 / period, pressure corner / 5)``, see :mod:`pneucli.design.sliding_sector`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneucli.controller.layout import DELAY_LINE_SAMPLES
from pneucli.design import effect_compensation
from pneucli.design.requirements import Requirements
from pneucli.simulate.model import Model

Array = NDArray[np.float64]

SPOOL_LEAD = 5.0  # lag of the spool over its lag with lead compensation
UNMODELLED_DELAY = 2e-3  # s: delay of a valve that no model has; most loops tolerate 5 ms and presliding in addition
DELAY_UNCERTAINTY = 0.1  # relative error of a predicted delay
MAX_CORRECTION_PER_SAMPLE = 0.8  # largest share of a pressure error that one sample corrects
PRESSURE_LOOP_DELAY_PRODUCT = 0.7  # corner of the pressure loop times its residual delay
CASCADE_RATIO = 10.0  # corner of the pressure loop over that of the position loop
LOAD_OBSERVER_RATIO = 0.5  # corner of the load estimate over that of the pressure loop
SEAL_STIFFNESS = 12.0  # supply forces over the stroke: stiffness of a soft seal before the piston slides
CLOSING_RATE = 10.0  # 1/s: closing speed per error near a resting reference
DWELL_RATE_FACTOR = 5.0  # rate of the release force over the rate at which a rest raises break-away
FAST_RAMP_RATIO = 10.0  # time constants of the pressure loop in which the release force rises by a break-away force
SLOW_RAMP_RATIO = 400.0  # the same near break-away: the rise within the lag of the loop accelerates the freed piston
MAX_DEADBAND_GAIN = 10.0  # largest dead band over the holding band
SENSOR_LAG_BANDWIDTH_PRODUCT = 2.0  # corner of the pressure observer times the lag of its sensor; limits its noise


@dataclass(frozen=True)
class Timing:
    """Lags and delays between command and reading, in s.

    Attributes:
        lag: Lag of the spool.
        led_lag: Lag of the spool with lead compensation.
        flow_delay: Delay of the flow, predicted.
        sensor_lag: Lag of the pressure sensors, in the observer.
        sensor_delay: Delay of the pressure sensors, in the observer.
        unmodelled_delay: Allowance for delays that no model has.

    """

    lag: float
    led_lag: float
    flow_delay: float
    sensor_lag: float
    sensor_delay: float
    unmodelled_delay: float

    @property
    def residual_delay(self) -> float:
        """Delay of loops with prediction and lead compensation."""
        return self.led_lag + self.unmodelled_delay

    @property
    def total_delay(self) -> float:
        """Delay of loops without prediction."""
        return self.lag + self.flow_delay + self.sensor_lag + self.sensor_delay + self.unmodelled_delay


@dataclass(frozen=True)
class Bandwidths:
    """Corner frequencies in rad/s of the loops and observers."""

    pressure: float
    position: float
    motion_observer: float
    flow_observer: float


def loop_timing(model: Model, requirements: Requirements) -> Timing:
    """Return lags and delays of a model; a delay longer than the delay line counts as unmodelled.

    Args:
        model: The identified model; effects with a lag or a delay count.
        requirements: ``period`` and ``delay`` in s.

    Returns:
        Times in s. A lag of the spool below 2 % of the period is 0.
    """
    h, longest = requirements.period, (DELAY_LINE_SAMPLES - 2) * requirements.period
    lag = effect_compensation.identify_spool(model).lag
    lag = lag if lag > 0.02 * h else 0.0
    flow = effect_compensation.flow_delay(model) + requirements.delay
    sensor = effect_compensation.sensor_delay(model)
    excess = max(flow - longest, 0.0) + max(sensor - longest, 0.0)
    unmodelled = excess + DELAY_UNCERTAINTY * (flow + 0.5 * sensor) + UNMODELLED_DELAY
    return Timing(
        lag,
        lag / SPOOL_LEAD,
        min(flow, longest),
        effect_compensation.sensor_lag(model),
        min(sensor, longest),
        unmodelled,
    )


def choose_bandwidths(
    model: Model, requirements: Requirements, axis: Mapping[str, float], *, predicted: bool = True
) -> Bandwidths:
    """Return the corner frequencies by the rules above.

    Args:
        model: The identified model.
        requirements: Stated bandwidths have precedence.
        axis: Parameters of the axis by name (C_COULOMB, C_MASS).
        predicted: Whether the loops predict delays and lead the spool, as ``best`` does.

    References:
        Thesis 7.1: the inner loop is faster than the outer one.

    """
    timing = loop_timing(model, requirements)
    delay = timing.residual_delay if predicted else timing.total_delay
    pressure = min(
        MAX_CORRECTION_PER_SAMPLE / requirements.period,
        PRESSURE_LOOP_DELAY_PRODUCT / (delay + 0.5 * requirements.period),
    )
    if requirements.pressure_bandwidth is not None:
        pressure = 2.0 * math.pi * requirements.pressure_bandwidth
    position = pressure / CASCADE_RATIO
    if requirements.position_bandwidth is not None:
        position = 2.0 * math.pi * requirements.position_bandwidth
    noise = math.hypot(requirements.noise_x, requirements.quantum_x / math.sqrt(12.0))
    noise_limit = (
        math.sqrt(0.1 * axis["C_COULOMB"] / (axis["C_MASS"] * noise)) if noise and axis["C_COULOMB"] else math.inf
    )
    return Bandwidths(pressure, position, min(pressure, noise_limit), pressure / 7.5)


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
        **motion_observer_gains(bandwidths, axis["C_MASS"], h),
        **pressure_observer_gains(bandwidths, timing, h),
    }


def motion_observer_gains(bandwidths: Bandwidths, mass: float, h: float) -> dict[str, float]:
    """Return the gains of the observer of position, velocity and load.

    The model is ``dx/dt = v``, ``dv/dt = F / m`` with a constant load in F, sampled exactly. The poles of the motion
    coincide; that of the load is slower.

    Args:
        bandwidths: Corner frequencies in rad/s.
        mass: Moving mass in kg.
        h: Sample time in s.

    Returns:
        C_OBS_X (1), C_OBS_V (1/s) and C_OBS_LOAD (N/m).

    Infinite corners give the deadbeat observer, 1, 3 / (2 h), m / h^2:

    >>> gains = motion_observer_gains(Bandwidths(math.inf, 0.0, math.inf, 0.0), mass=2.0, h=1e-3)
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


def pressure_observer_gains(bandwidths: Bandwidths, timing: Timing, h: float) -> dict[str, float]:
    """Return the gains of the pressure observers for expected reading, pressure and unmodelled flow.

    Args:
        bandwidths: Corner frequencies in rad/s.
        timing: Lag and delay of the pressure sensors in s; with a lag the corner is at most 2 / lag.
        h: Sample time in s.

    Returns:
        C_SENSOR_SHARE (1), C_SENSOR_DELAY (samples), C_OBS_SENSOR (1), C_OBS_P (1) and C_OBS_FLOW (1/s).

    Without a lag the observer of pressure corrects the share 1 - exp(-w h) of its error in each sample:

    >>> timing = Timing(0.0, 0.0, 0.0, sensor_lag=0.0, sensor_delay=3e-3, unmodelled_delay=0.0)
    >>> gains = pressure_observer_gains(Bandwidths(100.0, 10.0, 100.0, 20.0), timing, h=1e-3)
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


def valve_compensation(model: Model, requirements: Requirements, timing: Timing) -> dict[str, float]:
    """Return the parameters of play, spool and flow delay, and of their compensation.

    Args:
        model: The identified model.
        requirements: ``period`` in s.
        timing: Lags and delays in s.

    Returns:
        C_SPOOL_SHARE, C_SPOOL_MEAN_SHARE and C_SPOOL_LEAD (1 each), C_PLAY and C_PLAY_DEADBAND (V), C_FLOW_DELAY
        (samples).
    """
    h, found = requirements.period, effect_compensation.identify_spool(model)
    lag, led_lag = timing.lag, timing.led_lag
    share = 1.0 - math.exp(-h / lag) if lag else 1.0
    return {
        "C_SPOOL_SHARE": share,
        "C_SPOOL_MEAN_SHARE": 1.0 - share * lag / h if lag else 1.0,
        "C_SPOOL_LEAD": 1.0 - math.exp(-h / led_lag) if lag else 1.0,
        "C_PLAY": found.play_half_width,
        "C_PLAY_DEADBAND": 0.1 * found.play_half_width,
        "C_FLOW_DELAY": timing.flow_delay / h,
    }


def presliding_distance(values: Mapping[str, float], stiffness: float) -> float:
    """Return the largest elastic excursion of the seals in m: 1.5 times Coulomb friction over their stiffness.

    Args:
        values: Parameters of the axis by name (SI).
        stiffness: Presliding stiffness in N/m; 0 where it is not known, then 12 supply forces over the stroke.

    >>> axis = {"C_COULOMB": 20.0, "C_AREA_1": 8e-4, "C_SUPPLY": 7e5, "C_AMBIENT": 1e5, "C_STROKE": 0.2}
    >>> presliding_distance(axis, stiffness=6e4)
    0.0005
    """
    supply_force = values["C_AREA_1"] * (values["C_SUPPLY"] - values["C_AMBIENT"])
    return 1.5 * values["C_COULOMB"] / (stiffness or SEAL_STIFFNESS * supply_force / values["C_STROKE"])


def stiction_parameters(
    bandwidths: Bandwidths,
    values: Mapping[str, float],
    requirements: Requirements,
    stiffness: float,
    dwell: effect_compensation.DwellStrengthening,
) -> dict[str, float]:
    """Return the parameters of hold and release (:mod:`pneucli.controller.standstill`).

    Forces and their rates are multiples of the break-away force.

    Args:
        bandwidths: Corner frequencies in rad/s.
        values: Parameters of the axis and of the loops by name (SI).
        requirements: ``tolerance``, by default 10 um, two quanta or four sigma of the position sensor.
        stiffness: Presliding stiffness in N/m, 0 without a value.
        dwell: Growth of break-away with the time at rest.

    """
    static = values["C_STATIC"]
    tolerance = requirements.tolerance or max(10e-6, 2.0 * requirements.quantum_x, 4.0 * requirements.noise_x)
    band = 0.5 * tolerance
    slope = min(0.2 / requirements.period, bandwidths.pressure / 5.0)
    slow = bandwidths.pressure / SLOW_RAMP_RATIO * static  # N/s
    return {
        "C_HOLDING_BAND": band,
        "C_V_FLOOR": max(2.0 * requirements.quantum_x / requirements.period, 0.01 * values["C_V_MAX"]),
        "C_MOTION_WINDOW": 6.0 / bandwidths.pressure,
        "C_SECTOR_1": slope / requirements.sector_ratio,
        "C_SECTOR_2": slope,
        "C_RAMP_RATE_PER_ERROR": slow / (5.0 * band),
        "C_RAMP_RATE_MIN": max(slow, DWELL_RATE_FACTOR * dwell.initial_rate * static),
        "C_RAMP_RATE_MAX": bandwidths.pressure / FAST_RAMP_RATIO * static,
        "C_BREAKAWAY_MAX": static if dwell.initial_rate > 0.0 else 2.0 * static,
        "C_PRESSURE_BAND": 0.1 * static / values["C_AREA_1"],
        "C_LOAD_STEP_MAX": max(0.25 * static, 0.01 * values["C_AREA_1"] * values["C_SUPPLY"]),
        "C_PRESLIDING_DISTANCE": presliding_distance(values, stiffness),
        "C_RAMP_GROWTH_RATE": bandwidths.pressure / 6.0,
        "C_RELEASE_FORCE_MAX": 3.0 * static * dwell.max_factor
        + values["C_AREA_1"] * (values["C_SUPPLY"] - values["C_AMBIENT"]),
        "C_UNLOADING_RATE": bandwidths.pressure / 5.0,
        "C_CLOSING_RATE": CLOSING_RATE,
        "C_BRAKE_DAMPING": values["C_MASS"] * values["C_KD"],
        "C_DEADBAND_GAIN_MAX": MAX_DEADBAND_GAIN,
    }
