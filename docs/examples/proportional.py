"""A law whose force is in proportion to the error of the position."""
# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: F403, F405

from pneucli.controller.cascade import set_pressure_references
from pneucli.controller.laws.base import ControlLaw
from pneucli.controller.laws.shared_blocks import NEXT_LAW_PARAMETER, pressure_pi, read_sensors
from pneucli.controller.layout import *
from pneucli.controller.reference import follow_reference

C_PROPORTIONAL = NEXT_LAW_PARAMETER  # N/m


def proportional_step(x_ref, x, p1, p2, s, c):
    """Advance the law by one sample."""
    x_ref = read_sensors(x_ref, x, p1, p2, s, c)
    if follow_reference(x_ref, s, c):
        set_pressure_references(c[C_PROPORTIONAL] * (s[S_X_SHAPED] - s[S_X]), s, c)
    pressure_pi(s, c)


LAW = ControlLaw(
    "proportional",
    "force in proportion to the error",
    "none",
    proportional_step,
    design=lambda data: {**data.shared_parameters(), "C_PROPORTIONAL": 1000.0},
)
