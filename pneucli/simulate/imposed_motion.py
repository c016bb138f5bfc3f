"""The measured motion: smoothed; and where a recording imposes it, its derivatives and its turns."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pneucli.simulate.smoothing import LocalPolynomialSmoother, MotionSmoother

if TYPE_CHECKING:
    from pneucli.simulate.experiment import Experiment

Array = NDArray[np.float64]

DIFFERENTIATION_BANDWIDTH_FACTOR = (
    4.0  # times the frequency of a low-pass: x is filtered there before it is differentiated
)
RISE_TIME_FACTOR = 0.35  # times one over the frequency of a low-pass: from 10 to 90 % of a step


def smooth_motion(
    raw: Mapping[str, Array],
    smoothers: Mapping[str, LocalPolynomialSmoother],
    fusion: MotionSmoother | None,
    time: Array,
) -> tuple[Array, Array]:
    """Return smoothed position and velocity, each (n,)."""
    if fusion is not None:
        return fusion(raw["x"], raw["a"])[:2]
    x = smoothers["x"](raw["x"]) if "x" in smoothers else raw["x"]
    if "v" in raw:
        return x, raw["v"]
    return x, smoothers["x"].slope(raw["x"]) if "x" in smoothers else np.gradient(raw["x"], time)


def imposed_motion(experiment: Experiment, noise: Mapping[str, Array] | None = None) -> tuple[Array, Array, Array]:
    """Return x, v, a of an imposed motion, each (n,); derived from x where they were not measured.

    With a low-pass, x is filtered by it at ``DIFFERENTIATION_BANDWIDTH_FACTOR`` times its frequency before it is differentiated: what the
    comparison's own filter takes away is not needed, and differentiated noise would come back through the friction's
    sign.
    """
    time, raw = experiment.time, experiment.raw
    x = raw["x"] if noise is None else raw["x"] + noise.get("x", 0.0)
    if experiment.motion_smoother is not None:
        x, v, _ = experiment.motion_smoother(x, raw["a"])
        return x, v, raw["a"]
    if experiment.low_pass is not None:
        x = experiment.low_passed(x, DIFFERENTIATION_BANDWIDTH_FACTOR)
    elif "x" in experiment.smoothers:
        x = experiment.smoothers["x"](x)
    v = raw["v"] if "v" in raw else np.gradient(x, time)
    return x, v, raw["a"] if "a" in raw else np.gradient(v, time)


def detect_reversals(experiment: Experiment) -> NDArray[np.bool_]:
    """Return at which samples (n,) the measured motion does not tell its direction.

    From the last one that goes one way to the first that goes the other: a turn, which sampling and smoothing move by
    up to a period. Where the comparison asks for a low-pass, as long before and after as it takes to rise. Nowhere in a
    recording that would hold nothing else.
    """
    v, period = imposed_motion(experiment)[1], experiment.recording.period
    moving = np.flatnonzero(np.abs(v) > standstill_speed(experiment, v))
    turned = np.flatnonzero(np.diff(np.sign(v[moving])))
    rise = 0 if experiment.low_pass is None else round(RISE_TIME_FACTOR / experiment.low_pass / period)
    found = np.zeros(v.size, dtype=bool)
    for last, first in zip(moving[turned], moving[turned + 1], strict=True):
        found[max(last - rise, 0) : first + rise + 1] = True
    return found if not found.all() else np.zeros_like(found)


def standstill_speed(experiment: Experiment, v: Array) -> float:
    """Return the speed in m/s below which the measured motion does not tell its direction."""
    period = experiment.recording.period
    noise = experiment.noise["x"].rms / period if "x" in experiment.noise else 0.0
    return float(min(max(noise, 1e-6), 0.05 * np.max(np.abs(v)) + 1e-9))
