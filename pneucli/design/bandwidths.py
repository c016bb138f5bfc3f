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

from pneucli.controller.layout import LINE
from pneucli.design import effect_compensation
from pneucli.simulate.model import Model

if TYPE_CHECKING:  # names the laws, which rest on the rules
    from pneucli.design.requirements import Requirements

Array = NDArray[np.float64]

HASTE = 5.0  # by which a spool is hurried: so much more command than the opening that is asked for
UNTOLD = 2e-3  # s, what a valve takes that no model tells; with 5 ms and bristles beside it most loops still hold
MODELLED = 0.1  # of a predicted delay, by which it may be wrong
SAMPLED = 0.8  # of an error of pressure, at most, that one sample takes away
FIRM = 0.7  # corner of the pressure loop times what it has to stand
APART = 10.0  # between the corners of the pressure loop and the position loop around it
CALM = 0.5  # of the pressure loop's corner, by which a load is told
SOFT = 12.0  # supply forces over the stroke: stiffness of a soft seal, which gives way before the piston slides
CLOSING = 10.0  # 1/s, by which a piston closes in at rest
AHEAD_OF_DWELL = 5.0  # by which a force rises faster than a rest raises what holds the piston
FREEING = 10.0  # times of the pressure loop in which the force on a piston that sticks rises by a breakaway force
CREEPING = 400.0  # the same near where it breaks away: what is put on until the loop answers throws the piston
WIDEST = 10.0  # reaches that are put up with at most
QUICK_SENSOR = 2.0  # corner of the pressure observer times the lag of its sensor: noise grows with it


@dataclass(frozen=True)
class Timing:
    """What passes between command and reading, all in s.

    ``lag`` of the spool and ``hurried``, to what it is brought by leading; ``wait`` of the flow, predicted;
    ``sensor_lag`` and ``sensor_wait`` of the pressures' sensors, in the observer; ``unknown``: what no model tells.
    """

    lag: float
    hurried: float
    wait: float
    sensor_lag: float
    sensor_wait: float
    unknown: float

    @property
    def left(self) -> float:
        """What the loops have to stand beside what is predicted."""
        return self.hurried + self.unknown

    @property
    def whole(self) -> float:
        """What loops have to stand that predict nothing."""
        return self.lag + self.wait + self.sensor_lag + self.sensor_wait + self.unknown


@dataclass(frozen=True)
class Corners:
    """Corner frequencies in rad/s of the loops and observers."""

    pressure: float
    position: float
    motion_observer: float
    flow_observer: float


def timing_of(model: Model, wanted: Requirements) -> Timing:
    """Return the lags and delays of a model; what is too long to be remembered counts as not known."""
    h, longest = wanted.period, (LINE - 2) * wanted.period
    lag = effect_compensation.spool(model).lag
    lag = lag if lag > 0.02 * h else 0.0
    wait, sensed = effect_compensation.flow_delay(model) + wanted.delay, effect_compensation.sensor_delay(model)
    beyond = max(wait - longest, 0.0) + max(sensed - longest, 0.0)
    unknown = beyond + MODELLED * (wait + 0.5 * sensed) + UNTOLD
    return Timing(
        lag, lag / HASTE, min(wait, longest), effect_compensation.sensor_lag(model), min(sensed, longest), unknown
    )


def corners_of(model: Model, wanted: Requirements, axis: Mapping[str, float], *, predicted: bool = True) -> Corners:
    """Return the corner frequencies by the rules above, for loops that predict what is late or (False) do not."""
    timing = timing_of(model, wanted)
    left = timing.left if predicted else timing.whole
    pressure = min(SAMPLED / wanted.period, FIRM / (left + 0.5 * wanted.period))
    if wanted.pressure_bandwidth is not None:
        pressure = 2.0 * math.pi * wanted.pressure_bandwidth
    position = pressure / APART
    if wanted.position_bandwidth is not None:
        position = 2.0 * math.pi * wanted.position_bandwidth
    noise = math.hypot(wanted.noise_x, wanted.quantum_x / math.sqrt(12.0))
    quiet = math.sqrt(0.1 * axis["C_COULOMB"] / (axis["C_MASS"] * noise)) if noise and axis["C_COULOMB"] else math.inf
    return Corners(pressure, position, min(pressure, quiet), pressure / 7.5)


def gains(corners: Corners, axis: Mapping[str, float], wanted: Requirements, timing: Timing) -> dict[str, float]:
    """Return the gains of both PIDs and all observers (that of motion: equal poles at exp(-corner period))."""
    h = wanted.period
    return {
        **loop_gains(corners, wanted),
        **motion_observer(corners, axis["C_MASS"], h),
        **pressure_observer(corners, timing, h),
    }


def motion_observer(corners: Corners, mass: float, h: float) -> dict[str, float]:
    """Return the gains of the observer of motion; the load is told no faster than it is made up for."""
    quick = math.exp(-corners.motion_observer * h)
    slow = math.exp(-min(corners.motion_observer, CALM * corners.pressure) * h)
    forward = np.array([[1.0, h, h * h / (2.0 * mass)], [0.0, 1.0, h / mass], [0.0, 0.0, 1.0]])
    names = ("C_OBS_X", "C_OBS_V", "C_OBS_LOAD")
    return dict(zip(names, observer_gains(forward, (quick, quick, slow)), strict=True))


def loop_gains(corners: Corners, wanted: Requirements) -> dict[str, float]:
    """Return the gains of both PIDs."""
    w, two_zeta = corners.position, 2.0 * wanted.damping
    return {
        "C_KP": w * w * (1.0 + two_zeta),
        "C_KD": w * (1.0 + two_zeta),
        "C_KI": w**3,
        "C_P_KP": corners.pressure,
        "C_P_KI": (corners.pressure / 6.0) ** 2,
    }


def pressure_observer(corners: Corners, timing: Timing, h: float) -> dict[str, float]:
    """Return the gains of the pressure observers: what a sensor sees, pressure, and what flows beside the known."""
    fast, slow = math.exp(-corners.pressure * h), math.exp(-corners.flow_observer * h)
    share = 1.0 - math.exp(-h / timing.sensor_lag) if timing.sensor_lag > 0.0 else 1.0
    if share > 1.0 - 1e-6:
        seen = p = 1.0 - fast
        flow = (1.0 - slow) ** 2 / h
    else:
        forward = np.array([[1.0 - share, share, share * h], [0.0, 1.0, h], [0.0, 0.0, 1.0]])
        quick = math.exp(-min(corners.pressure, QUICK_SENSOR / timing.sensor_lag) * h)
        seen, p, flow = observer_gains(forward, (quick, quick, slow))
    return {
        "C_SENSE": share,
        "C_SENSE_WAIT": timing.sensor_wait / h,
        "C_OBS_SEEN": seen,
        "C_OBS_P": p,
        "C_OBS_FLOW": flow,
    }


def observer_gains(forward: Array, poles: Sequence[float]) -> tuple[float, ...]:
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


def spool_values(model: Model, wanted: Requirements, timing: Timing) -> dict[str, float]:
    """Return what undoes play and spool, and the wait behind them."""
    h, found = wanted.period, effect_compensation.spool(model)
    lag, hurried = timing.lag, timing.hurried
    share = 1.0 - math.exp(-h / lag) if lag else 1.0
    return {
        "C_SPOOL": share,
        "C_SPOOL_MEAN": 1.0 - share * lag / h if lag else 1.0,
        "C_HURRY": 1.0 - math.exp(-h / hurried) if lag else 1.0,
        "C_PLAY": found.half_width,
        "C_PLAY_LEAST": 0.1 * found.half_width,
        "C_WAIT": timing.wait / h,
    }


def gives_way(values: Mapping[str, float], stiffness: float) -> float:
    """Return the way in m after which a piston surely slides, whatever is elastic in its seals."""
    supply_force = values["C_AREA_1"] * (values["C_SUPPLY"] - values["C_AMBIENT"])
    return 1.5 * values["C_COULOMB"] / (stiffness or SOFT * supply_force / values["C_STROKE"])


def standstill(
    corners: Corners,
    values: Mapping[str, float],
    wanted: Requirements,
    stiffness: float,
    dwell: effect_compensation.Dwell,
) -> dict[str, float]:
    """Return what the controller needs near standstill; forces and their rates are multiples of the breakaway force.

    ``stiffness`` (N/m) of what gives way before the piston slides, 0 where it is not known.
    """
    static = values["C_STATIC"]
    tolerance = wanted.tolerance or max(10e-6, 2.0 * wanted.quantum_x, 4.0 * wanted.noise_x)
    reach = 0.5 * tolerance
    steep = min(0.2 / wanted.period, corners.pressure / 5.0)
    slow = corners.pressure / CREEPING * static  # N/s
    return {
        "C_REACH": reach,
        "C_V_FLOOR": max(2.0 * wanted.quantum_x / wanted.period, 0.01 * values["C_V_MAX"]),
        "C_LINGER": 6.0 / corners.pressure,
        "C_SECTOR_1": steep / wanted.sector_ratio,
        "C_SECTOR_2": steep,
        "C_SECTOR_RATE": slow / (5.0 * reach),
        "C_SECTOR_SLOW": max(slow, AHEAD_OF_DWELL * dwell.rate * static),
        "C_SECTOR_FAST": corners.pressure / FREEING * static,
        "C_BREAK_MOST": static if dwell.rate > 0.0 else 2.0 * static,
        "C_P_BAND": 0.1 * static / values["C_AREA_1"],
        "C_LOAD_STEP": max(0.25 * static, 0.01 * values["C_AREA_1"] * values["C_SUPPLY"]),
        "C_STIFF": gives_way(values, stiffness),
        "C_GROWTH": corners.pressure / 6.0,
        "C_STICK_MOST": 3.0 * static * dwell.most + values["C_AREA_1"] * (values["C_SUPPLY"] - values["C_AMBIENT"]),
        "C_UNLOADING": corners.pressure / 5.0,
        "C_CLOSING": CLOSING,
        "C_BRAKE": values["C_MASS"] * values["C_KD"],
        "C_WIDEST": WIDEST,
    }
