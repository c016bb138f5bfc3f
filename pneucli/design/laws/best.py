"""The project's own controller: cascade with friction ahead, observers and standstill (:mod:`pneucli.design.step`)."""

from __future__ import annotations

from pneucli.design import step
from pneucli.design.laws.law import Law, Numbers, Plan


def designed(plan: Plan) -> Numbers:
    """Return nothing: the cascade is taken as it is."""
    return {}


LAW = Law(
    "best", "cascade with friction ahead, observers, standstill", "7.1-7.3, 5.15-5.21", step.step, designed,
    estimates=True,
)  # fmt: skip
