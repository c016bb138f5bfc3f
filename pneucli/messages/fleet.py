"""What a fleet's run found: how many rigs, who changed, what failed, and where the page is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pneucli.figure import read
from pneucli.messages import labelled, table
from pneucli.messages.diagnose import Change
from pneucli.messages.formatting import format_number, join_names

Answer = Mapping[str, Any]
MAX_LISTED_RIGS = 10  # rigs that are listed without -v


def lines(answer: Answer, file: str, verbose: bool) -> Iterator[str]:
    """Yield counts, the rigs that changed, the failures, what to do; behind ``-v`` all that changed."""
    yield from labelled("found", fleet_summary(answer))
    yield from labelled("repeats", repeatability_sentence(answer))
    listed = answer["changes"] if verbose else answer["changes"][:MAX_LISTED_RIGS]
    for one in listed:
        what = "; ".join(read(Change, each).text for each in one["changes"])
        yield from labelled("changed", f"{one['rig']} at {one['date']}, since {one['since']}: {what}")
    if rest := len(answer["changes"]) - len(listed):
        yield from labelled("", f"and {rest} more (-v lists them)")
    for one in answer["failures"]:
        yield from labelled("failed", f"{one['rows']} rows: {one['cause']}")
    yield from labelled("done", f"{answer['done']} rows in {answer['seconds']:.0f} s, {answer['unchanged']} unchanged")
    yield from labelled("page", f"{answer['out']}/report.html")
    if verbose:
        yield ""
        yield from table(("verdict", "rows"), [(name, str(n)) for name, n in answer["verdicts"].items()], texts=1)


def fleet_summary(answer: Answer) -> str:
    """Return the counts in one sentence."""
    text = f"{answer['changed']} of {answer['rigs']} rigs changed, {answer['failed']} of {answer['rows']} rows failed"
    missing = [f"{name} ({n})" for name, n in list(answer["missing"].items())[:5]]
    return f"{text}; missing from the model: {join_names(missing)}" if missing else text


def progress_text(done: int, rows: int, failed: int) -> str:
    """Return how many rows are done, and how many of these failed."""
    return f"{done} of {rows} rows, {failed} failed"


def repeatability_sentence(answer: Answer) -> str:
    """Return how well the rigs repeat from one healthy date to another, or that nobody knows."""
    repeatability = answer["repeatability"]
    if repeatability is None:
        return "the variation of a healthy rig from date to date is unknown: state [fleet] healthy"
    sizes = [
        f"{name} {format_number(100 * size, 2)} %" for name, size in repeatability["parameters"].items() if size > 0.0
    ]
    within = (
        f"from date to date a healthy rig differs by {join_names(sizes)}" if sizes else "healthy dates differ by noise"
    )
    return f"{within} ({repeatability['rigs']} rigs, {repeatability['dates']} dates each)"
