"""What a stage has before it: the counts of its first line, and the units by which its time is estimated."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from pneucli.messages.formatting import join_names
from pneucli.pipeline.context import Context, Workload

if TYPE_CHECKING:
    from pneucli.pipeline.manifest import Stamp

BYTES_OF_A_FILE = 100_000  # that take about as long to read as a file takes to open


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
    from pneucli.diagnose.subsample import MAX_SAMPLES  # noqa: PLC0415 - only a diagnosis needs it

    candidates = _candidates(context)
    return Workload(f"{_count(*candidates)} on {text}", candidates[0] * min(max(1, samples), MAX_SAMPLES))


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
