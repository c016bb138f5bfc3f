"""What the gate of ``design`` says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pneucli.messages.formatting import quantity, times

Row = Mapping[str, Any]


def verdict(gate: Row) -> str:
    """Return in one line whether all that was asked is kept."""
    asked = ", ".join(f"{d['demand'].replace('_', ' ')} {quantity(d['limit'], d['unit'], 3)}" for d in gate["asked"])
    if not gate["missed"]:
        return f"kept on the model, at the ends of its intervals and on draws ({gate['axes']} axes): {asked}"
    return f"{len(gate['missed'])} of {len(gate['asked'])} demands are missed"


def doubts(gate: Row) -> Iterator[str]:
    """Yield a sentence for each demand that is missed, and one where the model is far from its data."""
    for one in gate["missed"]:
        found = "never" if one["found"] is None else quantity(one["found"], one["unit"], 3)
        text = f"{one['demand'].replace('_', ' ')}: {found} where {quantity(one['limit'], one['unit'], 3)} is asked"
        text += f" ({one['axis']}, {one['scenario']})"
        yield text + (f": {one['cause']}" if one["cause"] else "")
    error = gate["model_error"]
    if error is not None and error > gate["model_error_limit"]:
        yield f"the model is {times(error)} × noise from its data: what is designed for it need not hold on the machine"


def refused(gate: Row | None) -> bool:
    """Whether what is missed fails like a check."""
    return bool(gate and gate["strict"] and not gate["passed"])
