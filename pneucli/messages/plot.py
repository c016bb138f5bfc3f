"""What a picture of a recording shows, and where it is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pneucli.messages import labelled, table
from pneucli.messages.formatting import format_fit, format_noise_ratio, format_quantity

Answer = Mapping[str, Any]


def lines(answer: Answer, file: str, verbose: bool) -> Iterator[str]:
    """Yield the errors of the channels that are shown, and the file or how to get one."""
    parts = [f"{c['channel']} {format_noise_ratio(c['ratio_to_noise'])} × noise" for c in answer["channels"]]
    yield from labelled("shown", f"{answer['recording']} ({answer['use']}): {', '.join(parts)}")
    if answer["file"]:
        yield from labelled("saved", answer["file"])
    if answer["not_shown"]:
        command = f"pneucli plot {file} {answer['recording']} --save {answer['recording']}.png"
        yield from labelled("picture", f"not shown: {answer['not_shown']}. To a file (.png, .svg, .pdf): {command}")
    if verbose:
        head = ("channel", "rms error", "noise", "× noise", "fit")
        yield from table(head, [_row(c) for c in answer["channels"]], texts=1)


def _row(channel: Answer) -> tuple[str, ...]:
    rmsd, noise = (format_quantity(channel[key], channel["unit"], 3) for key in ("rmsd", "noise"))
    return (
        channel["channel"],
        rmsd,
        noise,
        format_noise_ratio(channel["ratio_to_noise"]),
        format_fit(channel["fit_percent"]),
    )
