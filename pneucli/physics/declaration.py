"""What a physical effect declares: its name, parameters, equations at the simulator's ports, and its story.

One declaration is the only place where an effect is described. From it come the simulator's code, the fit's
parameter vector, the diagnosis, the catalogue, the docs page and the tests. A port's function takes the port's
arguments (``PORTS``) and then the effect's parameters, in the order in which they are declared; it uses scalars,
``math`` and the functions of :mod:`pneucli.physics.gas` only, since the kernel compiles its source.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from pneucli.experiments import Part

Combine = Literal["sum", "chain", "factor", "state"]
Side = Literal["gas", "mechanics", "friction", "pressure sensor"]


@dataclass(frozen=True)
class Port:
    """A place in the equations where effects enter.

    ``sum``: contributions are added. ``factor``: they multiply 1. ``chain``: each maps the first argument.
    ``state``: as chain, with a state of the effect's own as second argument; returns (value, new state).
    ``side``: the balance in which it stands: of mass and energy (``gas``), of forces (``mechanics``; ``friction`` where
    it is friction's own), or both, as a reading of the pressures (``pressure sensor``). ``bounds``: it widens the set
    of forces that are possible.
    """

    arguments: tuple[str, ...]
    combine: Combine
    side: Side
    meaning: str
    bounds: bool = False


PORTS: dict[str, Port] = {
    "command": Port(
        ("u", "s", "h"), "state", "gas", "V: what the opening follows, from the command; h is the step in s"
    ),
    "critical_ratio": Port(("b",), "chain", "gas", "1: critical ratio of the valve's flow function"),
    "leak_area": Port((), "sum", "gas", "m^2: open from supply to outlet and from outlet to exhaust at every command"),
    "leak_1_ambient": Port(("p1", "p_amb", "k"), "sum", "gas", "kg/s out of chamber 1"),
    "leak_2_ambient": Port(("p2", "p_amb", "k"), "sum", "gas", "kg/s out of chamber 2"),
    "leak_1_2": Port(("p1", "p2", "k"), "sum", "gas", "kg/s from chamber 1 to chamber 2"),
    "volume_1": Port((), "sum", "gas", "m^3 added to chamber 1"),
    "volume_2": Port((), "sum", "gas", "m^3 added to chamber 2"),
    "heat": Port(("T", "T_wall"), "sum", "gas", "W into a chamber's gas; its presence makes gas temperature a state"),
    "supply": Port(
        ("p", "s", "p_set", "q", "k_gas", "h"),
        "state",
        "gas",
        "Pa: supply pressure at the valve, q kg/s leaving, k_gas = kappa R T; a state of 0 means not yet set",
    ),
    "flow_delay": Port((), "sum", "gas", "s by which the valve's flow arrives later in the chamber"),
    "dry_rise": Port(
        ("coulomb", "v"), "sum", "friction", "N of dry friction above Coulomb's at v while speeding up or at rest"
    ),
    "slowing": Port(
        (),
        "factor",
        "friction",
        "1: dry friction while slowing, over Coulomb's; its presence makes two branches",
        bounds=True,
    ),
    "dry_factor": Port(("direction", "x", "p1", "p2", "p_amb"), "factor", "friction", "1: factor on all dry friction"),
    "static_factor": Port(("rest_time",), "factor", "friction", "1: factor on the friction that holds at rest"),
    "viscous_factor": Port(("direction",), "factor", "friction", "1: factor on viscous friction"),
    "force": Port(("x", "v", "stroke"), "sum", "mechanics", "N on the piston toward +x"),
    "mass": Port((), "sum", "mechanics", "kg moved beside the rig's"),
    "bristle_stiffness": Port((), "sum", "friction", "N/m of the LuGre model's bristles; 0: rigid"),
    "bristle_damping": Port((), "sum", "friction", "N s/m of the LuGre model's bristles"),
    "read_p1": Port(("p", "p_amb"), "chain", "pressure sensor", "Pa: the static reading of the sensor of p1"),
    "read_p2": Port(("p", "p_amb"), "chain", "pressure sensor", "Pa: the static reading of the sensor of p2"),
    "unread_p1": Port(("p", "p_amb"), "chain", "pressure sensor", "Pa: inverse of read_p1"),
    "unread_p2": Port(("p", "p_amb"), "chain", "pressure sensor", "Pa: inverse of read_p2"),
    "read_a": Port(("a",), "chain", "mechanics", "m/s^2: the reading of the accelerometer"),
    "sensor_lag": Port((), "sum", "pressure sensor", "s: time constant of the sensors of p1 and p2"),
    "sensor_delay": Port(
        (), "sum", "pressure sensor", "s by which p1 and p2 are recorded later than the other channels"
    ),
}


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect: unit, bounds, the value at which the effect vanishes, and plausible values.

    ``null`` is a number (``inf``: the effect vanishes as the parameter grows), the name of a base parameter whose
    value it then has, or ``None`` where the parameter alone cannot make the effect vanish. ``typical`` holds values
    from which a fit starts: what a rig plausibly shows.
    """

    name: str
    unit: str
    null: float | str | None
    lower: float
    upper: float
    typical: tuple[float, ...]
    title: str = ""
    of: str = ""  # typical values are multiples of this base parameter, or shares of the range of the signal "x"
    step: float = 0.0  # by which a fit must move it to see a difference, where the effect is not smooth in it


@dataclass(frozen=True, eq=False)
class Effect:
    """One physical effect. ``ports`` maps names of :data:`PORTS` to functions; ``order`` sorts chained ports.

    ``equation`` is plain text with LaTeX between dollars; ``looks_like`` says what the effect does to a residual and
    over which signal it shows best; ``twins`` names effects that ordinary recordings cannot tell from it, ``separate``
    the experiment that can.
    """

    name: str
    title: str
    part: Part
    parameters: tuple[Parameter, ...]
    ports: dict[str, Callable[..., object]]
    equation: str
    looks_like: str
    shows_over: str
    twins: tuple[str, ...]
    separate: str
    source: str
    order: int = 0
    nested: bool = True

    @property
    def sides(self) -> frozenset[Side]:
        """The balances in which it stands."""
        return frozenset(PORTS[port].side for port in self.ports)

    @property
    def bounds(self) -> bool:
        """Whether it states a set of possible forces, where a law states one."""
        return any(PORTS[port].bounds for port in self.ports)
