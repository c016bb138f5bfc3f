"""The project's own controller: cascade with friction ahead, observers and standstill (:mod:`pneucli.controller.cascade`)."""

from __future__ import annotations

from pneucli.controller import cascade
from pneucli.controller.laws.base import ControlLaw, DesignData, LawParameters


def cascade_parameters(data: DesignData) -> LawParameters:
    """Return nothing: the cascade is taken as it is."""
    return {}


LAW = ControlLaw(
    "best", "cascade with friction ahead, observers, standstill", "7.1-7.3, 5.15-5.21", cascade.cascade_step, cascade_parameters,
    estimates_load=True,
)  # fmt: skip
