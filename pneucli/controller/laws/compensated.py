"""Model reference adaptive compensation (5.15-5.21) in both loops (7.2, 7.3).

Each loop is a PD or P for the ideal subsystem, less the equivalent value of an observer's discontinuous feedback.
Position (figure 7.7): ``m dv^/dt = F - Fv v^ + d``, pressure (figure 7.11): ``dp^/dt = W(u, p) + d``, where d is the
feedback ``d[k] = d_eq[k-1] + M_k sign(sigma[k])`` (5.21), sigma the reading less the observed value, and d_eq its
low-pass (5.18-5.20). Dry friction, load, and the piston's motion (a32) are all of them disturbances (7.2, 7.3).

Discrete time: the sign is implicit (Acary and Brogliato 2010), ``min(max(sigma / T, -M_k), M_k)`` about what the
observer foresees. The pressure's estimate is subtracted as a gradient before the inverse map, not as a voltage behind
it: where the map is inverted exactly both are one, and within the valve's overlap a voltage says nothing.
"""
# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: F403, F405, ANN

from __future__ import annotations

from pneucli.controller.cascade import set_pressure_references
from pneucli.controller.laws.base import ControlLaw
from pneucli.controller.laws.shared_blocks import (
    NEXT_LAW_PARAMETER,
    NEXT_LAW_STATE,
    S_UNFILTERED_SPEED,
    drive_chamber_1,
    drive_chamber_2,
    read_sensors,
)
from pneucli.controller.layout import *
from pneucli.controller.plant import clamp, pressure_force
from pneucli.controller.reference import follow_reference

(
    S_OBSERVED_V,  # m/s: observed speed
    S_OBSERVED_P1,  # Pa: observed pressures
    S_OBSERVED_P2,
    S_LAST_GRADIENT,  # Pa/s: what the last command should make of the first
) = range(NEXT_LAW_STATE, NEXT_LAW_STATE + 4)
(
    C_LOAD_FILTER,  # 1: shares by which the filtered values are followed in a sample
    C_FLOW_FILTER,
) = range(NEXT_LAW_PARAMETER, NEXT_LAW_PARAMETER + 2)


def observe_load(s, c):
    """Observe the speed (5.17-5.19); S_LOAD becomes the filtered equivalent value in N, positive toward +x (5.20)."""
    h = c[C_PERIOD]
    force = pressure_force(s, c) - c[C_VISCOUS] * s[S_OBSERVED_V] + s[S_LOAD]
    foreseen = s[S_OBSERVED_V] + h * force / c[C_MASS]
    fed = clamp(c[C_MASS] * (s[S_UNFILTERED_SPEED] - foreseen) / h, -c[C_LOAD_STEP_MAX], c[C_LOAD_STEP_MAX])
    s[S_OBSERVED_V] = foreseen + h * fed / c[C_MASS]
    s[S_LOAD] += c[C_LOAD_FILTER] * fed


def observe_flow(p, made, seen: int, flow: int, s, c):
    """Observe a pressure in Pa that the valve should change by ``made`` in Pa/s; s[flow] becomes what else does."""
    h = c[C_PERIOD]
    foreseen = s[seen] + h * (made + s[flow])
    fed = clamp((p - foreseen) / h, -c[C_FLOW_STEP_MAX], c[C_FLOW_STEP_MAX])
    s[seen] = foreseen + h * fed
    s[flow] += c[C_FLOW_FILTER] * fed


def load_pressure(s, c):
    """Return the pressure in Pa that the valve of chamber 1 changes: of both chambers where one valve is all."""
    if c[C_TWO_VALVES] > 0.5:
        return s[S_P1]
    return pressure_force(s, c) / c[C_AREA_1]


def ideal_force(s, c):
    """Return the force in N that the ideal piston takes: PD, mass and viscous friction on the reference's way."""
    error = s[S_X_SHAPED] - s[S_X]
    rate = s[S_V_SHAPED] - s[S_V]
    return c[C_MASS] * (s[S_A_SHAPED] + c[C_KD] * rate + c[C_KP] * error) + c[C_VISCOUS] * s[S_V_SHAPED]


def compensated_step(x_ref, x, p1, p2, s, c):
    """Advance both loops by one sample; readings and commands as in step."""
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


LAW = ControlLaw(
    "compensated",
    "model reference adaptive compensation in both loops",
    "5.15-5.21, 7.2, 7.3",
    compensated_step,
    estimates_load=True,
)
