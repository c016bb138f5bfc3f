"""What was exported."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pneucli.messages import labelled
from pneucli.messages.formatting import format_plain


def _volts(value: float) -> str:
    return f"{format_plain(value, 2)} V" if value >= 0.1 else f"{format_plain(1e3 * value, 2)} mV"


def lines(answer: Mapping[str, Any], file: str, verbose: bool) -> Iterator[str]:
    """Yield the period of the controller, what its precision costs, the plant, and the files."""
    if "controller" in answer:
        yield from labelled(
            "found", f"controller {answer['controller']}, one step every {format_plain(1e3 * answer['period_s'])} ms"
        )
    if off := answer.get("difference_from_float64"):
        text = f"{answer['precision']}: of 99 samples in 100 the command is within {_volts(off['p99_v'])} of float64"
        yield from labelled("found", f"{text}, rms {_volts(off['rms_v'])}; at most {_volts(off['largest_v'])} apart")
    if plant := answer.get("plant"):
        yield from _plant_lines(plant)
    yield from labelled("wrote", ", ".join(answer["files"]))


def _plant_lines(plant: Mapping[str, Any]) -> Iterator[str]:
    effects = f" with {', '.join(plant['effects'])}" if plant["effects"] else ""
    signals = f"inputs {', '.join(plant['inputs'])}; outputs {', '.join(plant['outputs'])}"
    yield from labelled("found", f"plant{effects}: {signals}; {len(plant['parameters'])} parameters")
    if not plant["binaries"]:
        yield from labelled("warning", "no C compiler was found: the FMU holds its sources only; build it with FMPy")
