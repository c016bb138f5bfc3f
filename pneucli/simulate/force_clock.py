"""The clock of a recorded force against that of the motion and the pressures."""

from __future__ import annotations

import numpy as np

from pneucli.arrays import Array
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model

MIN_SPEED = 1e-9  # m/s, below which nothing moves
SLOPE_SAMPLES = 4  # on each side, over which the slope between two samples is taken


def shifted(time: Array, values: Array, delay: float) -> Array:
    """Return a signal as it is a time later; beyond its ends the first and the last value are held.

    The nearest sample is extended along the slope over samples around it: the mean of two neighbours would have less
    noise than either, and a delay could gain by it.

    Args:
        time: Time stamps in s, shape (n,).
        values: The signal, shape (n,).
        delay: Time in s; may be negative.

    Returns:
        The signal at ``time + delay``, shape (n,).

    >>> time = np.arange(10.0)
    >>> shifted(time, 3.0 * time, 2.5)[:3].tolist()
    [7.5, 10.5, 13.5]
    >>> shifted(time, 3.0 * time, -2.0)[:4].tolist()
    [0.0, 0.0, 0.0, 3.0]
    """
    wanted, last = np.clip(time + delay, time[0], time[-1]), time.size - 1
    nearest = np.searchsorted(0.5 * (time[1:] + time[:-1]), wanted)
    before, after = np.maximum(nearest - SLOPE_SAMPLES, 0), np.minimum(nearest + SLOPE_SAMPLES, last)
    slope = (values[after] - values[before]) / (time[after] - time[before])
    return np.asarray(values[nearest] + (wanted - time[nearest]) * slope)


def recorded_late(experiment: Experiment, force: Array, v: Array, delay: float) -> Array:
    """Return the force that an imposed motion needs as its sensor records it.

    Dry friction jumps where the motion turns, which may be a sampling period early or late. Closer to the turn than
    that, the reading itself replaces a share of the force, all of it at the turn: what is compared is a continuous
    function of the delay. It replaces all of it where the motion of that time was not recorded.

    Args:
        experiment: An experiment with an imposed motion and a recorded force.
        force: The force in N at the time at which it acts, shape (n,).
        v: Velocity in m/s, shape (n,).
        delay: Delay in s; may be negative.

    Returns:
        Force in N, shape (n,).
    """
    time, period = experiment.time, experiment.recording.period
    earlier = np.clip(time - delay, time[0], time[-1])
    after = np.clip(np.searchsorted(time, earlier), 1, time.size - 1)
    way = (earlier - time[after - 1]) / (time[after] - time[after - 1])
    speed = (1.0 - way) * v[after - 1] + way * v[after]
    turned, turning = (np.sign(v[k]) * np.sign(speed) < 0.0 for k in (after - 1, after))
    way = np.where(turned, 1.0, np.where(turning, 0.0, way))  # along the samples of the same direction
    change = np.abs(np.interp(earlier + period, time, v) - np.interp(earlier - period, time, v)) / 2.0
    share = np.minimum(np.abs(speed) / np.maximum(change, MIN_SPEED), 1.0) * (earlier == time - delay)
    acting = (1.0 - way) * force[after - 1] + way * force[after]
    return np.asarray(share * acting + (1.0 - share) * experiment.raw["force"])


def force_delay(model: Model, experiment: Experiment) -> float:
    """Return the time in s by which the model has the force recorded later than the motion; 0 where none was."""
    return model.sum_of_port("force_delay") if "force" in experiment.raw else 0.0


def with_force_in_time(model: Model, experiment: Experiment, inputs: Array) -> Array:
    """Return inputs in which the recorded force stands at the time at which it acted.

    Args:
        model: The model.
        experiment: The experiment.
        inputs: Inputs in the kernel's layout, shape (n, 8).

    Returns:
        Inputs, shape (n, 8); the same array where the model has no such delay.
    """
    delay = force_delay(model, experiment)
    if delay == 0.0:
        return inputs
    moved = inputs.copy()
    moved[:, at.IN_FORCE] = shifted(experiment.time, inputs[:, at.IN_FORCE], delay)
    return moved
