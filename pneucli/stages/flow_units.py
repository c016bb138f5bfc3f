"""Flows that a pipeline states in a unit of volume without its standard state."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from pneucli.config import PipelineConfig, SignalTable
from pneucli.plausibility.required_inputs import Assumption
from pneucli.units import same_dimension

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
    """Yield what is assumed of each flow that the pipeline states as a volume without a state."""
    tables = [config.signals, *(one.signals for one in config.recordings)]
    for unit in dict.fromkeys(_plain_units(table.flow for table in tables)):
        what = f"flow in {unit} is a volume of air in the reference atmosphere (ANR: 20 °C, 1 bar), as in ISO 6358"
        yield Assumption(what, f'unit = "{flow_unit(unit)}", or "N{unit}" (0 °C, 1.013 bar), in [signals] flow')


def _plain_units(signals: Iterable[SignalTable | None]) -> Iterator[str]:
    for signal in signals:
        if signal is not None and signal.unit is not None and is_plain_volume_flow(signal.unit):
            yield signal.unit
