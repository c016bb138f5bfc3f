"""The project's own controller: cascade with friction ahead, observers and standstill (:mod:`pneucli.controller.cascade`)."""

from __future__ import annotations

from pneucli.controller import cascade
from pneucli.controller.laws.base import Law, Numbers, Plan


def designed(plan: Plan) -> Numbers:
    """Return nothing: the cascade is taken as it is."""
    return {}


LAW = Law(
    "best", "cascade with friction ahead, observers, standstill", "7.1-7.3, 5.15-5.21", cascade.step, designed,
    estimates=True,
)  # fmt: skip
