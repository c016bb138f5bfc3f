"""``[signals]`` of the pipeline file, and how the text of a raw file is written; what is not stated is found out."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, ValidationInfo, model_validator

from pneucli.config.value_types import Column, DecimalMark, Delimiter, Duration, Encoding, Scale, Table, Thousands
from pneucli.errors import UnitError
from pneucli.io.expression import Expression
from pneucli.quantities import ROTARY_UNITS, SIGNALS
from pneucli.recording import Calibration
from pneucli.units import parse_quantity, parse_unit, same_dimension

SignalName = Literal[
    "time", "u", "u2", "p_supply", "p1", "p2", "x", "v", "a", "force", "temperature", "flow", "x_ref", "p_ref"
]

WANTED_SPREADS = {"noise": "a standard deviation", "resolution": "the step of its readings"}
STANDARD_VOLUME_HINT = ', or a volume of air under standard conditions, "l/min ANR" or "Nl/min"'


class TextTable(Table):
    """How a raw file is written."""

    header: bool = True
    delimiter: Delimiter | None = None
    decimal: DecimalMark | None = None
    thousands: Thousands | None = None
    encoding: Encoding | None = None
    skip_rows: Annotated[int, Field(ge=0)] = 0
    part: Annotated[int, Field(ge=1)] | None = None


class WhereTable(Table):
    """Which rows of a long table belong to a signal."""

    column: Column
    equals: str | float


class ClockTable(Table):
    """The column of a signal's own stamps; where no unit is stated it is what the file says, else that of ``time``."""

    column: Column
    unit: str | None = None

    @model_validator(mode="after")
    def _in_time(self) -> ClockTable:
        if self.unit is not None and not same_dimension(self.unit, "s"):
            raise UnitError(f'unit "{self.unit}" does not measure time; wanted one such as "s"')
        return self


class SignalTable(Table):
    """How raw columns become a signal: ``scale * column + offset``, read in ``unit``, with one column or an expression.

    Where no unit is stated, and no scale, it is what the file says of the column, else SI; ``noise`` and ``resolution``
    become SI while they are checked. ``time`` is the column of its own stamps, ``hold`` whether the value holds until
    the next of them, ``missing`` the numbers of the column that mark no value, ``optional`` whether a file may lack the
    column.
    """

    column: Column | None = None
    expression: str | None = None
    unit: str | None = None
    reference: Literal["gauge", "absolute"] | None = None
    scale: Scale = 1.0
    offset: float = 0.0
    thousands: Thousands | None = None
    decimal: DecimalMark | None = None
    where: WhereTable | None = None
    noise: str | float | None = None
    resolution: str | float | None = None
    lag: Duration | None = None
    calibration: str | float | None = None
    time: Column | ClockTable | None = None
    hold: bool | None = None
    missing: list[float] | None = None
    optional: bool = False

    @model_validator(mode="before")
    @classmethod
    def _filled_in(cls, table: object) -> object:
        if isinstance(table, dict):
            for key in ("scale", "offset"):
                if isinstance(table.get(key), str) and "?" in table[key]:
                    raise ValueError(f'{key} = "{table[key]}" is to be filled in; wanted a number, such as 0.01')
            if table.get("column") == "?":
                raise ValueError('column = "?" is to be filled in; wanted a column of the file, by name or number')
        return table

    @property
    def clock(self) -> ClockTable | None:
        """The signal's own clock, where one is stated."""
        return self.time if isinstance(self.time, ClockTable | None) else ClockTable(column=self.time)

    @model_validator(mode="after")
    def _one_origin(self) -> SignalTable:
        if (self.column is None) == (self.expression is None):
            raise ValueError(
                'a signal needs either a column or an expression; wanted column = "..." or expression = "..."'
            )
        if self.expression is not None:
            Expression(self.expression).check()
        return self

    @model_validator(mode="after")
    def _two_marks(self) -> SignalTable:
        if self.decimal is not None and self.decimal == self.thousands:
            raise ValueError(f'"{self.decimal}" cannot be the decimal mark and stand between thousands too')
        return self

    @property
    def gauge(self) -> bool:
        """Whether the column counts from ambient pressure."""
        return self.reference == "gauge" or (self.unit is not None and parse_unit(self.unit).gauge)


def parse_calibration(value: str | float, unit: str) -> Calibration:
    """Return the standard uncertainty of a calibration.

    Args:
        value: ``"0.1 % of 10 bar"`` (of the span: zero and gain contribute alike, and together that much at full
            scale), ``"0.5 % of reading"`` (a gain), or a quantity such as ``"5 mbar"`` (a zero).
        unit: SI unit of the signal.

    Returns:
        Zero in SI and gain.

    Raises:
        UnitError: It is neither of these, or negative.

    >>> found = parse_calibration("0.1 % of 10 bar", "Pa")
    >>> round(found.zero, 1), round(found.gain, 6)
    (707.1, 0.000707)
    """
    share, of, span = str(value).partition("% of")
    if not of:
        return Calibration(zero=_positive(parse_quantity(value, unit, difference=True), value))
    try:
        relative = _positive(float(share) / 100.0, value)
    except ValueError as error:
        raise UnitError(f'calibration = "{value}" is not understood; wanted "0.1 % of 10 bar"') from error
    if span.strip() == "reading":
        return Calibration(gain=relative)
    whole = _positive(parse_quantity(span.strip(), unit, difference=True), value)
    return Calibration(zero=relative * whole / math.sqrt(2.0), gain=relative / math.sqrt(2.0))


def _positive(number: float, value: str | float) -> float:
    if not number > 0.0:
        raise UnitError(f"calibration {value} is not positive; wanted a standard uncertainty")
    return number


def _checked_against(name: str) -> AfterValidator:
    """Check unit and reference of an entry of ``[signals]`` against what the signal is."""
    quantity = SIGNALS[name]

    def check(signal: SignalTable | None, info: ValidationInfo) -> SignalTable | None:
        if signal is None:
            return None
        wanted = ROTARY_UNITS.get(quantity.unit, quantity.unit) if (info.context or {}).get("rotary") else quantity.unit
        volume_flow = name == "flow" and signal.unit is not None and same_dimension(signal.unit, "m^3/s")
        if signal.unit is not None and not volume_flow and not same_dimension(signal.unit, wanted):
            more = STANDARD_VOLUME_HINT if name == "flow" else ""
            raise UnitError(
                f'unit "{signal.unit}" does not measure {quantity.title}; wanted one such as "{wanted}"{more}'
            )
        if signal.reference is not None and quantity.unit != "Pa":
            raise UnitError(f"{name} is not a pressure and takes no reference")
        if signal.reference == "absolute" and signal.gauge:
            raise UnitError(f'the unit "{signal.unit}" is gauge, the reference says absolute; leave one of them out')
        if name == "time" and signal.time is not None:
            raise UnitError("time is a clock itself and has none; leave out its key time")
        if signal.calibration is not None:
            parse_calibration(signal.calibration, wanted)
        if signal.lag is not None and name not in ("p1", "p2"):
            raise UnitError(f"{name} takes no lag; wanted one of p1 and p2, whose sensors it delays")
        read = {
            key: parse_quantity(value, wanted, difference=True)
            for key, value in (("noise", signal.noise), ("resolution", signal.resolution))
            if value is not None
        }
        for key, number in read.items():
            if number < 0:
                raise UnitError(f"{key} {getattr(signal, key)} is negative; wanted {WANTED_SPREADS[key]}")
        return signal.model_copy(update=read) if read else signal

    return AfterValidator(check)


class SignalsTable(Table):
    """``[signals]`` and ``[recordings.signals]``: one entry for each signal that is recorded."""

    time: Annotated[SignalTable | None, _checked_against("time")] = None
    u: Annotated[SignalTable | None, _checked_against("u")] = None
    u2: Annotated[SignalTable | None, _checked_against("u2")] = None
    p_supply: Annotated[SignalTable | None, _checked_against("p_supply")] = None
    p1: Annotated[SignalTable | None, _checked_against("p1")] = None
    p2: Annotated[SignalTable | None, _checked_against("p2")] = None
    x: Annotated[SignalTable | None, _checked_against("x")] = None
    v: Annotated[SignalTable | None, _checked_against("v")] = None
    a: Annotated[SignalTable | None, _checked_against("a")] = None
    force: Annotated[SignalTable | None, _checked_against("force")] = None
    temperature: Annotated[SignalTable | None, _checked_against("temperature")] = None
    flow: Annotated[SignalTable | None, _checked_against("flow")] = None
    x_ref: Annotated[SignalTable | None, _checked_against("x_ref")] = None
    p_ref: Annotated[SignalTable | None, _checked_against("p_ref")] = None

    def present(self) -> dict[str, SignalTable]:
        """Return the signals that the file describes."""
        return {name: getattr(self, name) for name in SIGNALS if getattr(self, name) is not None}
