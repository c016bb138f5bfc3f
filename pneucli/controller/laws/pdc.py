"""Parallel distributed compensation of the axis' TP model (4.4-4.6), gains from the LMIs of Tanaka and Wang.

``q = - sum_ij w_i(v) w_j(x) F_ij (x - x_r, v - v_r, F)`` with the weights of the TP model at the measured speed and
position, between its nodes linear as in the model, and the vertices' gains. The gas flow q (kg/s) becomes a gradient
by the chamber's volume (2.22) and a command by the inverse map. The law has no integral, and its model of dry friction
is that of the TP model.
"""
# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: F403, F405, ANN

from typing import Any

import numpy as np

from pneucli.controller.laws.base import ControlLaw, LawParameters
from pneucli.controller.laws.shared_blocks import NEXT_LAW_PARAMETER, drive_chamber_1, drive_chamber_2, read_sensors
from pneucli.controller.layout import *
from pneucli.controller.plant import clamp, pressure_force
from pneucli.controller.reference import shape_reference
from pneucli.errors import InputError

(
    C_PDC_SPEEDS,  # nodes of speed from -C_V_MAX to C_V_MAX, and weights there
    C_PDC_V_WEIGHTS,
    C_PDC_POSITIONS,  # nodes of position, the first and the last in m, and weights there
    C_PDC_FIRST,
    C_PDC_LAST,
    C_PDC_X_WEIGHTS,
    C_PDC_TABLE,  # weights of speed by node, weights of position by node, three gains a vertex (kg/s over m, m/s, N)
) = range(NEXT_LAW_PARAMETER, NEXT_LAW_PARAMETER + 7)


def interpolated_weight(at, nodes: int, count: int, which: int, table: int, c):
    """Return a weight at a fractional node index, linear between nodes."""
    i: int = min(int(at), nodes - 2)
    before = c[table + i * count + which]
    return before + (at - i) * (c[table + (i + 1) * count + which] - before)


def pdc_flow(s, c):
    """Return the gas flow in kg/s: the weighted sum of the vertex gains (4.4)."""
    speeds: int = int(c[C_PDC_SPEEDS])
    v_count: int = int(c[C_PDC_V_WEIGHTS])
    places: int = int(c[C_PDC_POSITIONS])
    x_count: int = int(c[C_PDC_X_WEIGHTS])
    x_table: int = C_PDC_TABLE + speeds * v_count
    gains: int = x_table + places * x_count
    v_at = clamp(0.5 * (s[S_V] / c[C_V_MAX] + 1.0), 0.0, 1.0) * (speeds - 1)
    x_at = clamp((s[S_X] - c[C_PDC_FIRST]) / (c[C_PDC_LAST] - c[C_PDC_FIRST]), 0.0, 1.0) * (places - 1)
    off = s[S_X] - s[S_X_SHAPED]
    rate = s[S_V] - s[S_V_SHAPED]
    force = pressure_force(s, c)
    flow = 0.0
    for i in range(v_count):
        of_speed = interpolated_weight(v_at, speeds, v_count, i, C_PDC_TABLE, c)
        for j in range(x_count):
            share = of_speed * interpolated_weight(x_at, places, x_count, j, x_table, c)
            own: int = gains + 3 * (i * x_count + j)
            flow -= share * (c[own] * off + c[own + 1] * rate + c[own + 2] * force)
    return flow


def pdc_step(x_ref, x, p1, p2, s, c):
    """Advance the law by one sample, as cascade_step; a second valve keeps the mean pressure."""
    x_ref = read_sensors(x_ref, x, p1, p2, s, c)
    shape_reference(x_ref, s, c)
    s[S_P1_REF] = s[S_P1]
    s[S_P2_REF] = c[C_P_MEAN]
    drive_chamber_1(c[C_GAMMA_R_T] / (c[C_DEAD_VOLUME_1] + c[C_AREA_1] * s[S_X]) * pdc_flow(s, c), s, c)
    if c[C_TWO_VALVES] > 0.5:
        drive_chamber_2(c[C_P_KP] * (s[S_P2_REF] - s[S_P2]), s, c)


def pdc_parameters(data: Any) -> LawParameters:
    """Return weights and gains of the parallel distributed compensation.

    Raises:
        InputError: No weight type has verified gains.
    """
    if data.scheduled is None:
        raise InputError("the PDC", data.reason_missing("scheduled"), "gains that the LMIs allow", code="E070")
    model, pdc = data.scheduled
    speed_weights, position_weights = model.weights
    table = np.concatenate([speed_weights.ravel(), position_weights.ravel(), pdc.gains.ravel()])
    return {
        **data.shared_parameters(),
        "C_PDC_SPEEDS": float(speed_weights.shape[0]),
        "C_PDC_V_WEIGHTS": float(speed_weights.shape[1]),
        "C_PDC_POSITIONS": float(position_weights.shape[0]),
        "C_PDC_FIRST": float(model.grids[1][0]),
        "C_PDC_LAST": float(model.grids[1][-1]),
        "C_PDC_X_WEIGHTS": float(position_weights.shape[1]),
        "C_PDC_TABLE": tuple(map(float, table)),
    }


LAW = ControlLaw(
    "pdc",
    "parallel distributed compensation, scheduled by TP weights",
    "4.4-4.6",
    pdc_step,
    pdc_parameters,
    place=70,
    controls_pressure=False,
)
