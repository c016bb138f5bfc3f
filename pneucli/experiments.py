"""The kinds of experiment (interface, section 1): the parts of the rig, the required signals, the compared channels.

A new kind is one entry of ``EXPERIMENT_KINDS``. Code asks the entry for its properties, never for its name.
"""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal

ExperimentName = Literal["valve", "friction", "axis", "closed-loop", "flow"]
Part = Literal[
    "gas",
    "chamber",
    "chamber 2",
    "cylinder",
    "supply",
    "line",
    "line 2",
    "valve",
    "linear valve",
    "switching valve",
    "pressure valve",
    "pump",
    "sensor",
]

PNEUMATIC_PARTS: frozenset[Part] = frozenset(
    {"gas", "line", "valve", "linear valve", "switching valve", "pressure valve", "pump", "supply"}
)


@dataclass(frozen=True)
class ExperimentKind:
    """One kind of experiment.

    Attributes:
        name: Name in the pipeline file.
        valve: Whether gas flows through a valve.
        cylinder: Whether a piston moves.
        needs: Signals that every analysis requires.
        compared_channels: Channels in which model and measurement are compared, where they were recorded.
        bench: The rig in one word.
        controlled: Whether a controller follows ``x_ref``.
        motion_signals: Signals of which one is needed, from which the motion follows.
        steady: Whether each row is a steady state by itself: the rows have no clock.
    """

    name: ExperimentName
    valve: bool
    cylinder: bool
    needs: tuple[str, ...]
    compared_channels: tuple[str, ...]
    bench: str
    controlled: bool = False
    motion_signals: tuple[str, ...] = ()
    steady: bool = False

    @property
    def optional_channels(self) -> tuple[str, ...]:
        """Channels that are compared too, where they were recorded."""
        return ("temperature", "flow") if self.valve else ("temperature",)

    @property
    def used_signals(self) -> frozenset[str]:
        """Signals that drive the model or are compared, apart from optional channels and further commands."""
        driven = ("u", "p_supply") if self.valve else ("p1", "p2", "force")
        return frozenset({*self.needs, *self.compared_channels, *driven})

    def required_signals(self, present: Collection[str], *, valve_shut: bool) -> set[str]:
        """Return the signals that identification requires, given the signals that are present.

        >>> EXPERIMENT_KINDS["friction"].required_signals({"x"}, valve_shut=False)
        {'p1'}
        >>> EXPERIMENT_KINDS["friction"].required_signals({"x", "force"}, valve_shut=False)
        set()
        """
        driven = {"u"} if self.vessel and not valve_shut else set()
        pushed = {"p1"} if not self.valve and "force" not in present else set()
        moved = {self.motion_signals[0]} if self.motion_signals and not {*self.motion_signals} & {*present} else set()
        return set(self.needs) | driven | pushed | moved

    @property
    def min_parameters(self) -> int:
        """Smallest number of parameters of the base model: an area; Coulomb and viscous friction."""
        return self.valve + 2 * self.cylinder

    @property
    def vessel(self) -> bool:
        """Whether a vessel of fixed volume takes the place of chamber 1."""
        return not self.cylinder and not self.steady

    @property
    def simulated(self) -> bool:
        """Whether a command drives the rig over time, so that a scenario may simulate it."""
        return self.valve and not self.steady

    @property
    def axis(self) -> bool:
        """Whether a valve drives a piston."""
        return self.valve and self.cylinder

    def parts(self, *, vessel_is_chamber: bool, supply_recorded: bool, chamber_2: str | None = None) -> frozenset[Part]:
        """Return the parts of the rig whose effects can act (interface, section 5).

        Chamber effects act in a vessel where no recording has a chamber of a cylinder (``vessel_is_chamber``); a
        recorded supply pressure is an input. Chamber 2 takes part where its end or a valve closes it (``chamber_2`` as
        a recording has it), its hose where a valve fills it.
        """
        found: set[Part] = {"sensor"}
        if self.valve:
            found |= PNEUMATIC_PARTS - ({"supply", "pump"} if supply_recorded else set())
        if self.cylinder:
            found.add("cylinder")
        if self.axis or (self.vessel and vessel_is_chamber):
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
            needs=("u", "x"),
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
        ExperimentKind(
            "flow",
            valve=True,
            cylinder=False,
            needs=("p1", "flow"),
            compared_channels=("flow",),
            bench="flow bench",
            steady=True,
        ),
    )
}
