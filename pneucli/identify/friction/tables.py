"""Each model driven by the measured forces, and how far it misses acceleration and velocity (tables 6.2 and 6.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.friction.models import FrictionModel, Name
from pneucli.identify.friction.motion import Motion

Array = NDArray[np.float64]
Channel = Literal["a", "v", "force"]

STEPS = 10  # of the simulation, from one sample to the next
FINER = 4  # nodes of the simulator's table to one of the models' grid, so that the grid's own error shows
UNITS: dict[Channel, str] = {"a": "m/s^2", "v": "m/s", "force": "N"}
POOLED = "all"


@dataclass(frozen=True)
class Deviation:
    """Root mean square deviation of one model in one channel of one recording (or of ``all`` of a use).

    ``rmsd`` in ``unit``; ``percent`` of the measured range; ``relative_percent`` 100 |y - model| / |y|, 2-norms.
    ``noise`` is what the noise of the sensors alone makes of it, in the channel and through the drive (``unit``).
    """

    model: Name
    recording: str
    use: Literal["train", "test"]
    channel: Channel
    unit: str
    rmsd: float
    percent: float
    relative_percent: float
    noise: float


class Compared(NamedTuple):
    """Measured and modelled channel, each (n,), and draws (DRAWS, n) of what noise makes of their difference."""

    measured: Array
    modelled: Array
    noise: Array


def level_tables(model: FrictionModel) -> tuple[Array, float]:
    """Return the friction levels (N), shape (2, 2, n): toward +x and -x, then speeding up and slowing; and the step."""
    n = FINER * model.domain.nodes // 2
    step = model.domain.top / n
    speed = np.asarray(step * (np.arange(n) + 0.5), dtype=np.float64)
    rows = [[model.level(d * speed, accelerating=b) for b in (True, False)] for d in (1.0, -1.0)]
    return np.maximum(np.array(rows), 0.0), step


def driven(model: FrictionModel, motion: Motion, mass: float, noise: Array | float = 0.0) -> Array:
    """Return v (m/s) and a (m/s^2), shape (2, n), of the model under a recording's drive, started once at its v.

    The effects' forces act at the measured position and the model's own velocity. ``noise`` (N) disturbs the drive.
    """
    tables, step = level_tables(model)
    start = float(motion.v[0]) if abs(motion.v[0]) > motion.floor else 0.0
    drive = motion.smooth_drive - motion.load - model.offset + noise
    return motion.beside.driven(motion.time, drive, motion.x, start, mass, tables, step, STEPS)


def predicted_force(model: FrictionModel, motion: Motion, mass: float) -> Array:
    """Return the driving force (N), shape (n,), that a model asks for an imposed motion; the sign smoothed (6.22)."""
    inertia: Array = mass * motion.smooth_a
    return inertia + model.force(motion.v, motion.v * motion.smooth_a >= 0) + model.offset - motion.load


def deviations(models: Sequence[FrictionModel], motions: Sequence[Motion], mass: float) -> tuple[Deviation, ...]:
    """Return the tables 6.2 and 6.3: per model, recording and channel, and pooled per use.

    Acceleration is compared where an accelerometer measured it; an imposed motion is compared by its force.
    """
    out: list[Deviation] = []
    for model in models:
        pairs: dict[tuple[Literal["train", "test"], Channel], list[Compared]] = {}
        for m in motions:
            for channel, compared in _compared(model, m, mass):
                use = m.recording.use
                seen = Compared(*(side[..., m.valid] for side in compared))
                out.append(_deviation(model.name, m.recording.name, use, channel, seen))
                pairs.setdefault((use, channel), []).append(seen)
        for (use, channel), several in pairs.items():
            together = Compared(*(np.concatenate(side, axis=-1) for side in zip(*several, strict=True)))
            out.append(_deviation(model.name, POOLED, use, channel, together))
    return tuple(out)


def _compared(model: FrictionModel, m: Motion, mass: float) -> list[tuple[Channel, Compared]]:
    """Return what is measured and modelled, and draws of what noise makes of their difference."""
    rng = np.random.default_rng(0)
    if m.imposed:
        spread = mass * m.sigma_a * rng.standard_normal(m.redrawn.shape)
        return [("force", Compared(m.drive - m.load, predicted_force(model, m, mass), m.redrawn + spread))]
    nominal = driven(model, m, mass)
    missed = np.array([driven(model, m, mass, noise) for noise in m.redrawn]) - nominal
    own = rng.standard_normal(missed.shape) * np.array([m.sigma_v, m.measured_a])[:, None]
    v, a = (Compared(y, z, d) for y, z, d in zip((m.v, m.a), nominal, (missed + own).swapaxes(0, 1), strict=True))
    return [("a", a), ("v", v)] if m.measured_a else [("v", v)]


def _deviation(
    name: Name, recording: str, use: Literal["train", "test"], channel: Channel, compared: Compared
) -> Deviation:
    y, z, drawn = compared
    rmsd = float(np.sqrt(np.mean((y - z) ** 2)))
    size = float(np.sqrt(np.mean(y**2)))
    spread = float(np.ptp(y))
    return Deviation(
        model=name,
        recording=recording,
        use=use,
        channel=channel,
        unit=UNITS[channel],
        rmsd=rmsd,
        percent=100 * rmsd / spread if spread else float("nan"),
        relative_percent=100 * rmsd / size if size else float("nan"),
        noise=float(np.sqrt(np.mean(drawn**2))),
    )
