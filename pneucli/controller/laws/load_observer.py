"""Observer of the load: a sliding mode observer of the speed, thesis (5.17) to (5.21), (7.5), (7.6).

The observer is a piston ``m dv^/dt = F - F_friction(v^) + d`` with the discontinuous feedback
``d[k] = d_eq[k-1] + M_k sign(v - v^)`` (5.21). Its low-pass d_eq (5.20) estimates what the observer's piston lacks:
load and dry friction, or the load alone where the observer knows friction (a22(v) of (7.5), (7.6)).

The sign is that at the end of the sample (implicit Euler, Acary and Brogliato 2010): ``M_k sign`` becomes
``min(max(m (v - v^) / T, -M_k), M_k)`` about the prediction. Known dry friction is a set: while the piston sticks,
friction balances any force within break-away, the prediction is exact and the estimate stays.
"""
# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: F403, F405, ANN

from pneucli.controller.laws.shared_blocks import NEXT_LAW_PARAMETER, NEXT_LAW_STATE, S_UNFILTERED_SPEED
from pneucli.controller.layout import *
from pneucli.controller.plant import clamp, net_force, speed_after

S_OBSERVED_V = NEXT_LAW_STATE  # m/s: speed of the observer's piston
(
    C_LOAD_FILTER,  # 1: share by which the low-pass (5.20) follows in a sample
    C_FRICTION_OBSERVED,  # 1: the observer's piston has dry friction (7.6), 0: viscous friction alone
) = range(NEXT_LAW_PARAMETER, NEXT_LAW_PARAMETER + 2)


def observe_load(s, c):
    """Advance the observer by one sample: S_LOAD becomes the equivalent value in N, positive toward +x."""
    h = c[C_PERIOD]
    force = net_force(s[S_X], s[S_P1], s[S_P2], s, c)
    if c[C_FRICTION_OBSERVED] > 0.5:
        predicted = speed_after(s[S_X], s[S_OBSERVED_V], force, h, s, c)
    else:
        predicted = s[S_OBSERVED_V] + h * (force - c[C_VISCOUS] * s[S_OBSERVED_V]) / c[C_MASS]
    feedback = clamp(c[C_MASS] * (s[S_UNFILTERED_SPEED] - predicted) / h, -c[C_LOAD_STEP_MAX], c[C_LOAD_STEP_MAX])
    s[S_OBSERVED_V] = predicted + h * feedback / c[C_MASS]
    s[S_LOAD] += c[C_LOAD_FILTER] * feedback
