"""Rules for the bandwidths of loops and observers; a stated requirement has precedence.

- Pressure loop: corner 0.7 over the unpredicted lags and delays, half a sample of the hold included, at most
  0.8 / period.
- Observers: those of pressure have the corner of the pressure loop, that of motion too, at most
  ``sqrt(0.1 coulomb / (mass noise))``, so that noise of x changes the load estimate by less than a tenth of friction.
- Position loop: corner of the pressure loop / 10; :mod:`pneucli.design.gains` places its poles.
- Sector: steeper line ``min(0.2 / period, pressure corner / 5)``, see :mod:`pneucli.design.sliding_sector`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from pneucli.controller.layout import DELAY_LINE_SAMPLES
from pneucli.design import effect_compensation
from pneucli.design.requirements import Requirements
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
