"""What was read, and what had to be repaired."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pneucli.messages import labelled, plausibility, table, warnings


def lines(answer: Mapping[str, Any], file: str, verbose: bool) -> Iterator[str]:
    """Yield the number of recordings, each of them, and all repairs."""
    recordings = answer["recordings"]
    uses = [sum(one["use"] == use for one in recordings) for use in ("train", "test")]
    yield from labelled("read", f"{len(recordings)} recordings, {uses[0]} to fit and {uses[1]} to test")
    rows = [
        (one["name"], one["experiment"], one["use"], f"{one['samples']}", " ".join(one["signals"]))
        for one in recordings
    ]
    yield from table(("recording", "experiment", "use", "samples", "signals"), rows, texts=5)
    if "looks" in answer:
        yield ""
        yield from plausibility.signal_summary_table(
            answer["looks"], {one["name"]: one["experiment"] for one in recordings}
        )
        yield ""
    for text in answer.get("left_out", []):
        yield from labelled("left out", text)
    repairs = [f"{repair_location(one)}: {one['message']}" for one in answer["repairs"]]
    for text in repairs:
        if text not in answer["warnings"]:  # which say the weightier ones
            yield from labelled("repair", text)
    yield from warnings(answer)
    yield from labelled("do", f"pneucli compare {file}")


def repair_location(repair: Mapping[str, Any]) -> str:
    """Return where something was repaired: the recording, and the signal where it is one."""
    return ", ".join(filter(None, (repair["recording"], repair["signal"])))
