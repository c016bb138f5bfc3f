"""Requirements on the controller: the table ``[design]`` of a pipeline file; every key has a default."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

from pneucli.controller.laws import find_law
from pneucli.errors import InputError, require_known
from pneucli.messages.formatting import format_plain
from pneucli.units import read_quantity

PERIOD_RANGE = (1e-5, 1.0)  # s, of a controller


@dataclass(frozen=True)
class Requirements:
    """Requirements in SI; ``None`` is derived from the model by the rules of :mod:`pneucli.design.cascade_design`.

    ``tolerance``: error at rest that is good enough. Bandwidths are corner frequencies in Hz; ``damping`` is that of
    the position loop's oscillating pair. ``sector_ratio``: slope of the sector's steeper line over the flatter one's.
    ``noise_x``, ``quantum_x``, ``noise_p``: what the sensors add (1 sigma) and how they round; ``delay``: from reading
    to valve. ``chamber_2``: ``closed`` (air spring), ``open`` (to ambient) or ``valve`` (driven).

    Criteria of the loop (:mod:`pneucli.closed_loop.acceptance`): ``settling_time`` of a step to 50 um, ``overshoot``,
    ``tracking_error`` (rms, on a sine), ``stiffness``: a load over its largest deviation. ``strict``: a missed
    criterion fails like a check.

    ``pressure_level`` (Pa): mean of both pressures, where two valves drive the chambers; ``air_stiffness``: of the
    enclosed gas, which sets that mean along the stroke (:mod:`pneucli.design.air_spring`).

    ``gains``: by the rules, or those that hold best on an ensemble of rigs (:mod:`pneucli.closed_loop.ensemble`).

    ``controller`` names the law that is simulated and exported. Laws of sliding mode: ``surface`` is the method that
    finds the line of the relay, ``surface_weights`` its LQ weights of squared error (1/m^2) and rate (s^2/m^2),
    ``equivalent_control`` whether the relay has it (5.9), ``relay`` whether its sign is that at the end of the sample
    or that of the reading, ``switching_gain`` M over break-away force and nominal load. ``eta`` (s/m) is the steepness
    of the smoothed sign (6.22) of the sector, ``friction_in_observer`` whether the load observer of ``compensated`` has
    the friction a22(v) (7.5, 7.6).
    """

    period: Annotated[float, "s"] = 1e-3
    tolerance: Annotated[float | None, "m"] = None
    pressure_bandwidth: Annotated[float | None, "Hz"] = None
    position_bandwidth: Annotated[float | None, "Hz"] = None
    damping: Annotated[float, "1"] = 1.0
    sector_ratio: Annotated[float, "1"] = 2.0
    max_speed: Annotated[float | None, "m/s"] = None
    max_acceleration: Annotated[float | None, "m/s^2"] = None
    noise_x: Annotated[float, "m"] = 0.0
    quantum_x: Annotated[float, "m"] = 0.0
    noise_p: Annotated[float, "Pa"] = 0.0
    delay: Annotated[float, "s"] = 0.0
    chamber_2: Literal["closed", "open", "valve"] = "closed"
    controller: str = "best"
    surface: Literal["poles", "lq"] = "poles"
    surface_weights: tuple[float, float] | None = None
    equivalent_control: bool = True
    switching_gain: Annotated[float, "1"] = 1.5
    eta: Annotated[float | None, "s/m"] = None
    relay: Literal["implicit", "switching"] = "implicit"
    friction_in_observer: bool = False
    settling_time: Annotated[float | None, "s"] = None
    overshoot: Annotated[float | None, "m"] = None
    tracking_error: Annotated[float | None, "m"] = None
    stiffness: Annotated[float | None, "N/m"] = None
    strict: bool = False
    pressure_level: Annotated[float | None, "Pa"] = None
    air_stiffness: Annotated[float | None, "N/m"] = None
    gains: Literal["rules", "ensemble"] = "rules"


_HINTS = get_type_hints(Requirements, include_extras=True)
UNITS: dict[str, str] = {name: get_args(hint)[1] for name, hint in _HINTS.items() if get_origin(hint) is Annotated}
CHOICES: dict[str, tuple[Any, ...]] = {
    name: (True, False) if hint is bool else get_args(hint)
    for name, hint in _HINTS.items()
    if hint is bool or get_origin(hint) is Literal
}


def read_requirements(table: Mapping[str, Any], where: str, **known: Any) -> Requirements:
    """Return the requirements of a ``[design]`` table over ``known`` ones (what the recordings tell).

    Args:
        table: Keys and values as written.
        where: File and table, for messages.
        known: Requirements by name (SI) that a key of the table replaces.

    Raises:
        InputError: A key is unknown (E021), or a value cannot be read.
    """
    values: dict[str, Any] = dict(known)
    for key, value in table.items():
        if key in VALUE_READERS:
            values[key] = VALUE_READERS[key](value, f"{where}.{key}")
            continue
        require_known([key], [f.name for f in fields(Requirements)], f"{where}.{key}", "unknown key", code="E021")
        values[key] = _positive(value, key, f"{where}.{key}")
    return Requirements(**values)


def _positive(value: Any, key: str, where: str) -> float:
    number = read_quantity(value, UNITS[key], where)
    if not number > 0.0 and key not in ("noise_x", "quantum_x", "noise_p", "delay"):
        raise InputError(where, format_plain(number), "above 0", code="E023")
    if key == "sector_ratio" and number <= 1.0:
        raise InputError(where, format_plain(number), "above 1: the slope of one line over the other's", code="E023")
    if key == "period" and not PERIOD_RANGE[0] <= round(number, 9) <= PERIOD_RANGE[1]:
        wanted = f"from {format_plain(PERIOD_RANGE[0])} s to {format_plain(PERIOD_RANGE[1])} s"
        raise InputError(where, f"{format_plain(number)} s", wanted, code="E023")
    return number


def _one_of(*choices: Any) -> Callable[[Any, str], Any]:
    """Return a reader of one of the ``choices``: words, or true and false."""

    def read(value: Any, where: str) -> Any:
        if not any(value is choice or (value == choice and isinstance(choice, str)) for choice in choices):
            shown = [f'"{choice}"' if isinstance(choice, str) else str(choice).lower() for choice in choices]
            raise InputError(where, f"{value!r}", " or ".join([", ".join(shown[:-1]), shown[-1]]), code="E023")
        return value

    return read


def _weights(value: Any, where: str) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2 or not all(_is_weight(one) for one in value):
        raise InputError(
            where, f"{value!r}", "two numbers above 0: of the squared error, and of the squared rate", code="E023"
        )
    return float(value[0]), float(value[1])


def _is_weight(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value) and value > 0.0


def _law(value: Any, where: str) -> str:
    return find_law(value, where).name


VALUE_READERS: dict[str, Callable[[Any, str], Any]] = {
    **{name: _one_of(*choices) for name, choices in CHOICES.items()},
    "surface_weights": _weights,
    "controller": _law,
}
