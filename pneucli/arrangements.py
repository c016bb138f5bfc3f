"""Arrangements of valves at the chambers of a cylinder (interface, ``[rig.valve]``).

A new arrangement is one entry of ``ARRANGEMENTS``: it states which command opens the paths of chamber 2. The fill and
vent paths of one chamber have a map of their own. Openings count from the null command, positive toward filling.
"""

from dataclasses import dataclass
from typing import Literal

ArrangementName = Literal["one-chamber", "5/3", "two"]
Chamber2Supply = Literal["none", "mirrored", "own"]


@dataclass(frozen=True)
class Arrangement:
    """One arrangement; chamber 2 has no valve, the other way of the first valve's spool, or a valve with command u2."""

    name: ArrangementName
    chamber_2: Chamber2Supply

    @property
    def commands(self) -> tuple[str, ...]:
        """The signals that command its valves."""
        return ("u", "u2") if self.chamber_2 == "own" else ("u",)

    @property
    def drives_both(self) -> bool:
        """Whether gas flows into both chambers."""
        return self.chamber_2 != "none"


ARRANGEMENTS: dict[str, Arrangement] = {
    one.name: one
    for one in (Arrangement("one-chamber", "none"), Arrangement("5/3", "mirrored"), Arrangement("two", "own"))
}
