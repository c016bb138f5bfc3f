"""How far the signals of a recording go."""

from __future__ import annotations

from typing import NamedTuple


class Extent(NamedTuple):
    """How far one recording's signals go, SI: what a rig's scales are worked out from; 0 for what was not recorded."""

    command: float
    pressure: float
    force: float
    speed: float
    low: float
    high: float
    period: float
