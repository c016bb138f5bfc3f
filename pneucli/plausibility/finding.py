"""What a check of plausibility found, as programs and people read it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pneucli.quantities import SIGNALS
from pneucli.units import parse_unit


@dataclass(frozen=True)
class Finding:
    """``found`` is the evidence with its numbers, ``mend`` the edit of the pipeline file that would mend it."""

    check: str
    signal: str
    recording: str
    found: str
    mend: str


def shown(value: float, signal: str, digits: int = 3) -> str:
    """Return a value (SI) of a signal in the unit that people read it in, such as ``"1.01 bar"``."""
    unit = SIGNALS[signal].display_unit
    return f"{plain(value / parse_unit(unit).factor, digits)} {unit}"


def plain(value: float, digits: int = 3) -> str:
    """Return a number as people write it: to a thousandth at most, and without an exponent up to a million."""
    rounded = float(f"{value:.{digits}g}")
    if abs(rounded) < 1e-3:
        return f"{abs(rounded):.3f}"
    return f"{rounded:.0f}" if 10.0**digits <= abs(rounded) < 1e6 else f"{rounded:.{digits}g}"


def in_words(findings: Sequence[Mapping[str, str]]) -> list[str]:
    """Return one line for each check and signal of ``plausibility``, with the recordings that it was found in.

    The first recording speaks for all of them: its numbers are shown.
    """
    groups: dict[tuple[str, str], list[Mapping[str, str]]] = {}
    for one in findings:
        groups.setdefault((one["check"], one["signal"]), []).append(one)
    return [_line(group) for group in groups.values()]


def _line(group: Sequence[Mapping[str, str]]) -> str:
    first, names = group[0], list(dict.fromkeys(one["recording"] for one in group))
    others = f" and {len(names) - 1} more" if len(names) > 1 else ""
    return f"implausible: {names[0]}{others}, {first['found']}; {first['mend']}"
