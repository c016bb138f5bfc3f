"""The rig's sensors: what they distort, what they add, and how they round."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from pneucli.exam.rig.kernel import SAMPLE, Array
from pneucli.exam.rig.parameters import Parameters

HUM_HZ = 50.0


@dataclass(frozen=True)
class Sensors:
    """Noise of the pressure sensors (Pa) with its AR(1) ``pole`` per ms, mains ``hum`` (Pa) and the other channels.

    Positions (m) are rounded to ``position_step``; accelerations have white noise (m/s^2).
    """

    pressure: float = 400.0
    pole: float = 0.0
    hum: float = 0.0
    position_step: float = 1e-6
    acceleration: float = 0.05


def measure(par: Parameters, sensors: Sensors, truth: dict[str, Array], rng: np.random.Generator) -> dict[str, Array]:
    """Return the recorded signals, each of shape (n,), SI, pressures above ambient."""
    seen = {"u": truth["u"], "x": _rounded(truth["x"], sensors.position_step)}
    seen["p_supply"] = truth["p_supply"] - par.ambient + _pressure_noise(sensors, truth["u"].size, rng)
    for name in ("p1", "p2"):
        seen[name] = _pressure(par, truth[name], name == "p1") + _pressure_noise(sensors, truth["u"].size, rng)
    white = sensors.acceleration * rng.standard_normal(truth["a"].size)
    seen["a"] = truth["a"] + par.acceleration_bias + white
    return seen


def _pressure(par: Parameters, p: Array, is_first: bool) -> Array:
    gauge = (p - par.ambient) * par.pressure_scale
    if is_first:
        gauge = gauge + par.pressure_offset + par.pressure_curvature * gauge**2
    gauge = _lagged(gauge, par.pressure_lag)
    time = SAMPLE * np.arange(p.size)
    return np.asarray(np.interp(time - par.pressure_skew, time, gauge), dtype=np.float64)


def _lagged(signal: Array, time_constant: float) -> Array:
    """First-order lag, exact for a signal that is linear between its samples, at rest before the first."""
    if time_constant <= 0:
        return signal
    pole = np.exp(-SAMPLE / time_constant)
    share = time_constant / SAMPLE * (1 - pole)
    level = signal - signal[0]
    return np.asarray(lfilter([1 - share, share - pole], [1.0, -pole], level) + signal[0])


def _pressure_noise(sensors: Sensors, n: int, rng: np.random.Generator) -> Array:
    white = rng.standard_normal(n + 200)
    coloured = lfilter([np.sqrt(1 - sensors.pole**2)], [1.0, -sensors.pole], white)[200:]
    hum = sensors.hum * np.sin(2 * np.pi * (HUM_HZ * SAMPLE * np.arange(n) + rng.random()))
    return np.asarray(sensors.pressure * coloured + hum)


def _rounded(signal: Array, step: float) -> Array:
    return step * np.round(signal / step) if step > 0 else signal
