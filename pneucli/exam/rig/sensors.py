"""The rig's sensors: distortion, noise, quantisation and sampling."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from pneucli.arrays import Array
from pneucli.exam.rig.parameters import Parameters

HUM_HZ = 50.0
MIN_SENSOR_RATE = 1000.0  # Hz, at which the sensors are simulated


@dataclass(frozen=True)
class Sensors:
    """Errors of the sensors, SI.

    Attributes:
        pressure: Noise of the pressure sensors (Pa).
        pole: AR(1) pole of that noise per ms.
        hum: Mains hum of the pressure sensors (Pa).
        position_step: Step of the encoder (m).
        acceleration: White noise of the accelerometer (m/s^2).
        rate: Rate of the logger (Hz); it keeps every n-th value of the sensors, unfiltered.
        bits: Bits of the converter over the range that a laboratory would choose; 0: finer than the noise.
        drift: Drift of a zero over a recording, relative to the noise.
        outliers: Share of wrong samples.
        force: White noise of the machine's force sensor (N).

    """

    pressure: float = 400.0
    pole: float = 0.0
    hum: float = 0.0
    position_step: float = 1e-6
    acceleration: float = 0.05
    rate: float = 1000.0
    bits: int = 0
    drift: float = 0.0
    outliers: float = 0.0
    force: float = 0.0  # N

    @property
    def decimation(self) -> int:
        """The number of sensor values for each one that the logger keeps."""
        return math.ceil(MIN_SENSOR_RATE / self.rate - 1e-9)

    @property
    def sensor_rate(self) -> float:
        """The rate of the sensors in Hz."""
        return self.rate * self.decimation


def measure(par: Parameters, sensors: Sensors, truth: dict[str, Array], rng: np.random.Generator) -> dict[str, Array]:
    """Return the recorded signals, each of shape (n,), SI, pressures above ambient, and their time in s.

    ``truth`` is sampled at ``sensors.sensor_rate``.
    """
    sampled = slice(None, None, sensors.decimation)
    u, u2, x, a = (truth[name][sampled] for name in ("u", "u2", "x", "a"))
    seen = {"time": np.arange(u.size) / sensors.rate, "u": u, "u2": u2, "x": _round_to_step(x, sensors.position_step)}
    seen["p_supply"] = truth["p_supply"][sampled] - par.ambient + _pressure_noise(sensors, u.size, rng)
    for name in ("p1", "p2"):
        shown = _pressure_reading(par, truth[name], 1.0 / sensors.sensor_rate, name == "p1")[sampled]
        seen[name] = shown + _pressure_noise(sensors, u.size, rng)
    seen["a"] = a + par.acceleration_bias + sensors.acceleration * rng.standard_normal(u.size)
    if "force" in truth:
        time = np.arange(truth["force"].size) / sensors.sensor_rate
        late = np.interp(time - par.force_skew, time, truth["force"])
        seen["force"] = late[sampled] + sensors.force * rng.standard_normal(u.size)
    seen["x"] = seen["x"] + par.position_curvature * x * (par.stroke - x)
    return _quantized(par, sensors, _with_drift_and_outliers(sensors, seen, rng))


def _with_drift_and_outliers(sensors: Sensors, seen: dict[str, Array], rng: np.random.Generator) -> dict[str, Array]:
    """Add drifting zeros and wrong samples; the drift of a position is relative to ten of its steps."""
    noises = dict.fromkeys(("p_supply", "p1", "p2"), sensors.pressure)
    noises |= {"x": 10 * sensors.position_step, "a": sensors.acceleration}
    for name, noise in noises.items():
        signal = seen[name]
        if sensors.drift > 0.0:
            turns = rng.uniform(0.2, 0.6) * np.linspace(0.0, 1.0, signal.size) + rng.random()
            signal = signal + sensors.drift * noise * (np.sin(2 * np.pi * turns) - np.sin(2 * np.pi * turns[0]))
        if sensors.outliers > 0.0:
            wrong = rng.random(signal.size) < sensors.outliers
            wrong[:5] = False
            size = noise * rng.uniform(30.0, 300.0, signal.size) * rng.choice([-1.0, 1.0], signal.size)
            signal = np.where(wrong, signal + size, signal)
        seen[name] = signal
    return seen


def _quantized(par: Parameters, sensors: Sensors, seen: dict[str, Array]) -> dict[str, Array]:
    """Quantise every sensor with that many bits over a range that contains its signal."""
    if sensors.bits == 0:
        return seen
    gauge = 1.25 * (par.supply - par.ambient)
    spans = {"p_supply": gauge, "p1": gauge, "p2": gauge, "x": 1.1 * par.stroke}
    spans["a"] = 2 * _converter_range(float(np.max(np.abs(seen["a"]), initial=1e-9)))
    return seen | {name: _round_to_step(seen[name], span / 2**sensors.bits) for name, span in spans.items()}


def _converter_range(largest: float) -> float:
    """Return the smallest of 1, 2, 5, 10, ... that is not below ``largest``."""
    decade = 10.0 ** math.floor(math.log10(largest))
    return next(decade * step for step in (1.0, 2.0, 5.0, 10.0) if decade * step >= largest)


def _pressure_reading(par: Parameters, p: Array, period: float, is_first: bool) -> Array:
    gauge = (p - par.ambient) * par.pressure_scale * (par.pressure_scale_1 if is_first else par.pressure_scale_2)
    if is_first:
        gauge = gauge + par.pressure_offset + par.pressure_curvature * gauge**2
    else:
        gauge = gauge + par.pressure_offset_2
    gauge = _first_order_lag(gauge, period, par.pressure_lag)
    time = period * np.arange(p.size)
    return np.asarray(np.interp(time - par.pressure_skew, time, gauge), dtype=np.float64)


def _first_order_lag(signal: Array, period: float, time_constant: float) -> Array:
    """Apply a first-order lag, exact for a signal that is linear between samples and at rest before the first."""
    if time_constant <= 0:
        return signal
    pole = np.exp(-period / time_constant)
    share = time_constant / period * (1 - pole)
    level = signal - signal[0]
    return np.asarray(lfilter([1 - share, share - pole], [1.0, -pole], level) + signal[0])


def _pressure_noise(sensors: Sensors, n: int, rng: np.random.Generator) -> Array:
    pole = sensors.pole ** (1000.0 / sensors.rate)  # the correlation time of the noise does not depend on the rate
    transient = 200 * max(1, round(sensors.rate / 1000.0))
    white = rng.standard_normal(n + transient)
    coloured = lfilter([np.sqrt(1 - pole**2)], [1.0, -pole], white)[transient:]
    hum = sensors.hum * np.sin(2 * np.pi * (HUM_HZ / sensors.rate * np.arange(n) + rng.random()))
    return np.asarray(sensors.pressure * coloured + hum)


def _round_to_step(signal: Array, step: float) -> Array:
    return step * np.round(signal / step) if step > 0 else signal
