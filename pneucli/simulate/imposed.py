"""Imposed motion: the force that the model needs for the measured motion, against the force that was measured."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.run import base_vector, kernel_for

Array = NDArray[np.float64]

WIDER = 4.0
RISE = 0.35  # times one over the frequency of a low-pass: from 10 to 90 % of a step


def motion(experiment: Experiment, noise: Mapping[str, Array] | None = None) -> tuple[Array, Array, Array]:
    """Return x, v, a of the measured motion, each (n,); derived from x where they were not measured.

    With a low-pass, x is filtered by it at ``WIDER`` times its frequency before it is differentiated: what the
    comparison's own filter takes away is not needed, and differentiated noise would come back through the friction's
    sign.
    """
    time, raw = experiment.time, experiment.raw
    x = raw["x"] if noise is None else raw["x"] + noise.get("x", 0.0)
    if experiment.fusion is not None:
        x, v, _ = experiment.fusion(x, raw["a"])
        return x, v, raw["a"]
    if experiment.low_pass is not None:
        x = experiment.filtered(x, WIDER)
    elif "x" in experiment.smoothers:
        x = experiment.smoothers["x"](x)
    v = raw["v"] if "v" in raw else np.gradient(x, time)
    return x, v, raw["a"] if "a" in raw else np.gradient(v, time)


def imposed_force(model: Model, experiment: Experiment, noise: Mapping[str, Array] | None = None) -> Array:
    """Return the force in N, shape (n,): the driving force, or without one the net force of the pressures.

    Where both are measured, the force of the pressures counts as known and the driving force is compared.
    """
    kernel = kernel_for(model.effects)
    inputs = experiment.inputs.copy()
    inputs[:, at.IN_X], inputs[:, at.IN_V], a = motion(experiment, noise)
    if "a" in experiment.raw:
        a = a - resting_reading(model, experiment)
    still = v_still(experiment, inputs[:, at.IN_V])
    out = np.zeros(experiment.time.size)
    base, th = base_vector(model, experiment), kernel.vector(model.effect_values())
    on = kernel.switches(experiment.active(model.effects))
    driven = "force" in experiment.recording
    kernel.functions.run_imposed(experiment.time, inputs, a, still, driven, base, th, on, out)
    return out


def turning(experiment: Experiment) -> NDArray[np.bool_]:
    """Return at which samples (n,) the measured motion does not tell its direction.

    From the last one that goes one way to the first that goes the other: a turn, which sampling and smoothing move by
    up to a period. Where the comparison asks for a low-pass, as long before and after as it takes to rise. Nowhere in a
    recording that would hold nothing else.
    """
    v, period = motion(experiment)[1], experiment.recording.period
    moving = np.flatnonzero(np.abs(v) > v_still(experiment, v))
    turned = np.flatnonzero(np.diff(np.sign(v[moving])))
    rise = 0 if experiment.low_pass is None else round(RISE / experiment.low_pass / period)
    found = np.zeros(v.size, dtype=bool)
    for last, first in zip(moving[turned], moving[turned + 1], strict=True):
        found[max(last - rise, 0) : first + rise + 1] = True
    return found if not found.all() else np.zeros_like(found)


def v_still(experiment: Experiment, v: Array) -> float:
    """Return the speed in m/s below which the measured motion does not tell its direction."""
    period = experiment.recording.period
    noise = experiment.noise["x"].rms / period if "x" in experiment.noise else 0.0
    return float(min(max(noise, 1e-6), 0.05 * np.max(np.abs(v)) + 1e-9))


def resting_reading(model: Model, experiment: Experiment) -> float:
    """Return what the model's accelerometer reads at rest in m/s^2."""
    reading = 0.0
    for effect in model.effects:
        if "read_a" in effect.ports and effect.name in experiment.active((effect,)):
            reading = float(effect.ports["read_a"](reading, *model.own(effect)))  # type: ignore[arg-type]
    return reading
