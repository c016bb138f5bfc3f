"""Where a pipeline stands, in a few lines: the error and its fall, the verdict, what to do, checks, the report."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pneucli.messages import diagnose, history, labelled
from pneucli.messages.formatting import format_parameters, join_names

Answer = Mapping[str, Any]


def lines(
    answers: Mapping[str, Answer], models: Sequence[Answer], checks: Sequence[str], report: str, file: str
) -> Iterator[str]:
    """Yield the lines; ``checks`` are those that failed."""
    here = history.models_on_current_data(models) if models else []
    if here:
        yield from labelled("error", history.error_reduction(here))
        if added := added_effects_line(here):
            yield from labelled("added", added)
    if answer := answers.get("diagnose"):
        yield from labelled("found", answer["sentence"])
        if answer["missing"] or answer.get("impossible"):
            yield from labelled("do", diagnose.next_step(answer, file))
    yield from labelled("checks", checks_line(checks, answers))
    yield from labelled("report", report)


def added_effects_line(models: Sequence[Answer]) -> str:
    """Return the effects that were added since the first of these models, with their sizes; nothing where none was."""
    first, last = models[0], models[-1]
    added = [name for name in last["effects"] if name not in first["effects"]]
    sizes = format_parameters(added_parameters(last, added))
    return f"{join_names(added)}{f': {sizes}' if sizes else ''}"


def added_parameters(model: Answer, effects: Sequence[str]) -> dict[str, Answer]:
    """Return the parameters of these effects; those of a single one without its name."""
    found = {name: p for name, p in model["parameters"].items() if name.partition(".")[0] in effects}
    return {name.partition(".")[2]: p for name, p in found.items()} if len(effects) == 1 else found


def checks_line(failed: Sequence[str], answers: Mapping[str, Answer]) -> str:
    """Return which checks failed, or that none did."""
    count = len(answers.get("report", {}).get("checks", []))
    if failed:
        return "; ".join(failed)
    return f"{count} passed" if count else "none stated in [checks]"
