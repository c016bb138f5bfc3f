"""The nomenclature: name, symbol, SI unit and title of every signal.

Pressures are absolute. ``x = 0`` where chamber 1 is smallest; ``u > 0`` fills chamber 1; a ``force`` is positive
toward +x. On a rotary axis the same names denote an angle, torques and a moment of inertia (:data:`ROTARY_UNITS`).
"""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

Z95 = 1.959963984540054  # standard normal quantile of 0.975: half of a 95 % interval, in standard errors


@dataclass(frozen=True)
class Quantity:
    """One signal: its name in files and code, symbol, SI unit, title, and resolution in SI.

    ``resolution`` is finer than any sensor of a rig: a smaller value is shown as 0.
    """

    name: str
    symbol: str
    unit: str
    title: str
    resolution: float


_ALL = (
    Quantity("time", "t", "s", "time", 1e-9),
    Quantity("u", "u", "V", "valve command", 1e-6),
    Quantity("u2", "u2", "V", "command of the second valve", 1e-6),
    Quantity("p_supply", "p_S", "Pa", "supply pressure", 1e-2),
    Quantity("p1", "p1", "Pa", "pressure of chamber 1", 1e-2),
    Quantity("p2", "p2", "Pa", "pressure of chamber 2", 1e-2),
    Quantity("x", "x", "m", "piston position", 1e-9),
    Quantity("v", "v", "m/s", "piston velocity", 1e-9),
    Quantity("a", "a", "m/s^2", "piston acceleration", 1e-6),
    Quantity("force", "F", "N", "driving force", 1e-6),
    Quantity("temperature", "T", "K", "gas temperature", 1e-6),
    Quantity("flow", "q", "kg/s", "flow through the valve", 1e-12),
    Quantity("x_ref", "x_ref", "m", "position reference", 1e-9),
    Quantity("p_ref", "p_ref", "Pa", "pressure reference", 1e-2),
)

SIGNALS: dict[str, Quantity] = {q.name: q for q in _ALL}


def signal_title(signal: str) -> str:
    """Return the title of a signal, or the words of a derived one such as p_ratio."""
    return SIGNALS[signal].title if signal in SIGNALS else signal.replace("_", " ")


# channels of `compare`, in the order of reports
CHANNELS = ("p1", "p2", "x", "v", "a", "force", "temperature", "flow")
COMMANDS = ("u", "u2")  # compared too where the controller is given

# where a residual may concentrate (interface, section 3)
RESIDUAL_VARIABLES = ("time", "u", "p1", "p2", "x", "v", "a", "direction", "p_ratio")

# SI units of a rotary axis by those of a linear one
ROTARY_UNITS = {
    "m": "rad",
    "m/s": "rad/s",
    "m/s^2": "rad/s^2",
    "N": "N m",
    "N/m": "N m/rad",
    "N s/m": "N m s/rad",
    "kg": "kg m^2",
}
PISTON_AREA_UNITS = ("m^2", "m^3/rad")  # of linear and rotary axes

_rotary: ContextVar[bool] = ContextVar("rotary", default=False)


@contextmanager
def axis_motion(*, rotary: bool) -> Iterator[None]:
    """Set whether units that are shown or written are those of a rotary axis, within a ``with`` block."""
    token = _rotary.set(rotary)
    try:
        yield
    finally:
        _rotary.reset(token)


def axis_unit(unit: str) -> str:
    """Return an SI unit as it is on the current axis."""
    return ROTARY_UNITS.get(unit, unit) if _rotary.get() else unit


def in_axis_units(answer: object, name: str = "") -> object:
    """Return an answer of any depth with the units and names of the current axis; ``name`` is its own key."""
    if not _rotary.get():
        return answer
    if isinstance(answer, dict):
        unit = PISTON_AREA_UNITS[1] if name.startswith("rig.piston_area") else axis_unit(str(answer.get("unit")))
        inner = {axis_parameter_name(key): in_axis_units(value, key) for key, value in answer.items()}
        return inner | {"unit": unit} if isinstance(answer.get("unit"), str) else inner
    return [in_axis_units(one) for one in answer] if isinstance(answer, list) else answer


def axis_parameter_name(key: str) -> str:
    """Return the name of a parameter, or of its key in the file, on the current axis."""
    return key.replace("moving_mass", "moment_of_inertia") if _rotary.get() else key
