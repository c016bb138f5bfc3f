"""The measured motion where a recording imposes it: its derivatives and its reversals."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.noise import NoiseModel
from pneucli.recording import Recording
from pneucli.simulate import layout as at
from pneucli.simulate.local_polynomials import LocalPolynomialSmoother
from pneucli.simulate.motion_smoother import MotionSmoother, unrounded_readings
from pneucli.simulate.position_smoother import PositionSmoother
from pneucli.simulate.velocity_integration import IntegratedMotion

DIFFERENTIATION_BANDWIDTH_FACTOR = 4.0  # times the frequency of the low-pass, before differentiation
RISE_TIME_FACTOR = 0.35  # rise time from 10 to 90 % of a step times the frequency of the low-pass


class MeasuredMotion(Protocol):
    """The part of an experiment from which its imposed motion follows."""

    @property
    def recording(self) -> Recording:
        """The recording itself."""
        ...

    @property
    def time(self) -> Array:
        """Time stamps in s, shape (n,)."""
        ...

    @property
    def raw(self) -> Mapping[str, Array]:
        """Measured signals without gaps."""
        ...

    @property
    def noise(self) -> Mapping[str, NoiseModel]:
        """Noise of each sensor."""
        ...

    @property
    def smoothers(self) -> Mapping[str, LocalPolynomialSmoother]:
        """Smoother of each signal."""
        ...

    @property
    def motion_smoother(self) -> MotionSmoother | PositionSmoother | IntegratedMotion | None:
        """Smoother of position, with the acceleration where that is measured; or what integrates one of v and a."""
        ...

    @property
    def inputs(self) -> Array:
        """Smoothed signals in the kernel's layout, shape (n, 8)."""
        ...

    @property
    def low_pass(self) -> float | None:
        """Frequency in Hz at which the comparison filters."""
        ...

    def low_passed(self, values: Array, bandwidth_factor: float = 1.0) -> Array:
        """Return values (n,) filtered at that frequency times the factor."""
        ...


def imposed_motion(experiment: MeasuredMotion, noise: Mapping[str, Array] | None = None) -> tuple[Array, Array, Array]:
    """Return the imposed motion; derivatives that were not measured follow from x.

    With a low-pass, x is filtered at ``DIFFERENTIATION_BANDWIDTH_FACTOR`` times its frequency before differentiation:
    the filter of the comparison removes more, and differentiated noise would return through the sign of friction.

    Args:
        experiment: The experiment.
        noise: Noise added to the readings, by signal, each (n,).

    Returns:
        Position in m, velocity in m/s, acceleration in m/s^2, each (n,).
    """
    time, raw = experiment.time, experiment.raw
    if isinstance(experiment.motion_smoother, IntegratedMotion):
        readings = raw if noise is None else {n: y + noise.get(n, 0.0) for n, y in raw.items()}
        x, v = experiment.motion_smoother(readings)
        return x, v, raw["a"] if "a" in raw else np.gradient(v, time)
    x = unrounded_readings(raw, experiment.motion_smoother)["x"]
    x = x if noise is None else x + noise.get("x", 0.0)
    if isinstance(experiment.motion_smoother, MotionSmoother):
        x, v, _ = experiment.motion_smoother(x, raw["a"])
        return x, v, raw["a"]
    if experiment.low_pass is not None:
        x = experiment.low_passed(x, DIFFERENTIATION_BANDWIDTH_FACTOR)
    elif experiment.motion_smoother is not None:
        x, v, a = experiment.motion_smoother(x)
        return x, raw.get("v", v), a
    v = raw["v"] if "v" in raw else np.gradient(x, time)
    return x, v, raw["a"] if "a" in raw else np.gradient(v, time)


class MotionInputs(NamedTuple):
    """An imposed motion as inputs of the kernel (n, 8) and acceleration in m/s^2 (n,), and the speed in m/s below which
    its direction is uncertain.
    """

    inputs: Array
    acceleration: Array
    standstill_speed: float


def motion_inputs(experiment: MeasuredMotion, noise: Mapping[str, Array] | None = None) -> MotionInputs:
    """Return the imposed motion as the inputs of a model.

    Args:
        experiment: The experiment.
        noise: Noise added to the readings, by signal, each (n,).

    Returns:
        The inputs, in which x (m) and v (m/s) are those of the motion.
    """
    inputs = experiment.inputs.copy()
    inputs[:, at.IN_X], inputs[:, at.IN_V], a = imposed_motion(experiment, noise)
    return MotionInputs(inputs, a, standstill_speed(experiment, inputs[:, at.IN_V]))


def smooth_acceleration(experiment: MeasuredMotion) -> Array:
    """Return the acceleration that the measured position or velocity shows.

    Args:
        experiment: The experiment.

    Returns:
        Acceleration in m/s^2, shape (n,).
    """
    if isinstance(experiment.motion_smoother, IntegratedMotion):
        return np.asarray(np.gradient(experiment.motion_smoother(experiment.raw)[1], experiment.time))
    if isinstance(experiment.motion_smoother, PositionSmoother):
        readings = unrounded_readings(experiment.raw, experiment.motion_smoother)
        return experiment.motion_smoother(readings["x"])[2]
    v = experiment.raw["v"] if "v" in experiment.raw else np.gradient(experiment.raw["x"], experiment.time)
    return np.asarray(np.gradient(v, experiment.time))


def detect_reversals(experiment: MeasuredMotion) -> NDArray[np.bool_]:
    """Return the samples at which the direction of the measured motion is uncertain.

    A reversal lasts from the last sample in one direction to the first in the other; sampling and smoothing shift it by
    up to a period. A low-pass widens it by its rise time on both sides.

    Args:
        experiment: The experiment.

    Returns:
        True at a reversal, shape (n,); nowhere in a recording that would contain nothing else.
    """
    v, period = imposed_motion(experiment)[1], experiment.recording.period
    uncertain = np.abs(v) <= standstill_speed(experiment, v)
    moving = np.flatnonzero(~uncertain)
    reversed_after = np.flatnonzero(np.diff(np.sign(v[moving])))
    rise = 0 if experiment.low_pass is None else round(RISE_TIME_FACTOR / experiment.low_pass / period)
    for last, first in zip(moving[reversed_after], moving[reversed_after + 1], strict=True):
        uncertain[max(last - rise, 0) : first + rise + 1] = True
    return uncertain if not uncertain.all() else np.zeros_like(uncertain)


def standstill_speed(experiment: MeasuredMotion, v: Array) -> float:
    """Return the speed below which the direction of the measured motion is uncertain.

    Args:
        experiment: The experiment.
        v: Velocity in m/s, shape (n,).

    Returns:
        Speed in m/s.
    """
    period = experiment.recording.period
    noise = experiment.noise["x"].rms / period if "x" in experiment.noise else 0.0
    return float(min(max(noise, 1e-6), 0.05 * np.max(np.abs(v)) + 1e-9))
