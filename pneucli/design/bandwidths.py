"""The rules for the gains: how fast each loop and observer may be, each overruled by a requirement that is stated.

- Pressure loop: corner 0.7 over what of the lags and delays is not predicted, half a sample of the hold included, at
  most 0.8 / period.
- Observers: those of pressure have the same corner, that of motion 1 / period, at most
  ``sqrt(0.1 coulomb / (mass noise))``, so that noise of x does not make a load of a tenth of the dry friction.
- Position loop: corner of the pressure loop / 10, poles of ``(s + w)(s^2 + 2 damping w s + w^2)``.
- Sector: steeper line ``min(0.2 / period, pressure corner / 5)``, see :mod:`pneucli.design.sliding_sector`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pneucli.controller.layout import DELAY_LINE_SAMPLES
from pneucli.design import effect_compensation
from pneucli.simulate.model import Model

if TYPE_CHECKING:  # names the laws, which rest on the rules
    from pneucli.design.requirements import Requirements

Array = NDArray[np.float64]

SPOOL_LEAD = 5.0  # by which a spool is hurried: so much more command than the opening that is asked for
UNMODELLED_DELAY = (
    2e-3  # s, what a valve takes that no model tells; with 5 ms and bristles beside it most loops still hold
)
DELAY_UNCERTAINTY = 0.1  # of a predicted delay, by which it may be wrong
MAX_CORRECTION_PER_SAMPLE = 0.8  # of an error of pressure, at most, that one sample takes away
PRESSURE_LOOP_DELAY_PRODUCT = 0.7  # corner of the pressure loop times what it has to stand
CASCADE_RATIO = 10.0  # between the corners of the pressure loop and the position loop around it
LOAD_OBSERVER_RATIO = 0.5  # of the pressure loop's corner, by which a load is told
SEAL_STIFFNESS = (
    12.0  # supply forces over the stroke: stiffness of a soft seal, which gives way before the piston slides
)
CLOSING_RATE = 10.0  # 1/s, by which a piston closes in at rest
DWELL_RATE_FACTOR = 5.0  # by which a force rises faster than a rest raises what holds the piston
FAST_RAMP_RATIO = (
    10.0  # times of the pressure loop in which the force on a piston that sticks rises by a breakaway force
)
SLOW_RAMP_RATIO = 400.0  # the same near where it breaks away: what is put on until the loop answers throws the piston
MAX_DEADBAND_GAIN = 10.0  # reaches that are put up with at most
SENSOR_LAG_BANDWIDTH_PRODUCT = 2.0  # corner of the pressure observer times the lag of its sensor: noise grows with it


@dataclass(frozen=True)
class Timing:
    """What passes between command and reading, all in s.

    ``lag`` of the spool and ``led_lag``, to what it is brought by leading; ``flow_delay`` of the flow, predicted;
    ``sensor_lag`` and ``sensor_delay`` of the pressures' sensors, in the observer; ``unmodelled_delay``: what no model tells.
    """

    lag: float
    led_lag: float
    flow_delay: float
    sensor_lag: float
    sensor_delay: float
    unmodelled_delay: float

    @property
    def residual_delay(self) -> float:
        """What the loops have to stand beside what is predicted."""
        return self.led_lag + self.unmodelled_delay

    @property
    def total_delay(self) -> float:
        """What loops have to stand that predict nothing."""
        return self.lag + self.flow_delay + self.sensor_lag + self.sensor_delay + self.unmodelled_delay


@dataclass(frozen=True)
class Bandwidths:
    """Corner frequencies in rad/s of the loops and observers."""

    pressure: float
    position: float
    motion_observer: float
    flow_observer: float


def loop_timing(model: Model, requirements: Requirements) -> Timing:
    """Return the lags and delays of a model; what is too long to be remembered counts as not known."""
    h, longest = requirements.period, (DELAY_LINE_SAMPLES - 2) * requirements.period
    lag = effect_compensation.identify_spool(model).lag
    lag = lag if lag > 0.02 * h else 0.0
    wait, sensed = effect_compensation.flow_delay(model) + requirements.delay, effect_compensation.sensor_delay(model)
    beyond = max(wait - longest, 0.0) + max(sensed - longest, 0.0)
    unknown = beyond + DELAY_UNCERTAINTY * (wait + 0.5 * sensed) + UNMODELLED_DELAY
    return Timing(
        lag, lag / SPOOL_LEAD, min(wait, longest), effect_compensation.sensor_lag(model), min(sensed, longest), unknown
    )


def choose_bandwidths(
    model: Model, requirements: Requirements, axis: Mapping[str, float], *, predicted: bool = True
) -> Bandwidths:
    """Return the corner frequencies by the rules above, for loops that predict what is late or (False) do not."""
    timing = loop_timing(model, requirements)
    left = timing.residual_delay if predicted else timing.total_delay
    pressure = min(
        MAX_CORRECTION_PER_SAMPLE / requirements.period,
        PRESSURE_LOOP_DELAY_PRODUCT / (left + 0.5 * requirements.period),
    )
    if requirements.pressure_bandwidth is not None:
        pressure = 2.0 * math.pi * requirements.pressure_bandwidth
    position = pressure / CASCADE_RATIO
    if requirements.position_bandwidth is not None:
        position = 2.0 * math.pi * requirements.position_bandwidth
    noise = math.hypot(requirements.noise_x, requirements.quantum_x / math.sqrt(12.0))
    quiet = math.sqrt(0.1 * axis["C_COULOMB"] / (axis["C_MASS"] * noise)) if noise and axis["C_COULOMB"] else math.inf
    return Bandwidths(pressure, position, min(pressure, quiet), pressure / 7.5)


def controller_gains(
    bandwidths: Bandwidths, axis: Mapping[str, float], requirements: Requirements, timing: Timing
) -> dict[str, float]:
    """Return the gains of both PIDs and all observers (that of motion: equal poles at exp(-corner period))."""
    h = requirements.period
    return {
        **loop_gains(bandwidths, requirements),
        **motion_observer_gains(bandwidths, axis["C_MASS"], h),
        **pressure_observer_gains(bandwidths, timing, h),
    }


def motion_observer_gains(bandwidths: Bandwidths, mass: float, h: float) -> dict[str, float]:
    """Return the gains of the observer of motion; the load is told no faster than it is made up for."""
    quick = math.exp(-bandwidths.motion_observer * h)
    slow = math.exp(-min(bandwidths.motion_observer, LOAD_OBSERVER_RATIO * bandwidths.pressure) * h)
    forward = np.array([[1.0, h, h * h / (2.0 * mass)], [0.0, 1.0, h / mass], [0.0, 0.0, 1.0]])
    names = ("C_OBS_X", "C_OBS_V", "C_OBS_LOAD")
    return dict(zip(names, ackermann_gains(forward, (quick, quick, slow)), strict=True))


def loop_gains(bandwidths: Bandwidths, requirements: Requirements) -> dict[str, float]:
    """Return the gains of both PIDs."""
    w, two_zeta = bandwidths.position, 2.0 * requirements.damping
    return {
        "C_KP": w * w * (1.0 + two_zeta),
        "C_KD": w * (1.0 + two_zeta),
        "C_KI": w**3,
        "C_P_KP": bandwidths.pressure,
        "C_P_KI": (bandwidths.pressure / 6.0) ** 2,
    }


def pressure_observer_gains(bandwidths: Bandwidths, timing: Timing, h: float) -> dict[str, float]:
    """Return the gains of the pressure observers: what a sensor sees, pressure, and what flows beside the known."""
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
    """Return the gains L (n,) of an observer that corrects after the step, by Ackermann's formula.

    The first of the states, which go ``forward`` (n, n) in a sample, is read; its error goes by (I - L C) forward, with
    these ``poles``.
    """
    n = len(forward)
    row = forward[0]
    seen = np.array([row @ np.linalg.matrix_power(forward, k) for k in range(n)])
    wanted = np.eye(n)
    for pole in poles:
        wanted = wanted @ (forward - pole * np.eye(n))
    return tuple(float(g) for g in wanted @ np.linalg.solve(seen, np.eye(n)[:, -1]))


def valve_compensation(model: Model, requirements: Requirements, timing: Timing) -> dict[str, float]:
    """Return what undoes play and spool, and the wait behind them."""
    h, found = requirements.period, effect_compensation.identify_spool(model)
    lag, hurried = timing.lag, timing.led_lag
    share = 1.0 - math.exp(-h / lag) if lag else 1.0
    return {
        "C_SPOOL_SHARE": share,
        "C_SPOOL_MEAN_SHARE": 1.0 - share * lag / h if lag else 1.0,
        "C_SPOOL_LEAD": 1.0 - math.exp(-h / hurried) if lag else 1.0,
        "C_PLAY": found.play_half_width,
        "C_PLAY_DEADBAND": 0.1 * found.play_half_width,
        "C_FLOW_DELAY": timing.flow_delay / h,
    }


def presliding_distance(values: Mapping[str, float], stiffness: float) -> float:
    """Return the way in m after which a piston surely slides, whatever is elastic in its seals."""
    supply_force = values["C_AREA_1"] * (values["C_SUPPLY"] - values["C_AMBIENT"])
    return 1.5 * values["C_COULOMB"] / (stiffness or SEAL_STIFFNESS * supply_force / values["C_STROKE"])


def stiction_parameters(
    bandwidths: Bandwidths,
    values: Mapping[str, float],
    requirements: Requirements,
    stiffness: float,
    dwell: effect_compensation.DwellStrengthening,
) -> dict[str, float]:
    """Return what the controller needs near standstill; forces and their rates are multiples of the breakaway force.

    ``stiffness`` (N/m) of what gives way before the piston slides, 0 where it is not known.
    """
    static = values["C_STATIC"]
    tolerance = requirements.tolerance or max(10e-6, 2.0 * requirements.quantum_x, 4.0 * requirements.noise_x)
    reach = 0.5 * tolerance
    steep = min(0.2 / requirements.period, bandwidths.pressure / 5.0)
    slow = bandwidths.pressure / SLOW_RAMP_RATIO * static  # N/s
    return {
        "C_HOLDING_BAND": reach,
        "C_V_FLOOR": max(2.0 * requirements.quantum_x / requirements.period, 0.01 * values["C_V_MAX"]),
        "C_MOTION_WINDOW": 6.0 / bandwidths.pressure,
        "C_SECTOR_1": steep / requirements.sector_ratio,
        "C_SECTOR_2": steep,
        "C_RAMP_RATE_PER_ERROR": slow / (5.0 * reach),
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
