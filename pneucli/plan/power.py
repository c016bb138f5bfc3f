"""The power table: the size of each effect that the recordings of a plan would show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.estimation.parameters import null_value
from pneucli.physics.declaration import Effect, Parameter
from pneucli.plan.entropy import detection_power, minimum_detectable_size
from pneucli.plan.information import Information
from pneucli.simulate.model import Model

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Power:
    """The power of a plan to find an effect of one size.

    Attributes:
        effect: The effect.
        parameter: Its leading parameter.
        size: Distance of the parameter from its null, in its unit; the value itself where it has no null.
        power: Probability that an effect of this size is found.
        typical: Whether the size is the typical one; else it is the smallest with a power of 80 %.
    """

    effect: Effect
    parameter: Parameter
    size: float
    power: float
    typical: bool


def power_table(
    effects: Sequence[Effect], models: Sequence[Model], told: Information, covariance: Array, base: Model
) -> list[Power]:
    """Return the power to find each effect at its typical size, and its size at a power of 80 %.

    Args:
        effects: The K effects.
        models: The models with each effect at its typical size, in the order of ``told``.
        told: The information of the plan.
        covariance: Covariance of the base parameters before the plan, shape (p, p).
        base: The model without the effects.

    Returns:
        Two entries for each effect; the size at 80 % is infinite where the plan does not show the effect, and missing
        where the effect has no null.
    """
    significance = np.sqrt(np.maximum(np.diag(told.between_rivals(covariance)), 0.0))
    rows = []
    for effect, model, over_error in zip(effects, models, significance, strict=True):
        parameter = leading_parameter(effect.in_model_with(base.effects))
        value = model.values[f"{effect.name}.{parameter.name}"]
        null = null_value(parameter, base)
        size = abs(value - null) if null is not None else value
        rows.append(Power(effect, parameter, float(size), detection_power(float(over_error)), typical=True))
        if null is not None:
            least = minimum_detectable_size(float(size), float(over_error))
            rows.append(Power(effect, parameter, least, 0.8, typical=False))
    return rows


def leading_parameter(effect: Effect) -> Parameter:
    """Return the parameter that states the size of an effect: the first with a null, else the first."""
    return next((p for p in effect.parameters if p.null is not None), effect.parameters[0])
