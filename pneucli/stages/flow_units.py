"""Flows that a pipeline states as volumes: the reference state of each."""

from __future__ import annotations

from collections.abc import Iterator

from pneucli.config import PipelineConfig
from pneucli.messages.identify import Assumption
from pneucli.units import parse_unit, same_dimension

STANDARD_STATE = "ANR"


def is_plain_volume_flow(unit: str | None) -> bool:
    """Return whether a unit measures a volume per time and says no state of the gas.

    >>> is_plain_volume_flow("m3/h"), is_plain_volume_flow("Nm3/h"), is_plain_volume_flow("kg/s")
    (True, False, False)
    """
    return unit is not None and same_dimension(unit, "m^3/s")


def flow_unit(unit: str) -> str:
    """Return a unit of flow with the reference atmosphere of ISO 8778 where it names no state.

    >>> flow_unit("l/min"), flow_unit("Nl/min")
    ('l/min ANR', 'Nl/min')
    """
    return f"{unit} {STANDARD_STATE}" if is_plain_volume_flow(unit) else unit


def flow_unit_assumptions(config: PipelineConfig) -> Iterator[Assumption]:
    """Yield the reference state in which each volume flow of the pipeline is taken, where its unit leaves a doubt."""
    tables = [config.signals, *(one.signals for one in config.recordings)]
    units = (table.flow.unit for table in tables if table is not None and table.flow is not None)
    for unit in dict.fromkeys(one for one in units if one is not None):
        state = parse_unit(flow_unit(unit)).state
        if state is None or unit.rstrip(")").endswith(STANDARD_STATE):
            continue
        others = "0 °C and 1.01325 bar" if is_plain_volume_flow(unit) else state.others
        what = f"flow in {unit} is a volume of air at {state.words}" + (f", not {others}" if others else "")
        yield Assumption(what, 'unit = "l/min ANR" (20 °C, 1 bar) or "Nl/min" (0 °C, 1.01325 bar), in [signals] flow')
