"""Where a pipeline stands, in five lines: the error and its fall, what is missing, what is left, checks, the report."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pneucli.messages import diagnose, history, labelled
from pneucli.messages.formatting import format_number, format_parameters, format_percent, join_names

Answer = Mapping[str, Any]


def lines(
    answers: Mapping[str, Answer], models: Sequence[Answer], checks: Sequence[str], report: str, file: str
) -> Iterator[str]:
    """Yield the five lines; ``checks`` are those that failed."""
    if models:
        yield from labelled("error", history.error_reduction(history.models_on_current_data(models)))
    if answer := answers.get("diagnose"):
        yield from labelled("missing", missing_effect_line(answer, models, file))
        yield from labelled("left", unexplained_line(answer))
    yield from labelled("checks", checks_line(checks, answers))
    yield from labelled("report", report)


def missing_effect_line(answer: Answer, models: Sequence[Answer], file: str) -> str:
    """Return what is missing with the command that adds it, or what was and is in the model now."""
    if answer["missing"]:
        return (
            f"{diagnose.verdict_line(answer)}; {diagnose.error_reduction(answer)}: {diagnose.next_step(answer, file)}"
        )
    here = history.models_on_current_data(models) if models else []
    was = [name for name in here[-1]["effects"] if name not in here[0]["effects"]] if here else []
    if was:
        sizes = format_parameters(added_parameters(here[-1], was))
        return f"{join_names(was)} was missing and is in the model now{f': {sizes}' if sizes else ''}"
    return (
        "nothing that these recordings could show" if answer["verdict"] == "adequate" else diagnose.verdict_line(answer)
    )


def added_parameters(model: Answer, effects: Sequence[str]) -> dict[str, Answer]:
    """Return the parameters of these effects; those of a single one without its name."""
    found = {name: p for name, p in model["parameters"].items() if name.partition(".")[0] in effects}
    return {name.partition(".")[2]: p for name, p in found.items()} if len(effects) == 1 else found


def unexplained_line(answer: Answer) -> str:
    """Return what remains unexplained."""
    share = answer.get("unexplained_share")
    if answer["verdict"] == "adequate":
        return "nothing beyond noise and known uncertainty"
    if answer["verdict"] == "missing-effect":
        return f"with it {format_percent(share or 0.0)} of the error beyond noise"
    where = answer.get("unexplained") or {}
    over = f", over {where['variable']}" if where.get("variable") else ""
    stands = f": {where['channel']} errs by {format_number(where['times_noise'], 2)} × its noise{over}" if where else ""
    return f"{format_percent(share or 0.0)} of the error beyond noise that no effect accounts for{stands}"


def checks_line(failed: Sequence[str], answers: Mapping[str, Answer]) -> str:
    """Return which checks failed, or that none did."""
    count = len(answers.get("report", {}).get("checks", []))
    if failed:
        return "; ".join(failed)
    return f"{count} passed" if count else "none stated in [checks]"
