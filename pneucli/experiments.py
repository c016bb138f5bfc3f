"""The kinds of experiment (interface, section 1): what stands on the bench, what is needed of it, what is compared.

A new kind is one entry of ``EXPERIMENT_KINDS``; what follows from it is asked of the entry, not of its name.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal

ExperimentName = Literal["valve", "friction", "axis", "closed-loop"]
Part = Literal["gas", "chamber", "chamber 2", "cylinder", "supply", "line", "line 2", "valve", "linear valve", "sensor"]

PNEUMATIC_PARTS: frozenset[Part] = frozenset({"gas", "line", "valve", "linear valve", "supply"})


@dataclass(frozen=True)
class ExperimentKind:
    """One kind of experiment.

    ``valve``: gas flows through one. ``cylinder``: a piston moves. ``needs`` are the signals that nothing can do
    without, ``compared_channels`` the channels that a model of it is held against, where they are recorded. ``controlled``: a
    controller follows ``x_ref``. ``motion_signals``: one of them is needed, and motion follows from it.
    """

    name: ExperimentName
    valve: bool
    cylinder: bool
    needs: tuple[str, ...]
    compared_channels: tuple[str, ...]
    bench: str
    controlled: bool = False
    motion_signals: tuple[str, ...] = ()

    @property
    def optional_channels(self) -> tuple[str, ...]:
        """The channels that are compared too, where they were recorded."""
        return ("temperature", "flow") if self.valve else ("temperature",)

    def required_signals(self, present: Collection[str], *, valve_shut: bool) -> set[str]:
        """Return the signals without which nothing can be identified, beside those that are ``present``."""
        driven = {"u"} if self.vessel and not valve_shut else set()
        pushed = {"p1"} if not self.valve and "force" not in present else set()
        moved = {self.motion_signals[0]} if self.motion_signals and not {*self.motion_signals} & {*present} else set()
        return set(self.needs) | driven | pushed | moved

    @property
    def min_parameters(self) -> int:
        """How many parameters the base model has at least: an area; Coulomb and viscous friction."""
        return self.valve + 2 * self.cylinder

    @property
    def vessel(self) -> bool:
        """Whether a vessel of fixed volume stands in for chamber 1."""
        return not self.cylinder

    @property
    def axis(self) -> bool:
        """Whether a valve drives a piston."""
        return self.valve and self.cylinder

    def parts(self, *, cylinder_known: bool, supply_recorded: bool, chamber_2: str | None = None) -> frozenset[Part]:
        """Return the parts that stand on the bench and can show (interface, section 5).

        A vessel is the chamber of a rig without a cylinder; a supply that is recorded is an input. ``chamber_2`` as
        a recording has it: it shows where it is shut, its hose where a valve fills it.
        """
        found: set[Part] = {"sensor"}
        if self.valve:
            found |= PNEUMATIC_PARTS - ({"supply"} if supply_recorded else set())
        if self.cylinder:
            found.add("cylinder")
        if self.axis or (self.vessel and not cylinder_known):
            found.add("chamber")
        if self.axis and chamber_2 in ("closed", "valve"):
            found.add("chamber 2")
        if self.axis and chamber_2 == "valve":
            found.add("line 2")
        return frozenset(found)


EXPERIMENT_KINDS: dict[str, ExperimentKind] = {
    kind.name: kind
    for kind in (
        ExperimentKind("valve", valve=True, cylinder=False, needs=("p1",), compared_channels=("p1",), bench="vessel"),
        ExperimentKind(
            "friction",
            valve=False,
            cylinder=True,
            needs=(),
            compared_channels=("x", "v", "a"),
            bench="cylinder",
            motion_signals=("x", "v", "a"),
        ),
        ExperimentKind(
            "axis",
            valve=True,
            cylinder=True,
            needs=("u", "p1", "x"),
            compared_channels=("p1", "p2", "x", "v", "a"),
            bench="cylinder",
        ),
        ExperimentKind(
            "closed-loop",
            valve=True,
            cylinder=True,
            needs=("u", "p1", "x", "x_ref"),
            compared_channels=("p1", "p2", "x", "v", "a"),
            bench="cylinder",
            controlled=True,
        ),
    )
}
