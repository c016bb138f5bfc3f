"""Errors of the friction models under the measured forces, in acceleration and velocity (thesis tables 6.2, 6.3)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from pneucli.arrays import Array
from pneucli.identify.friction.kinematics import Motion
from pneucli.identify.friction.models_a_to_f import FrictionModel, ModelName
from pneucli.identify.friction.samples import StickSlip

Channel = Literal["a", "v", "force"]

SUBSTEPS = 10  # of the simulation between two samples
TABLE_REFINEMENT = 4  # nodes of the simulator's table for each node of the models' grid, so that its error shows
UNITS: dict[Channel, str] = {"a": "m/s^2", "v": "m/s", "force": "N"}
POOLED = "all"


@dataclass(frozen=True)
class Deviation:
    """Root mean square deviation of one model in one channel of one recording (or of ``all`` of a use).

    ``rmsd`` in ``unit``; ``percent`` of the measured range; ``relative_percent`` 100 |y - model| / |y|, 2-norms.
    ``noise`` is the deviation from the noise of the sensors alone, in the channel and through the drive (``unit``).
    """

    model: ModelName
    recording: str
    use: Literal["train", "test"]
    channel: Channel
    unit: str
    rmsd: float
    percent: float
    relative_percent: float
    noise: float


class ChannelSums(NamedTuple):
    """Sums over the samples of one channel: squares of the ``measured`` values, of the model error, and of noise alone.

    ``missed`` is the sum for the model error, ``noise`` the mean over draws of the noise; ``low`` and ``high`` are the
    smallest and largest measured value.
    """

    samples: int
    measured: float
    error: float
    noise: float
    low: float
    high: float


def _level_tables(model: FrictionModel) -> tuple[Array, float]:
    """Tabulate the friction levels of a model for the simulator."""
    n = TABLE_REFINEMENT * model.domain.nodes // 2
    step = model.domain.max_velocity / n
    speed = np.asarray(step * (np.arange(n) + 0.5), dtype=np.float64)
    rows = [[model.level(d * speed, accelerating=b) for b in (True, False)] for d in (1.0, -1.0)]
    return np.maximum(np.array(rows), 0.0), step


def simulate_driven(
    model: FrictionModel, motion: Motion, mass: float, noise: Array | float = 0.0, span: slice = slice(None)
) -> Array:
    """Simulate a friction model under the measured drive of a recording, from its initial velocity.

    The effects' forces act at the measured position and the simulated velocity. On an end of the stroke the piston
    rests, and the simulation starts again where it leaves.

    Args:
        model: The friction model.
        motion: Motion and driving force of the recording.
        mass: Moving mass in kg.
        noise: Disturbance of the drive in N.
        span: The samples to simulate.

    Returns:
        v (m/s) and a (m/s^2), shape (2, n).

    """
    tables, step = _level_tables(model)
    time, x, v = (values[span] for values in (motion.time, motion.x, motion.v))
    drive = (motion.smooth_drive - motion.load - model.offset + noise)[span]
    out = np.zeros((2, time.size))
    edges = np.flatnonzero(np.diff(motion.contact[span], prepend=True, append=True)).reshape(-1, 2)
    for free in (slice(first, last) for first, last in edges.tolist()):
        start = float(v[free][0])
        out[:, free] = motion.non_friction.simulate_driven(
            time[free],
            drive[free],
            x[free],
            start if abs(start) > motion.rest_speed else 0.0,
            motion.moved_mass(mass),
            tables,
            step,
            SUBSTEPS,
        )
    return out


@dataclass(frozen=True)
class StickSlipReplay:
    """One stick-slip cycle as measured and as a model simulates it under the same drive; arrays of shape (n,), SI."""

    model: ModelName
    recording: str
    time: Array
    v: Array
    v_model: Array
    a: Array
    a_model: Array


def replay_stick_slip(
    models: Sequence[FrictionModel], motions: Sequence[Motion], stick_slips: Sequence[StickSlip], mass: float
) -> tuple[StickSlipReplay, ...]:
    """Simulate the stick-slip cycle with the highest speed under each model.

    Args:
        models: The friction models.
        motions: The motions of all recordings.
        stick_slips: The stick-slip cycles.
        mass: Moving mass in kg.

    Returns:
        One replay a model; none without a cycle.

    References:
        Thesis, figures 6.14 to 6.19 and 6.34 to 6.39.

    """
    by_name = {m.recording.name: m for m in motions}
    one = max(stick_slips, key=lambda c: c.peak_speed, default=None)
    if one is None:
        return ()
    motion, duration = by_name[one.recording], one.stop - one.breakaway
    span = slice(max(one.start, one.breakaway - duration), min(one.end, one.stop + duration))
    out = []
    for model in models:
        v, a = simulate_driven(model, motion, mass, span=span)
        time, measured = (
            motion.time[span] - motion.time[one.breakaway],
            motion.a if motion.accelerometer_noise else motion.smooth_a,
        )
        out.append(StickSlipReplay(model.name, one.recording, time, motion.v[span], v, measured[span], a))
    return tuple(out)


def _predicted_force(model: FrictionModel, motion: Motion, mass: float) -> Array:
    """Compute the driving force that a model needs for an imposed motion, with the smoothed sign."""
    inertia: Array = motion.moved_mass(mass) * motion.smooth_a
    return inertia + model.force(motion.v, motion.v * motion.smooth_a >= 0) + model.offset - motion.load


def model_deviations(models: Sequence[FrictionModel], motions: Sequence[Motion], mass: float) -> tuple[Deviation, ...]:
    """Compute the deviations of each model for each recording and channel, and pooled over each use.

    Acceleration is compared where an accelerometer measured it; an imposed motion is compared by its force.

    Args:
        models: The friction models.
        motions: The motions of all recordings.
        mass: Moving mass in kg.

    Returns:
        The deviations.

    References:
        Thesis, tables 6.2 and 6.3.

    """
    out: list[Deviation] = []
    for model in models:
        pairs: dict[tuple[Literal["train", "test"], Channel], list[ChannelSums]] = {}
        for m in motions:
            for channel, sums in _channel_sums(model, m, mass).items():
                use = m.recording.use
                out.append(_deviation(model.name, m.recording.name, use, channel, sums))
                pairs.setdefault((use, channel), []).append(sums)
        for (use, channel), all_sums in pairs.items():
            out.append(_deviation(model.name, POOLED, use, channel, _pooled(all_sums)))
    return tuple(out)


def _channel_sums(model: FrictionModel, m: Motion, mass: float) -> dict[Channel, ChannelSums]:
    """Return the sums of each measured channel."""
    rng = np.random.default_rng(0)
    if m.imposed:
        spread = m.moved_mass(mass) * m.sigma_a
        drawn = np.mean(
            [_sum_of_squares(one + spread * rng.standard_normal(one.size), m) for one in m.drive_noise_draws]
        )
        return {"force": _sums(m, m.drive - m.load, _predicted_force(model, m, mass), float(drawn))}
    nominal, sensor_noise = simulate_driven(model, m, mass), np.array([[m.sigma_v], [m.accelerometer_noise]])
    powers = []
    for noise in m.drive_noise_draws:
        error = simulate_driven(model, m, mass, noise)
        error -= nominal
        error += sensor_noise * rng.standard_normal(error.shape)
        powers.append([_sum_of_squares(one, m) for one in error])
    noise_v, noise_a = np.mean(powers, axis=0)
    v, a = _sums(m, m.v, nominal[0], noise_v), _sums(m, m.a, nominal[1], noise_a)
    return {"a": a, "v": v} if m.accelerometer_noise else {"v": v}


def _sum_of_squares(values: Array, m: Motion) -> float:
    """Return the sum of squares over valid samples."""
    return float(np.sum(values[m.valid] ** 2))


def _sums(m: Motion, measured: Array, modelled: Array, noise: float) -> ChannelSums:
    valid = measured[m.valid]
    power, error = _sum_of_squares(measured, m), _sum_of_squares(measured - modelled, m)
    return ChannelSums(valid.size, power, error, noise, float(valid.min()), float(valid.max()))


def _pooled(all_sums: Sequence[ChannelSums]) -> ChannelSums:
    samples, measured, error, noise, low, high = zip(*all_sums, strict=True)
    return ChannelSums(sum(samples), sum(measured), sum(error), sum(noise), min(low), max(high))


def _deviation(
    name: ModelName, recording: str, use: Literal["train", "test"], channel: Channel, sums: ChannelSums
) -> Deviation:
    size, rmsd, noise = (np.sqrt(power / sums.samples) for power in sums[1:4])
    spread = sums.high - sums.low
    return Deviation(
        model=name,
        recording=recording,
        use=use,
        channel=channel,
        unit=UNITS[channel],
        rmsd=float(rmsd),
        percent=float(100 * rmsd / spread) if spread else float("nan"),
        relative_percent=float(100 * rmsd / size) if size else float("nan"),
        noise=float(noise),
    )
