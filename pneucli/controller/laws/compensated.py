"""Model reference adaptive compensation, thesis (5.15) to (5.21), in both loops (7.2, 7.3).

Each loop controls an ideal subsystem and subtracts the equivalent value of an observer's discontinuous feedback: the
load of the mechanical subsystem (:mod:`pneucli.controller.laws.load_observer`, figure 7.7), and the flow of the
pneumatic one, ``dp^/dt = W(u, p) + d`` (figure 7.11), which includes the piston's motion (the a32 term, 7.3).

Without friction in the observer, dry friction belongs to the estimate and the position loop is a PD. With it
(``friction_in_observer``), the ideal piston has the friction a22(v) (7.5, 7.6): the position loop is a PID with the
friction of the reference ahead.

The estimate of the flow is subtracted as a pressure gradient before the inverse valve map. Subtracting a voltage
behind the map is equivalent where the map is inverted exactly; within the overlap a voltage has no effect.
"""
# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: F403, F405, ANN

from typing import Any

from pneucli.controller.cascade import set_pressure_references
from pneucli.controller.laws.base import ControlLaw, LawParameters
from pneucli.controller.laws.load_observer import C_FRICTION_OBSERVED, observe_load
from pneucli.controller.laws.shared_blocks import (
    NEXT_LAW_PARAMETER,
    NEXT_LAW_STATE,
    drive_chamber_1,
    drive_chamber_2,
    feedforward_force,
    read_sensors,
)
from pneucli.controller.layout import *
from pneucli.controller.plant import clamp, pressure_force
from pneucli.controller.reference import follow_reference

(
    S_OBSERVED_P1,  # Pa: observed pressures
    S_OBSERVED_P2,
    S_LAST_GRADIENT,  # Pa/s: gradient of the first pressure that the last command should make
) = range(NEXT_LAW_STATE + 1, NEXT_LAW_STATE + 4)
C_FLOW_FILTER = NEXT_LAW_PARAMETER + 2  # 1: share by which the low-pass of the flow follows in a sample


def observe_flow(p, gradient, observed: int, flow: int, s, c):
    """Observe a pressure in Pa whose valve should make ``gradient`` (Pa/s); s[flow] becomes the equivalent value."""
    h = c[C_PERIOD]
    predicted = s[observed] + h * (gradient + s[flow])
    feedback = clamp((p - predicted) / h, -c[C_FLOW_STEP_MAX], c[C_FLOW_STEP_MAX])
    s[observed] = predicted + h * feedback
    s[flow] += c[C_FLOW_FILTER] * feedback


def load_pressure(s, c):
    """Return the pressure in Pa that the first valve changes: of both chambers where there is one valve."""
    if c[C_TWO_VALVES] > 0.5:
        return s[S_P1]
    return pressure_force(s, c) / c[C_AREA_1]


def ideal_force(s, c):
    """Return the force in N of the ideal piston: PD, or PID with friction ahead; mass and viscous friction ahead."""
    error = s[S_X_SHAPED] - s[S_X]
    rate = s[S_V_SHAPED] - s[S_V]
    feedback = c[C_MASS] * (c[C_KD] * rate + c[C_KP] * error)
    if c[C_FRICTION_OBSERVED] < 0.5:
        return feedback + c[C_MASS] * s[S_A_SHAPED] + c[C_VISCOUS] * s[S_V_SHAPED]
    s[S_INTEGRAL] += c[C_PERIOD] * c[C_MASS] * c[C_KI] * error
    return feedback + s[S_INTEGRAL] + feedforward_force(s, c)


def compensated_step(x_ref, x, p1, p2, s, c):
    """Advance both loops by one sample; readings and commands as in cascade_step."""
    x_ref = read_sensors(x_ref, x, p1, p2, s, c)
    if s[S_OBSERVED_P2] <= 0.0:
        s[S_OBSERVED_P1] = load_pressure(s, c)
        s[S_OBSERVED_P2] = s[S_P2]
    observe_load(s, c)
    observe_flow(load_pressure(s, c), s[S_LAST_GRADIENT], S_OBSERVED_P1, S_FLOW1, s, c)
    if follow_reference(x_ref, s, c):
        set_pressure_references(ideal_force(s, c) - s[S_LOAD], s, c)
    s[S_LAST_GRADIENT] = drive_chamber_1(c[C_P_KP] * (s[S_P1_REF] - s[S_P1]) - s[S_FLOW1], s, c)
    if c[C_TWO_VALVES] > 0.5:
        observe_flow(s[S_P2], s[S_RATE2], S_OBSERVED_P2, S_FLOW2, s, c)
        drive_chamber_2(c[C_P_KP] * (s[S_P2_REF] - s[S_P2]) - s[S_FLOW2], s, c)


def compensated_parameters(data: Any) -> LawParameters:
    """Return both disturbance observers; M_k of the flow is the largest a32 term in Pa/s.

    References:
        Thesis (5.20), (5.21): model reference adaptive compensation in discrete time.
    """
    return {
        **data.shared_parameters(),
        **data.load_observer_parameters(friction=data.requirements.friction_in_observer),
        "C_FLOW_STEP_MAX": data.max_motion_gradient,
        "C_FLOW_FILTER": data.low_pass_share(data.bandwidths.flow_observer),
    }


LAW = ControlLaw(
    "compensated",
    "model reference adaptive compensation in both loops",
    "5.15-5.21, 7.2, 7.3",
    compensated_step,
    compensated_parameters,
    place=60,
    variants={
        "friction in the observer": {"friction_in_observer": True},
        "friction compensated": {"friction_in_observer": False},
    },
    estimates_load=True,
)
