"""Rules for the bandwidths of loops and observers, for their gains, and for the limits of the shaped reference.

- Pressure loop: corner 0.7 over the unpredicted lags and delays, half a sample of the hold included, at most
  0.8 / period.
- Observers: those of pressure have the corner of the pressure loop, that of motion too, at most
  ``sqrt(0.1 coulomb / (mass noise))``, so that noise of x changes the load estimate by less than a tenth of friction.
- Position loop: corner w of the pressure loop / 10; its poles are those of ``(s + w)(s^2 + 2 damping w s + w^2)``.
- Sector: steeper line ``min(0.2 / period, pressure corner / 5)``, see :mod:`pneucli.design.sliding`.
- Reference: at most 0.7 of the speed that the slower direction of the valve reaches, anywhere in the middle 60 % of the
  stroke with pressures well within their range, and the acceleration whose force this direction builds within half the
  time constant of the position loop.

Source: pole placement after Ackermann, for example G. F. Franklin, J. D. Powell, M. Workman, Digital Control of Dynamic
Systems, Addison-Wesley 1998, chapter 8; thesis (2.46-2.52) for what the valve can do; the shares are the project's own.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pneucli.arrays import Array
from pneucli.controller.layout import DELAY_LINE_SAMPLES
from pneucli.design import effect_compensation
from pneucli.design.requirements import Requirements
from pneucli.physics.vectorised import flow_functions
from pneucli.simulate.model import Model

SPOOL_LEAD = 5.0  # lag of the spool over its lag with lead compensation
UNMODELLED_DELAY = 2e-3  # s: delay of a valve that no model has; most loops tolerate 5 ms and presliding in addition
DELAY_UNCERTAINTY = 0.1  # relative error of a predicted delay
MAX_CORRECTION_PER_SAMPLE = 0.8  # largest share of a pressure error that one sample corrects
PRESSURE_LOOP_DELAY_PRODUCT = 0.7  # corner of the pressure loop times its residual delay
CASCADE_RATIO = 10.0  # corner of the pressure loop over that of the position loop


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

    The observers know one delay of the flow: of a switching valve's dead times the shorter one, the rest is unmodelled.

    Args:
        model: The identified model; effects with a lag or a delay count.
        requirements: ``period`` and ``delay`` in s.

    Returns:
        Times in s. A lag of the spool below 2 % of the period is 0.
    """
    h, longest = requirements.period, (DELAY_LINE_SAMPLES - 2) * requirements.period
    lag = effect_compensation.identify_spool(model).lag
    lag = lag if lag > 0.02 * h else 0.0
    shorter, longer = effect_compensation.dead_times(model)
    flow = effect_compensation.flow_delay(model) + shorter + requirements.delay
    sensor = effect_compensation.sensor_delay(model)
    excess = max(flow - longest, 0.0) + max(sensor - longest, 0.0) + longer - shorter
    unmodelled = excess + DELAY_UNCERTAINTY * (flow + 0.5 * sensor) + UNMODELLED_DELAY
    return Timing(
        lag,
        lag / SPOOL_LEAD,
        min(flow, longest),
        effect_compensation.sensor_lag(model),
        min(sensor, longest),
        unmodelled,
    )


def pressure_corner(model: Model, requirements: Requirements, *, predicted: bool = True) -> float:
    """Return the corner of the pressure loop in rad/s by the rule above; arguments as of :func:`choose_bandwidths`.

    References:
        Thesis 7.1: the inner loop is faster than the outer one. The products of corner and delay are the project's own.
    """
    timing, period = loop_timing(model, requirements), requirements.period
    delay = timing.residual_delay if predicted else timing.total_delay
    return min(MAX_CORRECTION_PER_SAMPLE / period, PRESSURE_LOOP_DELAY_PRODUCT / (delay + 0.5 * period))


def choose_bandwidths(
    model: Model, requirements: Requirements, axis: Mapping[str, float], *, predicted: bool = True
) -> Bandwidths:
    """Return the corner frequencies by the rules above.

    Args:
        model: The identified model.
        requirements: Stated bandwidths have precedence.
        axis: Parameters of the axis by name: C_COULOMB in N, C_MASS in kg.
        predicted: Whether the loops predict delays and lead the spool, as ``best`` does.

    Returns:
        Corners in rad/s.

    References:
        Thesis 7.1: the inner loop is faster than the outer one.

    """
    pressure = pressure_corner(model, requirements, predicted=predicted)
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


def valve_compensation(model: Model, requirements: Requirements, timing: Timing) -> dict[str, float]:
    """Return the parameters of play, spool and flow delay, and of their compensation.

    Args:
        model: The identified model.
        requirements: ``period`` in s.
        timing: Lags and delays in s.

    Returns:
        C_SPOOL_SHARE, C_SPOOL_MEAN_SHARE and C_SPOOL_LEAD (1 each), C_PLAY and C_PLAY_DEADBAND (V), C_FLOW_DELAY
        (samples).

    References:
        Exact sampling of a first-order lag under a held input: K. J. Astrom, B. Wittenmark, Computer-Controlled
        Systems, Prentice Hall 1997, chapter 2.
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


RestoringForce = Callable[[Array], Array]

WORKING_PRESSURES = (1.3, 0.85)  # of ambient and supply pressure: between them the valve has flow to spare both ways
STOPPING_TIME_CONSTANTS = (
    6.0  # time constants of the pressure loop that the shaped reference takes at least from full speed to rest
)


def reference_limits(
    bandwidths: Bandwidths,
    axis: Mapping[str, float],
    requirements: Requirements,
    restoring_force: RestoringForce = np.zeros_like,
) -> dict[str, float]:
    """Return the limits of the shaped reference and its time constant, and the rates that follow from the valve.

    Args:
        bandwidths: Corner frequencies in rad/s.
        axis: Parameters of the axis by name (SI).
        requirements: ``max_speed`` in m/s and ``max_acceleration`` in m/s^2 have precedence over the rules.
        restoring_force: Force of the effects in N toward x = 0, at x in m.

    Returns:
        C_V_MAX (m/s), C_A_MAX (m/s^2), C_SHAPING_TIME and C_FRICTION_LEAD (s), C_LEVEL_RATE and C_FLOW_STEP_MAX (Pa/s).
    """
    speed, rate = reachable_speed_and_gradient(axis, restoring_force)
    force_rate = axis["C_AREA_1"] * rate
    highest = requirements.max_speed or 0.7 * speed
    rule = min(
        force_rate / (2.0 * bandwidths.position * axis["C_MASS"]),
        highest * bandwidths.pressure / STOPPING_TIME_CONSTANTS,
    )
    return {
        "C_V_MAX": highest,
        "C_A_MAX": requirements.max_acceleration or rule,
        "C_SHAPING_TIME": max(4.0 * requirements.period, 1.0 / bandwidths.pressure),
        "C_FRICTION_LEAD": 1.0 / bandwidths.pressure,
        "C_LEVEL_RATE": 0.2 * rate,
        "C_FLOW_STEP_MAX": 0.05 * rate,
    }


def reachable_speed_and_gradient(
    axis: Mapping[str, float], restoring_force: RestoringForce = np.zeros_like
) -> tuple[float, float]:
    """Return the speed and the pressure gradient that both directions of the valve reach.

    The minimum over the middle 60 % of the stroke, where the pressures in equilibrium with the air spring and the
    restoring force are well within their range.

    Args:
        axis: Parameters of the axis by name (SI).
        restoring_force: Force of the effects in N toward x = 0, at x in m.

    Returns:
        Speed in m/s and pressure gradient in Pa/s.

    References:
        Thesis (2.46) to (2.52): the flow that keeps the pressures while the piston moves.
    """
    area_1, area_2, stroke, gamma = axis["C_AREA_1"], axis["C_AREA_2"], axis["C_STROKE"], axis["C_GAMMA"]
    x = np.linspace(0.2, 0.8, 25) * stroke
    volume_1, volume_2 = axis["C_DEAD_VOLUME_1"] + area_1 * x, axis["C_DEAD_VOLUME_2"] + area_2 * (stroke - x)
    p2 = chamber_2_pressure(axis, x)
    balance = (area_2 * p2 + (area_1 - area_2) * axis["C_AMBIENT"] + restoring_force(x)) / area_1
    p1 = np.clip(balance, WORKING_PRESSURES[0] * axis["C_AMBIENT"], WORKING_PRESSURES[1] * axis["C_SUPPLY"])
    low, high = axis["C_AMBIENT"] / p1, p1 / axis["C_SUPPLY"]
    scale = axis["C_GAMMA_R_T"] * axis["C_K_GAS"] / volume_1
    fill = axis["C_AREA_FILL"] * scale * axis["C_SUPPLY"] * flow_functions(high, axis["C_CRITICAL_RATIO"])
    vent = axis["C_AREA_VENT"] * scale * p1 * flow_functions(low, axis["C_CRITICAL_RATIO"])
    if axis["C_MIRRORED"] > 0.5:  # the other chamber gives way at the same time
        share = axis["C_AREA_2"] / area_1 * axis["C_GAMMA_R_T"] * axis["C_K_GAS"] / volume_2
        ratio_2 = p2 / axis["C_SUPPLY"], axis["C_AMBIENT"] / p2
        fill = fill + share * axis["C_AREA_VENT_2"] * p2 * flow_functions(ratio_2[1], axis["C_CRITICAL_RATIO"])
        vent = vent + share * axis["C_AREA_FILL_2"] * axis["C_SUPPLY"] * flow_functions(
            ratio_2[0], axis["C_CRITICAL_RATIO"]
        )
    rate = np.minimum(fill, vent)
    per_speed = gamma * (p1 * area_1 / volume_1 + p2 * area_2**2 / (area_1 * volume_2))
    within = p1 == balance if np.any(p1 == balance) else np.ones(x.size, dtype=bool)
    return float(np.min((rate / per_speed)[within])), float(np.min(rate[within]))


def chamber_2_pressure(axis: Mapping[str, float], x: Array) -> Array:
    """Return the pressure in Pa of chamber 2: sealed at mid-stroke (isentropic), or held by its valve.

    Args:
        axis: Parameters of the axis by name (SI); C_P_MEAN is the pressure at mid-stroke.
        x: Position in m, shape (n,).

    Returns:
        Pressure in Pa, shape (n,).

    >>> axis = {"C_TWO_VALVES": 0.0, "C_MIRRORED": 0.0, "C_P_MEAN": 3e5, "C_GAMMA": 1.4, "C_STROKE": 0.2}
    >>> axis |= {"C_DEAD_VOLUME_2": 0.0, "C_AREA_2": 8e-4}
    >>> chamber_2_pressure(axis, np.array([0.1, 0.15])).round()  # half the volume: times 2^1.4
    array([300000., 791705.])
    """
    if axis["C_TWO_VALVES"] > 0.5 or axis["C_MIRRORED"] > 0.5:
        return np.full_like(x, axis["C_P_MEAN"])
    half = axis["C_DEAD_VOLUME_2"] + 0.5 * axis["C_AREA_2"] * axis["C_STROKE"]
    volume = axis["C_DEAD_VOLUME_2"] + axis["C_AREA_2"] * (axis["C_STROKE"] - x)
    return np.asarray(axis["C_P_MEAN"] * (half / volume) ** axis["C_GAMMA"])
