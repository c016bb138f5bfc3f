"""Each model driven by the measured forces, and how far it misses acceleration and velocity (tables 6.2 and 6.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.friction.kinematics import Motion
from pneucli.identify.friction.models_a_to_f import FrictionModel, ModelName
from pneucli.identify.friction.stick_slip import StickSlip

Array = NDArray[np.float64]
Channel = Literal["a", "v", "force"]

SUBSTEPS = 10  # of the simulation, from one sample to the next
TABLE_REFINEMENT = 4  # nodes of the simulator's table to one of the models' grid, so that the grid's own error shows
UNITS: dict[Channel, str] = {"a": "m/s^2", "v": "m/s", "force": "N"}
POOLED = "all"


@dataclass(frozen=True)
class Deviation:
    """Root mean square deviation of one model in one channel of one recording (or of ``all`` of a use).

    ``rmsd`` in ``unit``; ``percent`` of the measured range; ``relative_percent`` 100 |y - model| / |y|, 2-norms.
    ``noise`` is what the noise of the sensors alone makes of it, in the channel and through the drive (``unit``).
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
    """How a channel compares: the number of its samples, and sums of squares over them.

    Of what was ``measured``, of what the model ``missed`` of it, and of what ``noise`` makes of that, the mean over
    draws; ``low`` and ``high`` are the least and the largest measured value. The draws themselves fill the memory.
    """

    samples: int
    measured: float
    missed: float
    noise: float
    low: float
    high: float


def level_tables(model: FrictionModel) -> tuple[Array, float]:
    """Return the friction levels (N), shape (2, 2, n): toward +x and -x, then speeding up and slowing; and the step."""
    n = TABLE_REFINEMENT * model.domain.nodes // 2
    step = model.domain.max_velocity / n
    speed = np.asarray(step * (np.arange(n) + 0.5), dtype=np.float64)
    rows = [[model.level(d * speed, accelerating=b) for b in (True, False)] for d in (1.0, -1.0)]
    return np.maximum(np.array(rows), 0.0), step


def simulate_driven(
    model: FrictionModel, motion: Motion, mass: float, noise: Array | float = 0.0, span: slice = slice(None)
) -> Array:
    """Return v (m/s) and a (m/s^2), shape (2, n), of the model under a recording's drive, started once at its v.

    The effects' forces act at the measured position and the model's own velocity. ``noise`` (N) disturbs the drive.
    ``span`` is the stretch of samples that is driven.
    """
    tables, step = level_tables(model)
    begin = float(motion.v[span][0])
    start = begin if abs(begin) > motion.rest_speed else 0.0
    drive = motion.smooth_drive - motion.load - model.offset + noise
    return motion.non_friction.simulate_driven(
        motion.time[span], drive[span], motion.x[span], start, mass, tables, step, SUBSTEPS
    )


@dataclass(frozen=True)
class StickSlipReplay:
    """One stick-slip as measured and as a model gives it under the same drive; arrays of shape (n,), SI."""

    model: ModelName
    recording: str
    time: Array
    v: Array
    v_model: Array
    a: Array
    a_model: Array


def replay_stick_slip(
    models: Sequence[FrictionModel], motions: Sequence[Motion], cuts: Sequence[StickSlip], mass: float
) -> tuple[StickSlipReplay, ...]:
    """Return what each model makes of the single stick-slip with the highest speed (figures 6.14-6.19, 6.34-6.39)."""
    by_name = {m.recording.name: m for m in motions}
    one = max(cuts, key=lambda c: c.peak_speed, default=None)
    if one is None:
        return ()
    motion, slide = by_name[one.recording], one.stop - one.breakaway
    span = slice(max(one.start, one.breakaway - slide), min(one.end, one.stop + slide))
    out = []
    for model in models:
        v, a = simulate_driven(model, motion, mass, span=span)
        time, measured = (
            motion.time[span] - motion.time[one.breakaway],
            motion.a if motion.accelerometer_noise else motion.smooth_a,
        )
        out.append(StickSlipReplay(model.name, one.recording, time, motion.v[span], v, measured[span], a))
    return tuple(out)


def predicted_force(model: FrictionModel, motion: Motion, mass: float) -> Array:
    """Return the driving force (N), shape (n,), that a model asks for an imposed motion; the sign smoothed (6.22)."""
    inertia: Array = mass * motion.smooth_a
    return inertia + model.force(motion.v, motion.v * motion.smooth_a >= 0) + model.offset - motion.load


def model_deviations(models: Sequence[FrictionModel], motions: Sequence[Motion], mass: float) -> tuple[Deviation, ...]:
    """Return the tables 6.2 and 6.3: per model, recording and channel, and pooled per use.

    Acceleration is compared where an accelerometer measured it; an imposed motion is compared by its force.
    """
    out: list[Deviation] = []
    for model in models:
        pairs: dict[tuple[Literal["train", "test"], Channel], list[ChannelSums]] = {}
        for m in motions:
            for channel, compared in _channel_sums(model, m, mass).items():
                use = m.recording.use
                out.append(_deviation(model.name, m.recording.name, use, channel, compared))
                pairs.setdefault((use, channel), []).append(compared)
        for (use, channel), several in pairs.items():
            out.append(_deviation(model.name, POOLED, use, channel, _pooled(several)))
    return tuple(out)


def _channel_sums(model: FrictionModel, m: Motion, mass: float) -> dict[Channel, ChannelSums]:
    """Return how the model compares with the channels that were measured."""
    rng = np.random.default_rng(0)
    if m.imposed:
        spread = mass * m.sigma_a
        drawn = np.mean(
            [_sum_of_squares(one + spread * rng.standard_normal(one.size), m) for one in m.drive_noise_draws]
        )
        return {"force": _sums(m, m.drive - m.load, predicted_force(model, m, mass), float(drawn))}
    nominal, own = simulate_driven(model, m, mass), np.array([[m.sigma_v], [m.accelerometer_noise]])
    powers = []
    for noise in m.drive_noise_draws:
        missed = simulate_driven(model, m, mass, noise)
        missed -= nominal
        missed += own * rng.standard_normal(missed.shape)
        powers.append([_sum_of_squares(one, m) for one in missed])
    of_v, of_a = np.mean(powers, axis=0)
    v, a = _sums(m, m.v, nominal[0], of_v), _sums(m, m.a, nominal[1], of_a)
    return {"a": a, "v": v} if m.accelerometer_noise else {"v": v}


def _sum_of_squares(values: Array, m: Motion) -> float:
    """Return the sum of squares where the recording is valid."""
    return float(np.sum(values[m.valid] ** 2))


def _sums(m: Motion, measured: Array, modelled: Array, noise: float) -> ChannelSums:
    seen = measured[m.valid]
    power, missed = _sum_of_squares(measured, m), _sum_of_squares(measured - modelled, m)
    return ChannelSums(seen.size, power, missed, noise, float(seen.min()), float(seen.max()))


def _pooled(several: Sequence[ChannelSums]) -> ChannelSums:
    samples, measured, missed, noise, low, high = zip(*several, strict=True)
    return ChannelSums(sum(samples), sum(measured), sum(missed), sum(noise), min(low), max(high))


def _deviation(
    name: ModelName, recording: str, use: Literal["train", "test"], channel: Channel, compared: ChannelSums
) -> Deviation:
    size, rmsd, noise = (np.sqrt(power / compared.samples) for power in compared[1:4])
    spread = compared.high - compared.low
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
