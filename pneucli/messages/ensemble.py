"""What a design on an ensemble of rigs promises."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pneucli.messages.formatting import format_number, format_percent, format_quantity, join_names

HEAD = ("controller", "rigs held", "at rest", "in motion", "under the load", "chattering")
FIGURES = {
    "rest": "at rest",
    "motion": "rms in motion",
    "load": "under a load",
    "chattering": "rms of chattering",
}


def promise(found: Mapping[str, Any]) -> Iterator[str]:
    """Yield the promise of ``best``, and which untold effect limits it."""
    own, limits = found["laws"]["best"], found["limits"]
    asked = ", ".join(
        f"{format_quantity(limits[name]['value'], limits[name]['unit'], 2)} {where}" for name, where in FIGURES.items()
    )
    probability, sure = format_percent(own["probability"]), format_percent(found["confidence"])
    yield (
        f"holds {asked} on {own['held']} of {own['rigs']} rigs that the search did not see: on a rig like yours with "
        f"a probability of at least {probability} (confidence {sure})"
    )
    if found["effects"]:
        lacks = join_names(found["effects"])
        yield f"these rigs differ as the recordings allow, and have {lacks}, which the model lacks"
    if found["limiting"]:
        failed = own["rigs"] - own["held"]
        yield (
            f"{found['limiting']} limits it: {found['rescued'][found['limiting']]} of the {failed} rigs that fail hold "
            f"without it. To exclude or to identify it: {found['separate']}"
        )


def rows(found: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    """Yield a row a controller: rigs that it holds, and its figures over their limits, median and worst."""
    for name, row in found["laws"].items():
        cells = (f"{_times(row['median'][n])}; {_times(row['worst'][n])}" for n in FIGURES)
        yield name, f"{row['held']} of {row['rigs']}", *cells


def _times(ratio: float | None) -> str:
    return "∞" if ratio is None else f"{format_number(ratio, 2)} ×"
