"""Share of samples in which the disturbance observers of a law slide: their feedback is within its bound M_k."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pneucli.closed_loop.simulation import Run
from pneucli.controller import layout
from pneucli.controller.laws import LAWS
from pneucli.controller.parameters import Controller

Array = NDArray[np.float64]

MIN_SLIDING_SHARE = (
    0.8  # below it, with more than 20 % of the samples at the bound, the estimate is no equivalent value
)
ROUNDING = 1e-6  # relative, of an increment at the bound
# by observed disturbance: column of the log, bound M_k, and the share of the feedback that the low-pass (5.20) adds
OBSERVERS = {
    "load": (layout.L_LOAD, "C_LOAD_STEP_MAX", "C_LOAD_FILTER"),
    "flow": (layout.L_FLOW1, "C_FLOW_STEP_MAX", "C_FLOW_FILTER"),
}


def sliding_shares(run: Run, controller: Controller) -> dict[str, float]:
    """Return the share of samples in sliding mode of each disturbance observer.

    Args:
        run: A closed-loop run of the controller.
        controller: The controller; its law determines which observers exist.

    Returns:
        ``load`` and ``flow``, 0 to 1; NaN for an observer that the law does not have.

    References:
        Thesis (5.18) to (5.21): the filtered feedback is the disturbance only while the feedback is within M_k.

    """
    return {name: _share(run.log[:, column], _largest_increment(controller, bound, low_pass))
            for name, (column, bound, low_pass) in OBSERVERS.items()}  # fmt: skip


def _largest_increment(controller: Controller, bound: str, low_pass: str) -> float:
    """Return the increment of the estimate in a sample at the bound; NaN without such an observer."""
    law = LAWS[controller.law]
    if low_pass in law.constants:
        return controller.values[bound] * float(controller.vector()[law.constants[low_pass]])
    return controller.values[bound] if controller.values["C_DISTURBANCE_OBSERVERS"] > 0.5 else np.nan


def _share(estimate: Array, increment: float) -> float:
    if np.isnan(increment):
        return np.nan
    return float(np.mean(np.abs(np.diff(estimate)) < (1.0 - ROUNDING) * increment))
