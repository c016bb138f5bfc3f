"""The clock of a recorded force against that of the motion and the pressures."""

from __future__ import annotations

import numpy as np

from pneucli.arrays import Array, read_only
from pneucli.caches import compiled, part
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
    e, out = experiment, np.empty(experiment.time.size)
    signals = read_only(e.time), read_only(force), read_only(v), read_only(e.raw["force"])
    _write_recorded_late(*signals, e.recording.period, delay, out)
    return out


@compiled(nogil=True, error_model="numpy")
def _write_recorded_late(
    time: Array, force: Array, v: Array, recorded: Array, period: float, delay: float, out: Array
) -> None:
    """Write the force at each sample, in one pass."""
    place = before = behind = 1
    for i in range(time.size):
        earlier = min(max(time[i] - delay, time[0]), time[-1])
        place, before = _next_sample(time, earlier, place), _next_sample(time, earlier - period, before)
        behind = _next_sample(time, earlier + period, behind)
        way, speed = _share_of_way(time, earlier, place), _interpolated(time, v, earlier, place)
        if np.sign(v[place - 1]) * np.sign(speed) < 0.0:  # along the samples of the same direction
            way = 1.0
        elif np.sign(v[place]) * np.sign(speed) < 0.0:
            way = 0.0
        later = _interpolated(time, v, earlier + period, behind)
        change = abs(later - _interpolated(time, v, earlier - period, before)) / 2.0
        share = min(abs(speed) / max(change, MIN_SPEED), 1.0) if earlier == time[i] - delay else 0.0
        acting = (1.0 - way) * force[place - 1] + way * force[place]
        out[i] = share * acting + (1.0 - share) * recorded[i]


@part()
def _next_sample(time: Array, wanted: float, place: int) -> int:
    """Return the first sample from ``place`` on, if not the last one, that is not before a time."""
    while place < time.size - 1 and time[place] < wanted:
        place += 1
    return place


@part()
def _share_of_way(time: Array, wanted: float, place: int) -> float:
    """Return how far a time is on the way to a sample from the one before, from 0 to 1."""
    return float(min(max((wanted - time[place - 1]) / (time[place] - time[place - 1]), 0.0), 1.0))


@part()
def _interpolated(time: Array, values: Array, wanted: float, place: int) -> float:
    """Return a signal between a sample and the one before."""
    way = _share_of_way(time, wanted, place)
    return float((1.0 - way) * values[place - 1] + way * values[place])


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
