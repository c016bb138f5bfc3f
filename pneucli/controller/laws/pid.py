"""PIDs of position and pressure (7.1-7.3), without or with feed-forward of mass, friction and motion.

Position: ``F = m (KD (v_r - v) + KP (x_r - x)) + m KI int (x_r - x) dt``, poles by the rule of the cascade; with
feed-forward also ``m a_r + Fv v_r`` and dry friction (3.6) along the reference, and in the pressure loop the gradient
of the piston's motion.
"""
# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: F403, F405, ANN

from pneucli.controller.cascade import set_pressure_references
from pneucli.controller.laws.base import ControlLaw
from pneucli.controller.laws.shared_blocks import feedforward_force, pressure_pi, read_sensors
from pneucli.controller.layout import *
from pneucli.controller.reference import follow_reference


def pid_force(s, c):
    """Return the force in N: PID and feed-forward; set_pressure_references back-calculates the integral."""
    error = s[S_X_SHAPED] - s[S_X]
    rate = s[S_V_SHAPED] - s[S_V]
    s[S_INTEGRAL] += c[C_PERIOD] * c[C_MASS] * c[C_KI] * error
    return c[C_MASS] * (c[C_KD] * rate + c[C_KP] * error) + s[S_INTEGRAL] + c[C_FEEDFORWARD] * feedforward_force(s, c)


def pid_step(x_ref, x, p1, p2, s, c):
    """Advance the PIDs by one sample; readings and commands as in cascade_step."""
    x_ref = read_sensors(x_ref, x, p1, p2, s, c)
    if follow_reference(x_ref, s, c):
        set_pressure_references(pid_force(s, c), s, c)
    pressure_pi(s, c)


PID = ControlLaw(
    "pid",
    "PIDs of position and pressure",
    "7.1-7.3",
    pid_step,
    design=lambda data: data.shared_parameters(),
    place=20,
)
PID_FEEDFORWARD = ControlLaw(
    "pid-feedforward",
    "the PIDs with mass, friction and motion ahead",
    "7.1-7.3, 3.6",
    pid_step,
    design=lambda data: data.shared_parameters(feedforward=True),
    place=30,
)
