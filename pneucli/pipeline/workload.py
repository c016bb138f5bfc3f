"""What a stage has before it, and how long it will take on this machine: by what its earlier runs took.

Where it has not run on this machine, what it took of the demo on another one is scaled by a short loop on both.
"""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from pneucli.messages.formatting import join_names
from pneucli.paths import cache_folder
from pneucli.pipeline.graph import Context, Workload
from pneucli.pipeline.manifest import digest

if TYPE_CHECKING:
    from pneucli.pipeline.manifest import Stamp


BYTES_OF_A_FILE = 100_000  # that take about as long to read as a file takes to open
SPEEDS_FILE = "speeds.json"
MAX_PIPELINES = 50  # that are remembered for each stage, the last ones
Runs = dict[str, tuple[float, float]]  # units of work and seconds of the last run, by the digest of the pipeline's path


class DemoRun(NamedTuple):
    """The work of a stage of the demo, how many seconds it took, and for how many more it compiled at its first run."""

    units: float
    seconds: float
    compiling: float = 0.0


# of `make demo`, and the seconds that the loop took on the same machine
DEMO_RUNS = {
    "ingest": DemoRun(5.9e6, 2.0),
    "identify": DemoRun(2.7e5, 11.0, 36.0),
    "compare": DemoRun(2.7e5, 1.3),
    "diagnose": DemoRun(2.5e6, 9.0, 4.0),
    "design": DemoRun(7, 12.5, 43.0),
    "simulate": DemoRun(112, 6.1),
    "report": DemoRun(26, 6.4),
}
LOOP_LENGTH, LOOP_SECONDS = 200_000, 0.009


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
    if not runs and (demo := DEMO_RUNS.get(stage)):
        return (demo.compiling + demo.seconds * units / demo.units) * _slowness()
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


def workload(stage: str, context: Context, files: Mapping[str, Stamp]) -> Workload:
    """Return what a stage has before it, from the pipeline file and the answers of earlier stages.

    Args:
        stage: The stage's name.
        context: What it will run with.
        files: The stamps of its input files.

    """
    if stage == "ingest":
        size = sum(max(0, one.size) for one in files.values())
        text = f"{_count(len(files), 'file')}, {1e-6 * size:.1f} MB"
        return Workload(text, size + BYTES_OF_A_FILE * max(1, len(files)))
    if stage in ("identify", "compare", "diagnose"):
        return _of_recordings(stage, context)
    if stage == "export":
        return Workload(join_names(context.options.get("to") or ()), 1)
    number, noun = {"design": _laws, "simulate": _runs, "plan": _candidates}.get(stage, _recordings)(context)
    return Workload(_count(number, noun), max(1, number))


def _of_recordings(stage: str, context: Context) -> Workload:
    recordings = context.answers["ingest"]["recordings"]
    samples = sum(one["samples"] for one in recordings)
    text, in_model = f"{_count(*_recordings(context))}, {samples:,} samples", len(context.config.model.effects)
    if stage != "diagnose":
        return Workload(f"{text}, {_count(in_model, 'effect')} in the model", (1 + in_model) * max(1, samples))
    from pneucli.diagnose.subsample import searched_samples  # noqa: PLC0415 - only a diagnosis needs it

    candidates = _candidates(context)
    return Workload(f"{_count(*candidates)} on {text}", candidates[0] * searched_samples(max(1, samples)))


def _recordings(context: Context) -> tuple[int, str]:
    return len(context.answers.get("ingest", {}).get("recordings", ())), "recording"


def _candidates(context: Context) -> tuple[int, str]:
    """Return how many effects of the catalogue the model may lack."""
    from pneucli.physics.effects import catalogue  # noqa: PLC0415 - other stages need none

    known = {*context.config.model.effects, *context.options.get("exclude", ())}
    return max(1, len(catalogue().keys() - known)), "effect"


def _laws(context: Context) -> tuple[int, str]:
    from pneucli.controller.laws import LAWS  # noqa: PLC0415 - other stages need none

    return len(context.options.get("compare") or LAWS), "control law"


def _runs(context: Context) -> tuple[int, str]:
    """Return how many closed loops with drawn parameters are simulated."""
    if "design" not in context.answers:
        return _recordings(context)
    from pneucli.closed_loop.robustness import MonteCarloSettings  # noqa: PLC0415 - only this stage needs it

    stated = context.config.scenarios
    studies = [one for one in stated if one.get("kind") == "monte-carlo"] or ([] if stated else [{}])
    runs = [one.get("runs", MonteCarloSettings.runs) for one in studies]
    number = sum(n for n in runs if isinstance(n, int))
    return (number, "Monte Carlo run") if number else _recordings(context)


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"
