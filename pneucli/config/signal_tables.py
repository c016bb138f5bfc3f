"""How the text of a raw file is written, as a recording states it; what it does not state is found out."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from pneucli.config.value_types import DecimalMark, Delimiter, Encoding, Table, Thousands


class TextTable(Table):
    """How a raw file is written."""

    header: bool = True
    delimiter: Delimiter | None = None
    decimal: DecimalMark | None = None
    thousands: Thousands | None = None
    encoding: Encoding | None = None
    skip_rows: Annotated[int, Field(ge=0)] = 0
