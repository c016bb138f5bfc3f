"""What the gate of ``design`` says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pneucli.messages.formatting import format_noise_ratio, format_quantity

Row = Mapping[str, Any]


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
