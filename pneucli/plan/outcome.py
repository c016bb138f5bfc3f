"""A manoeuvre as a model predicts it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Outcome:
    """The prediction of one model, SI, each array of shape (n,).

    Attributes:
        time: Time stamps in s.
        readings: What the bench's sensors and its logger of commands read, without noise.
        p1: True pressure of chamber 1, or of the vessel.
        p2: That of chamber 2; None without a piston.
        x: Position; None without a piston.
        v: Velocity; None without a piston.
        air: Air in kg that the supply gives.
        lowest_pressure: Pressure in Pa below which the prediction makes no sense.
    """

    time: Array
    readings: Mapping[str, Array]
    p1: Array
    p2: Array | None = None
    x: Array | None = None
    v: Array | None = None
    air: float = 0.0
    lowest_pressure: float = 0.0
