"""Each model driven by the measured forces, and how far it misses acceleration and velocity (tables 6.2 and 6.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.friction.drive import run
from pneucli.identify.friction.models import FrictionModel, Name
from pneucli.identify.friction.motion import Motion

Array = NDArray[np.float64]
Channel = Literal["a", "v", "force"]

STEP = 1e-4  # s, the longest step
FINER = 4  # nodes of the simulator's table to one of the models' grid, so that the grid's own error shows
UNITS: dict[Channel, str] = {"a": "m/s^2", "v": "m/s", "force": "N"}
POOLED = "all"


@dataclass(frozen=True)
class Deviation:
    """Root mean square deviation of one model in one channel of one recording (or of ``all`` of a use).

    ``rmsd`` in ``unit``; ``percent`` of the measured range; ``relative_percent`` 100 |y - model| / |y|, 2-norms.
    """

    model: Name
    recording: str
    use: Literal["train", "test"]
    channel: Channel
    unit: str
    rmsd: float
    percent: float
    relative_percent: float


def level_tables(model: FrictionModel) -> tuple[Array, float]:
    """Return the friction levels (N), shape (2, 2, n): toward +x and -x, then speeding up and slowing; and the step."""
    n = FINER * model.domain.nodes // 2
    step = model.domain.top / n
    speed = np.asarray(step * (np.arange(n) + 0.5), dtype=np.float64)
    rows = [[model.level(d * speed, accelerating=b) for b in (True, False)] for d in (1.0, -1.0)]
    return np.maximum(np.array(rows), 0.0), step


def driven(model: FrictionModel, motion: Motion, mass: float, offset: float) -> tuple[Array, Array]:
    """Return v (m/s) and a (m/s^2), shape (n,), of the model under a recording's drive, started once at its v."""
    tables, step = level_tables(model)
    start = float(motion.v[0]) if abs(motion.v[0]) > motion.floor else 0.0
    v, a = run(motion.time, motion.smooth_drive - offset, start, mass, tables, step, STEP)
    return v, a


def predicted_force(model: FrictionModel, motion: Motion, mass: float, offset: float) -> Array:
    """Return the driving force (N), shape (n,), that a model asks for an imposed motion; the sign smoothed (6.22)."""
    inertia: Array = mass * motion.smooth_a
    return inertia + model.force(motion.v, motion.v * motion.smooth_a >= 0) + offset


def deviations(
    models: Sequence[FrictionModel], motions: Sequence[Motion], mass: float, offset: float
) -> tuple[Deviation, ...]:
    """Return the tables 6.2 and 6.3: per model, recording and channel, and pooled per use.

    Acceleration is compared where an accelerometer measured it; an imposed motion is compared by its force.
    """
    out: list[Deviation] = []
    for model in models:
        pairs: dict[tuple[Literal["train", "test"], Channel], list[tuple[Array, Array]]] = {}
        for m in motions:
            for channel, measured, modelled in _compared(model, m, mass, offset):
                use = m.recording.use
                y, z = measured[m.valid], modelled[m.valid]
                out.append(_deviation(model.name, m.recording.name, use, channel, y, z))
                pairs.setdefault((use, channel), []).append((y, z))
        for (use, channel), several in pairs.items():
            y, z = (np.concatenate(side) for side in zip(*several, strict=True))
            out.append(_deviation(model.name, POOLED, use, channel, y, z))
    return tuple(out)


def _compared(model: FrictionModel, m: Motion, mass: float, offset: float) -> list[tuple[Channel, Array, Array]]:
    if m.imposed:
        return [("force", m.drive, predicted_force(model, m, mass, offset))]
    v, a = driven(model, m, mass, offset)
    both: list[tuple[Channel, Array, Array]] = [("a", m.a, a), ("v", m.v, v)]
    return both if m.measured_a else both[1:]


def _deviation(
    name: Name, recording: str, use: Literal["train", "test"], channel: Channel, y: Array, z: Array
) -> Deviation:
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
    )
