"""Blocks that the laws of the thesis share: readings, feed-forward, pressure loop with inverse map (7.1-7.3).

The position loop requests a force, which is a pressure of chamber 1 (7.5-7.7); the pressure loop is a PI whose
gradient becomes a command by the inverse of the valve's map (figures 7.10 and 7.11). Where one command moves both
chambers, the force over the area of chamber 1 is that pressure; a second valve has a loop of its own.
"""
# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: F403, F405, ANN

from pneucli.controller.cascade import friction_feedforward
from pneucli.controller.layout import *
from pneucli.controller.observers import initialise_at_first_sample
from pneucli.controller.plant import (
    drive_mirrored_valve,
    is_plausible,
    limit_gradient_1,
    limit_gradient_2,
    valve_command,
    valve_command_2,
)

S_UNFILTERED_SPEED = FIRST_LAW_STATE  # m/s: unfiltered rate of the last two positions
C_SPEED_FILTER = FIRST_LAW_PARAMETER  # 1: share by which the rate is followed in a sample
NEXT_LAW_STATE, NEXT_LAW_PARAMETER = FIRST_LAW_STATE + 1, FIRST_LAW_PARAMETER + 1  # first own indices of a law


def read_sensors(x_ref, x, p1, p2, s, c):
    """Process the readings, with the speed as the filtered rate of position; return the reference.

    ``x_ref`` is the reference and ``x`` the read position in m, ``p1`` and ``p2`` are the read pressures in Pa.
    An implausible position is extrapolated at the last speed, an implausible pressure keeps its last value.
    """
    x_ref = initialise_at_first_sample(x_ref, x, p1, p2, s, c)
    h = c[C_PERIOD]
    if is_plausible(x, -0.05 * c[C_STROKE], 1.05 * c[C_STROKE]):
        s[S_UNFILTERED_SPEED] = (x - s[S_X]) / h
        s[S_V] += c[C_SPEED_FILTER] * (s[S_UNFILTERED_SPEED] - s[S_V])
        s[S_X] = x
    else:
        s[S_X] += h * s[S_V]
    if is_plausible(p1, 0.3 * c[C_AMBIENT], 2.0 * c[C_SUPPLY]):
        s[S_P1] = p1
    if is_plausible(p2, 0.3 * c[C_AMBIENT], 2.0 * c[C_SUPPLY]):
        s[S_P2] = p2
    return x_ref


def feedforward_force(s, c):
    """Return the feed-forward force in N along the reference: mass, viscous and dry friction (2.48, 3.6)."""
    return c[C_MASS] * s[S_A_SHAPED] + c[C_VISCOUS] * s[S_V_SHAPED] + friction_feedforward(s, c)


def motion_compensation_1(s, c):
    """Return the gradient in Pa/s of chamber 1 that compensates the piston's motion (a32 of 2.47)."""
    volume = c[C_DEAD_VOLUME_1] + c[C_AREA_1] * s[S_X]
    moved = c[C_GAMMA] * s[S_P1] * c[C_AREA_1] * s[S_V] / volume
    if c[C_TWO_VALVES] < 0.5:
        volume_2 = c[C_DEAD_VOLUME_2] + c[C_AREA_2] * (c[C_STROKE] - s[S_X])
        moved += c[C_AREA_2] / c[C_AREA_1] * c[C_GAMMA] * s[S_P2] * c[C_AREA_2] * s[S_V] / volume_2
    return moved


def drive_chamber_1(wanted, s, c):
    """Set the command for a gradient (Pa/s) of chamber 1 by the inverse map; return the gradient that it reaches."""
    if c[C_MIRRORED] > 0.5:
        return drive_mirrored_valve(wanted, s[S_X], s[S_P1], s[S_P2], s, c)
    volume = c[C_DEAD_VOLUME_1] + c[C_AREA_1] * s[S_X]
    s[S_U1] = valve_command(wanted, s[S_P1], volume, s, c)
    s[S_RATE1] = limit_gradient_1(wanted, s[S_P1], volume, s, c)
    return s[S_RATE1]


def drive_chamber_2(wanted, s, c):
    """Set the command for a gradient (Pa/s) of chamber 2 by the inverse map; return the gradient that it reaches."""
    volume = c[C_DEAD_VOLUME_2] + c[C_AREA_2] * (c[C_STROKE] - s[S_X])
    s[S_U2] = valve_command_2(wanted, s[S_P2], volume, s, c)
    s[S_RATE2] = limit_gradient_2(wanted, s[S_P2], volume, s, c)
    return s[S_RATE2]


def pressure_pi(s, c):
    """Control the pressures: one PI a valve, and compensation of the piston's motion if C_FEEDFORWARD is set."""
    error = s[S_P1_REF] - s[S_P1]
    wanted = c[C_P_KP] * error + s[S_INTEGRAL1] + c[C_FEEDFORWARD] * motion_compensation_1(s, c)
    if drive_chamber_1(wanted, s, c) == wanted:
        s[S_INTEGRAL1] += c[C_PERIOD] * c[C_P_KI] * error
    if c[C_TWO_VALVES] > 0.5:
        error = s[S_P2_REF] - s[S_P2]
        volume = c[C_DEAD_VOLUME_2] + c[C_AREA_2] * (c[C_STROKE] - s[S_X])
        moved = -c[C_GAMMA] * s[S_P2] * c[C_AREA_2] * s[S_V] / volume
        wanted = c[C_P_KP] * error + s[S_INTEGRAL2] + c[C_FEEDFORWARD] * moved
        if drive_chamber_2(wanted, s, c) == wanted:
            s[S_INTEGRAL2] += c[C_PERIOD] * c[C_P_KI] * error
