"""The fleet file: a template pipeline, a table of rigs, and what is asked of them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, PrivateAttr

from pneucli.config.load import validate_as
from pneucli.config.stage_tables import CheckTable
from pneucli.config.value_types import Name, Table
from pneucli.document import read_toml


class FleetTable(Table):
    """``[fleet]``: ``alarm_rate`` is the share of false alarms for each rig and comparison, ``reports`` which rigs get
    a report of their own, ``healthy`` how many of each rig's first dates are stated to be healthy.
    """

    name: Name
    template: Name
    table: Name
    alarm_rate: Annotated[float, Field(gt=0.0, le=0.5)] = 1e-3
    reports: Literal["changed", "all", "none"] = "changed"
    healthy: Annotated[int, Field(ge=1)] = 1


class FleetConfig(Table):
    """The whole fleet file; ``path`` is where it stands."""

    fleet: FleetTable
    checks: dict[str, CheckTable] = Field(default_factory=dict)

    _path: Path = PrivateAttr(default=Path("fleet.toml"))

    @property
    def path(self) -> Path:
        """The file that was read; relative paths in it start in its folder."""
        return self._path


def load_fleet(path: Path) -> FleetConfig:
    """Return the checked fleet file; raises InputError that names line and key of every fault."""
    text, document = read_toml(path)
    config = validate_as(FleetConfig, path, document, text)
    config._path = path.absolute()
    return config
