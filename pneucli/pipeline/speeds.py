"""How long a stage will take on this machine: by what its earlier runs took, which a small file remembers.

On a machine where it has not run, what the demo took on another one is scaled by the speed of a short loop on both.
"""

from __future__ import annotations

import json
import math
import os
import time
from contextlib import suppress
from functools import cache
from pathlib import Path

from pneucli.paths import cache_folder
from pneucli.pipeline.manifest import digest

SPEEDS_FILE = "speeds.json"
MAX_PIPELINES = 50  # that are remembered for each stage, the last ones
Runs = dict[str, tuple[float, float]]  # units of work and seconds of the last run, by the digest of the pipeline's path


# units of work and seconds of each stage of the demo (`make demo`, all compiled), and of the loop on the same machine
DEMO_RUNS: dict[str, tuple[float, float]] = {}
LOOP_LENGTH, LOOP_SECONDS = 200_000, 0.01


def estimate(stage: str, pipeline: Path, units: float) -> float | None:
    """Return about how many seconds a stage will take; None where no run tells.

    The last run of this pipeline tells, or else that of the pipeline whose work is the most alike in size, or else,
    where the stage has not run on this machine, that of the demo on another one.

    Args:
        stage: The stage's name.
        pipeline: The pipeline file.
        units: Its work, to which the time is about proportional.

    """
    runs = _read().get(stage, {})
    if not runs and stage in DEMO_RUNS:
        demo, seconds = DEMO_RUNS[stage]
        runs = {"": (demo, seconds * _slowness())}
    alike = min(runs.values(), key=lambda run: abs(math.log(run[0] / units)), default=None)
    run = runs.get(_key(pipeline), alike)
    return None if run is None else run[1] * units / run[0]


@cache
def _slowness() -> float:
    """Return how many times as long a short loop takes here as on the machine of :data:`DEMO_RUNS`."""

    def seconds() -> float:
        begun = time.perf_counter()
        sum(k * k for k in range(LOOP_LENGTH))
        return time.perf_counter() - begun

    return min(seconds() for _ in range(3)) / LOOP_SECONDS


def remember(stage: str, pipeline: Path, units: float, seconds: float) -> None:
    """Remember a run for later estimates; a cache that cannot be written is left as it is."""
    found = _read()
    runs, key = found.setdefault(stage, {}), _key(pipeline)
    runs.pop(key, None)
    runs[key] = (units, seconds)
    found[stage] = dict([*runs.items()][-MAX_PIPELINES:])
    with suppress(OSError):
        path = cache_folder() / SPEEDS_FILE
        draft = path.with_name(f".{SPEEDS_FILE}.{os.getpid()}")
        draft.write_text(json.dumps(found), encoding="utf-8")
        draft.replace(path)


def _read() -> dict[str, Runs]:
    """Return the remembered runs by stage; none from a file that is not there, or damaged."""
    try:
        content = json.loads((cache_folder() / SPEEDS_FILE).read_text(encoding="utf-8"))
        return {
            stage: {key: (float(units), float(seconds)) for key, (units, seconds) in runs.items() if units > 0.0}
            for stage, runs in content.items()
        }
    except (OSError, ValueError, TypeError, AttributeError):
        return {}


def _key(pipeline: Path) -> str:
    return digest(str(pipeline.absolute()))[:16]
