"""Where a pipeline stands, in a few lines: the error and its fall, the verdict, what to do, checks, the report."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pneucli.figure import read
from pneucli.messages import diagnose, history, labelled
from pneucli.messages.formatting import format_parameters, join_names


def lines(
    answers: Mapping[str, Mapping[str, Any]],
    models: Sequence[history.Model],
    checks: Sequence[str],
    report: str,
    file: str,
) -> Iterator[str]:
    """Yield the lines; ``checks`` are those that failed."""
    if here := history.models_on_current_data(models) if models else []:
        yield from labelled("error", history.error_reduction(here))
        first, last = here[0], here[-1]
        if added := [name for name in last.effects if name not in first.effects]:
            sizes = format_parameters(last.added(added))
            yield from labelled("added", f"{join_names(added)}{f': {sizes}' if sizes else ''}")
    if "diagnose" in answers:
        answer = read(diagnose.Answer, answers["diagnose"])
        yield from labelled("found", answer.sentence)
        if answer.missing or answer.impossible:
            yield from labelled("do", diagnose.next_step(answer, file))
    count = len(answers.get("report", {}).get("checks", []))
    passed = f"{count} passed" if count else "none stated in [checks]"
    yield from labelled("checks", "; ".join(checks) or passed)
    yield from labelled("report", report)
