"""What the gate of ``design`` says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pneucli.messages.formatting import format_noise_ratio, format_plain, format_quantity

Row = Mapping[str, Any]

CAUSES = {
    "": "",
    "travel-time": "the valve is too small: {distance} take at least {time}",
    "speed": "the valve is too small: {asked} are asked, it keeps up with {reachable}",
    "stiffness": "the valve is too small and the air spring too soft: both together give at most {reachable}",
    "resolution": "the position sensor is too coarse: {resolvable}",
    "pressure-bounds": "supply and surroundings bound the pressures",
    "one-spool": (
        "one 5/3 valve fills a chamber as it vents the other: the mean pressure follows from leaks and overlap, too "
        "slowly to be set; two valves set it"
    ),
    "open-chamber-2": "chamber 2 is open, so one valve sets the force alone; two valves set both pressures",
    "sealed-chamber-2": (
        "chamber 2 holds what was sealed in, so one valve sets the force alone; two valves set both pressures"
    ),
}
"""Why the plant cannot meet a requirement, by the code of the cause."""
UNITS = {
    "travel-time": {"distance": (1e3, "mm"), "time": (1.0, "s")},
    "speed": {"asked": (1e3, "mm/s"), "reachable": (1e3, "mm/s")},
    "stiffness": {"reachable": (1.0, "N/m")},
    "resolution": {"resolvable": (1e6, "um")},
}
"""Factor on the SI value and shown unit of each quantity of a cause."""


def cause_text(code: str, quantities: Mapping[str, float]) -> str:
    """Return why the plant cannot meet a requirement; "" where the cause is unknown.

    >>> cause_text("speed", {"asked": 2.0, "reachable": 1.25})
    'the valve is too small: 2000 mm/s are asked, it keeps up with 1250 mm/s'
    """
    units = UNITS.get(code, {})
    return CAUSES[code].format(
        **{n: f"{format_plain(v * units[n][0], 3)} {units[n][1]}" for n, v in quantities.items()}
    )


def acceptance_verdict(acceptance: Row) -> str:
    """Return in one line whether every requirement is met."""
    asked = ", ".join(
        f"{d['demand'].replace('_', ' ')} {format_quantity(d['limit'], d['unit'], 3)}" for d in acceptance["asked"]
    )
    if not acceptance["missed"]:
        return f"met on the model, at the ends of its intervals and on draws ({acceptance['axes']} axes): {asked}"
    return f"{len(acceptance['missed'])} of {len(acceptance['asked'])} requirements are not met"


def violations(acceptance: Row) -> Iterator[str]:
    """Yield a sentence for each requirement that is not met, and one where the model is far from its data."""
    for one in acceptance["missed"]:
        found = "never" if one["found"] is None else format_quantity(one["found"], one["unit"], 3)
        text = (
            f"{one['demand'].replace('_', ' ')}: {found} where {format_quantity(one['limit'], one['unit'], 3)} is asked"
        )
        text += f" ({one['axis']}, {one['scenario']})"
        yield text + (f": {one['cause']}" if one["cause"] else "")
    error = acceptance["model_error"]
    if error is not None and error > acceptance["model_error_limit"]:
        yield (
            f"the model is {format_noise_ratio(error)} × noise from its data: what is designed for it need not hold on "
            "the machine"
        )


def fails_acceptance(acceptance: Row | None) -> bool:
    """Whether an unmet requirement fails like a check."""
    return bool(acceptance and acceptance["strict"] and not acceptance["passed"])
