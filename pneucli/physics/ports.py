"""The ports: the places in the equations where effects enter."""

from dataclasses import dataclass
from typing import Literal

Combine = Literal["sum", "chain", "factor", "state"]
Balance = Literal["gas", "mechanics", "friction", "pressure sensor"]


@dataclass(frozen=True)
class Port:
    """A place in the equations where effects enter.

    Attributes:
        arguments: Arguments that every function of the port takes before the effect's parameters.
        combine: How effects combine. ``sum``: contributions add. ``factor``: they multiply 1. ``chain``: each maps
            the first argument. ``state``: as chain, with a state of the effect as second argument; the function
            returns the value and the new state.
        balance: The balance to which the port belongs: mass and energy (``gas``), forces (``mechanics``; ``friction``
            for friction alone), or both, through the readings of the pressures (``pressure sensor``).
        meaning: Unit and meaning of the value.
        is_set_valued: Whether the port widens the set of possible forces.
        memory: Whether its value depends on the past without a ``state``.
        distinct_with: Ports of other effects with which an effect that enters here changes the model at any value,
            its null included.
        before: Port of the same effect, without which it acts nowhere, just before which it acts.
    """

    arguments: tuple[str, ...]
    combine: Combine
    balance: Balance
    meaning: str
    is_set_valued: bool = False
    memory: bool = False
    distinct_with: tuple[str, ...] = ()
    before: str | None = None

    @property
    def has_memory(self) -> bool:
        """Whether its value depends on more than the present pressures, motion and command."""
        return self.memory or self.combine == "state"


PORTS: dict[str, Port] = {
    "demand": Port(
        ("u", "p", "p_amb"),
        "chain",
        "gas",
        "V: the command of the opening that a loop of the valve makes of u and its p",
    ),
    "drive": Port(
        ("u", "s", "opening", "h"),
        "state",
        "gas",
        "V: the command that the effect's own opening follows at its port command",
        before="command",
    ),
    "command": Port(("u", "s", "h"), "state", "gas", "V: the command that the opening follows; h is the step in s"),
    "switched": Port(
        ("position", "s", "h"),
        "state",
        "gas",
        "1: position of a switching valve, filling 1, venting -1",
    ),
    "critical_ratio": Port(("b",), "chain", "gas", "1: critical ratio of the valve's flow function"),
    "filling": Port(
        ("q", "full", "p", "p_amb"),
        "chain",
        "gas",
        "kg/s from the source into a chamber at p; full: the same through the open area at any low pressure",
    ),
    "leak_area": Port((), "sum", "gas", "m^2: open from supply to outlet and from outlet to exhaust at every command"),
    "leak_1_ambient": Port(("p1", "p_amb", "k"), "sum", "gas", "kg/s out of chamber 1"),
    "leak_2_ambient": Port(("p2", "p_amb", "k"), "sum", "gas", "kg/s out of chamber 2"),
    "leak_1_2": Port(("p1", "p2", "k"), "sum", "gas", "kg/s from chamber 1 to chamber 2"),
    "volume_1": Port((), "sum", "gas", "m^3 added to chamber 1"),
    "volume_2": Port((), "sum", "gas", "m^3 added to chamber 2"),
    "heat": Port(
        ("T", "T_wall"),
        "sum",
        "gas",
        "W into a chamber's gas; its presence makes gas temperature a state",
        memory=True,
    ),
    "temperature_lag": Port((), "sum", "gas", "s: time constant of the sensor of the gas temperature", memory=True),
    "supply": Port(
        ("p", "s", "p_set", "q", "k_gas", "h"),
        "state",
        "gas",
        "Pa: supply pressure at the valve, q kg/s leaving, k_gas = kappa R T; a state of 0 means not yet set",
    ),
    "flow_delay": Port((), "sum", "gas", "s by which the valve's flow arrives later in the chamber", memory=True),
    "flow_delay_1": Port((), "sum", "gas", "s by which it arrives later still in chamber 1", memory=True),
    "flow_delay_2": Port((), "sum", "gas", "s by which it arrives later still in chamber 2", memory=True),
    "hose_bore": Port((), "sum", "gas", "m: inner diameter of both hoses; 0: they only delay the flow", memory=True),
    "hose_bore_1": Port((), "sum", "gas", "m added to the inner diameter of the hose of chamber 1", memory=True),
    "hose_bore_2": Port((), "sum", "gas", "m added to the inner diameter of the hose of chamber 2", memory=True),
    "dry_rise": Port(
        ("coulomb", "v"), "sum", "friction", "N of dry friction above Coulomb's at v while speeding up or at rest"
    ),
    "slowing": Port(
        (),
        "factor",
        "friction",
        "1: dry friction while slowing, over Coulomb's; its presence makes two branches",
        is_set_valued=True,
        distinct_with=("dry_rise",),
    ),
    "slowing_viscous": Port(
        (),
        "factor",
        "friction",
        "1: viscous friction while slowing, over that while speeding up; acts where an effect enters at slowing",
        is_set_valued=True,
    ),
    "dry_factor": Port(("direction", "x", "p1", "p2", "p_amb"), "factor", "friction", "1: factor on all dry friction"),
    "static_factor": Port(("rest_time",), "factor", "friction", "1: factor on the friction that holds at rest"),
    "viscous_factor": Port(("direction",), "factor", "friction", "1: factor on viscous friction"),
    "force": Port(("x", "v", "stroke"), "sum", "mechanics", "N on the piston toward +x"),
    "mass": Port((), "sum", "mechanics", "kg moved in addition to the rig's"),
    "bristle_stiffness": Port((), "sum", "friction", "N/m of the LuGre model's bristles; 0: rigid"),
    "bristle_damping": Port((), "sum", "friction", "N s/m of the LuGre model's bristles"),
    "read_p1": Port(("p", "p_amb"), "chain", "pressure sensor", "Pa: the static reading of the sensor of p1"),
    "read_p2": Port(("p", "p_amb"), "chain", "pressure sensor", "Pa: the static reading of the sensor of p2"),
    "unread_p1": Port(("p", "p_amb"), "chain", "pressure sensor", "Pa: inverse of read_p1"),
    "unread_p2": Port(("p", "p_amb"), "chain", "pressure sensor", "Pa: inverse of read_p2"),
    "read_a": Port(("a",), "chain", "mechanics", "m/s^2: the reading of the accelerometer"),
    "sensor_lag": Port((), "sum", "pressure sensor", "s: time constant of the sensors of p1 and p2", memory=True),
    "sensor_delay": Port(
        (), "sum", "pressure sensor", "s by which p1 and p2 are recorded later than the other channels", memory=True
    ),
    "force_delay": Port((), "sum", "mechanics", "s by which a force is recorded later than the motion", memory=True),
}

LEAK_PORTS = ("leak_1_ambient", "leak_2_ambient", "leak_1_2")  # out of chamber 1, out of chamber 2, across the piston
