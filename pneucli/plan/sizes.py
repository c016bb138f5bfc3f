"""The sizes of the effects in question, and how far a plan narrows them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.parameters import null_value
from pneucli.physics.declaration import Parameter
from pneucli.plan.information import Information
from pneucli.plan.power import leading_parameter
from pneucli.plan.rivals import Rival

Array = NDArray[np.float64]

MIN_SIZE_ERROR = 1e-6  # of an effect's relative size


@dataclass(frozen=True)
class EffectSize:
    """The size of an effect in question.

    Attributes:
        name: EFFECT.PARAMETER of its leading parameter.
        parameter: That parameter.
        distance: Distance of its value from the null, SI; the value itself where it has no null.
        error: Relative standard error of that distance before the plan.
        rival: Position among the rivals of the hypothesis that the effect is there.
        position: Position among the parameters of the best model; None: the best model lacks the effect.
        fitted: Whether the error is that of a fit; else it is assumed.
    """

    name: str
    parameter: Parameter
    distance: float
    error: float
    rival: int
    position: int | None = None
    fitted: bool = True

    def error_after(self, told: Information, covariance: Array) -> float:
        """Return the relative standard error after a plan.

        Args:
            told: What the plan tells.
            covariance: Covariance of the parameters of the best model before it, shape (p, p).
        """
        if self.position is not None:
            after = told.parameter_covariance(covariance)[self.position, self.position]
            return self.error * float(np.sqrt(after / covariance[self.position, self.position]))
        significance = told.between_rivals(covariance)[self.rival, self.rival]
        precision = max(self.error, MIN_SIZE_ERROR) ** -2 + max(significance, 0.0)
        return float(1.0 / np.sqrt(precision)) if precision > 0.0 else np.inf


def effect_sizes(best: Fit, rivals: Sequence[Rival]) -> list[EffectSize]:
    """Return the sizes of the effects of rivals.

    Args:
        best: The fit of the best model.
        rivals: The rivals without the best model, in the order of the information.
    """
    names, found = [f.name for f in best.free], []
    for number, rival in enumerate(rivals):
        if rival.effect is None:
            continue
        model = rival.model if rival.present else best.model
        parameter = leading_parameter(rival.effect.in_model_with(model.effects))
        name = f"{rival.effect.name}.{parameter.name}"
        distance = abs(model.values[name] - (null_value(parameter, model) or 0.0))
        if rival.present:
            found.append(EffectSize(name, parameter, distance, rival.size_error, number, fitted=rival.fitted))
        elif name in names and distance > 0.0:
            error = best[name].error / distance
            found.append(EffectSize(name, parameter, distance, error, number, names.index(name)))
    return found
