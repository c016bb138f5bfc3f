"""Raw files as they would be taken: each signal with its column, unit, range, rests and a curve, then doubts."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pneucli.messages import each, labelled, table
from pneucli.messages import init as init_messages
from pneucli.messages.formatting import format_percent, format_plain, format_quantity

Answer = Mapping[str, Any]
CURVE = 40  # characters
_LEVELS = "▁▂▃▄▅▆▇█"
MAX_RESTS = 3  # levels that are said


def lines(answer: Answer, file: str, verbose: bool) -> Iterator[str]:
    """Yield columns as ``init`` shows them, the curves of each recording, what is left out, and doubts."""
    yield from init_messages.column_lines(answer["kinds"], answer["columns"])
    for one in answer["recordings"]:
        rate = "" if one["rate"] is None else f", {format_plain(one['rate'], 4)} Hz"
        head = (
            f"{one['name']}: {one['experiment']}, {one['samples']} samples{rate}, {format_plain(one['seconds'], 4)} s"
        )
        yield from labelled("reads", head)
        rows = [_row(signal) for signal in one["signals"]]
        yield from table(("signal", "curve", "rests at", "least", "median", "most", "noise"), rows, texts=3)
        yield ""
    for label, key in (("left out", "left_out"), ("cannot", "cannot"), ("doubt", "doubts")):
        for text in answer[key]:
            yield from labelled(label, text)
    if verbose:
        yield from each("repair", answer["repairs"])
    yield from labelled("do", f"pneucli init DIR --from {file}, which writes this into a pipeline file")


def _row(signal: Answer) -> tuple[str, ...]:
    shown = [format_quantity(signal[key], signal["unit"]) for key in ("least", "median", "most")]
    noise = "" if not signal["noise"] else format_quantity(signal["noise"], signal["unit"], 2)
    if signal["noise"] and signal["noise_ci95"]:
        noise += f" ({' to '.join(format_quantity(value, signal['unit'], 2) for value in signal['noise_ci95'])})"
    return signal["signal"], curve(signal["time"], signal["values"]), rest_text(signal), *shown, noise


def rest_text(signal: Answer) -> str:
    """Return the levels at which a signal rests, in words."""
    return ", ".join(
        f"{format_quantity(one['level'], signal['unit'], 3)} ({format_percent(one['share'])})"
        for one in signal["rests"][:MAX_RESTS]
    )


def curve(time: Sequence[float], values: Sequence[float | None]) -> str:
    """Return a curve in one line of characters, each the middle of what was read meanwhile; a blank where nothing was.

    >>> curve([0.0, 1.0, 2.0, 3.0, 4.0, 5.0], [0.0, 1.0, 2.0, None, 7.0, 7.0])
    '▁▂▃ ██'
    """
    known = [(at, value) for at, value in zip(time, values, strict=True) if value is not None and math.isfinite(value)]
    if not known:
        return ""
    count, begin, length = min(CURVE, len(values)), time[0], (time[-1] - time[0]) or 1.0
    cells: list[list[float]] = [[] for _ in range(count)]
    for at, value in known:
        cells[min(int(count * (at - begin) / length), count - 1)].append(value)
    middle = [0.5 * (min(cell) + max(cell)) if cell else None for cell in cells]
    low, span = min(value for _, value in known), max(value for _, value in known) - min(value for _, value in known)
    marks = (" " if one is None else _LEVELS[round((one - low) / (span or 1.0) * (len(_LEVELS) - 1))] for one in middle)
    return "".join(marks)
