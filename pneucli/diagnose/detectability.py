"""How large an effect would have had to be to be seen: absent is not the same as invisible."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from pneucli.diagnose.candidate import Decision
from pneucli.diagnose.data import DiagnosisData, FittedModel
from pneucli.identify.estimation.parameters import null_value
from pneucli.identify.estimation.score_test import ScoreTest
from pneucli.physics.declaration import Effect, Parameter
from pneucli.units import unit_suffix

MDE_SIGMA = 4.0  # standard errors: found in 80 of 100 such data sets at 5 % over the whole catalogue


@dataclass(frozen=True)
class MinimumDetectableEffect:
    """The size of one effect's leading parameter from which it would have shown, in the parameter's unit.

    ``size`` is inf where no plausible size would have shown; ``typical`` tells whether a typical one would. ``where``
    has the values of parameters that tell where, when or how fast it acts: of another value another size would show.
    """

    effect: Effect
    parameter: Parameter
    size: float
    plausible: bool
    typical: bool
    where: Mapping[Parameter, float] = field(default_factory=dict)

    @property
    def would_show(self) -> str:
        """A sentence for a person."""
        title, unit = self.effect.title, unit_suffix(self.parameter.unit)
        told = [f"{p.title or p.name} {value:.2g}{unit_suffix(p.unit)}" for p, value in self.where.items()]
        name = "; ".join([self.parameter.title or self.parameter.name, *told])
        if not self.plausible:
            return f"{title}: these recordings cannot tell; no plausible size of it would have shown"
        null = self.parameter.null
        if null == 0.0:
            return f"{title}: above {self.size:.2g}{unit} ({name}) it would have shown"
        if null is None or null == math.inf:
            return f"{title}: at {self.size:.2g}{unit} ({name}) it would have shown"
        return f"{title}: from a difference of {self.size:.2g}{unit} ({name}) on it would have shown"


def minimum_detectable_effects(bench: DiagnosisData, state: FittedModel) -> list[MinimumDetectableEffect]:
    """Return, for every effect that the model lacks, the size that would have been seen."""
    lacking = bench.absent_effects(state)
    ranked = {e.name: found for e, found in bench.signatures_of(state, lacking)}
    return [_minimum_detectable_effect(effect, ranked.get(effect.name, []), state) for effect in lacking]


def undetectable_effects(bench: DiagnosisData, sizes: Sequence[MinimumDetectableEffect]) -> list[Decision]:
    """Return the effects that no recording feels, and those of which no plausible size would have shown."""
    unfelt = [e for e in bench.effects.values() if not bench.is_observable(e)]
    return [Decision(e, "cannot-show") for e in [*(d.effect for d in sizes if not d.plausible), *unfelt]]


def _minimum_detectable_effect(effect: Effect, found: list[ScoreTest], state: FittedModel) -> MinimumDetectableEffect:
    """The typical value nearest to none, moved in proportion to what its signature would show."""
    effect = effect.in_model_with(state.model.effects)
    leading = next((p for p in effect.parameters if p.null is not None), effect.parameters[0])
    name = f"{effect.name}.{leading.name}"
    seen = [s for s in found if not s.direct and np.isfinite(s.step_error) and s.step_error > 0.0]
    if not seen:
        return MinimumDetectableEffect(effect, leading, np.inf, plausible=False, typical=False)
    best = min(seen, key=lambda s: s.step_error)
    null = null_value(leading, state.model)
    where = {
        p: best.values[f"{effect.name}.{p.name}"] for p in effect.main_parameters if p.null is None and p is not leading
    }
    size = MDE_SIGMA * best.step_error
    if null is None:
        once = size < 1.0
        return MinimumDetectableEffect(effect, leading, best.values[name], plausible=once, typical=once, where=where)
    away = size * abs(best.values[name] - null)
    return MinimumDetectableEffect(effect, leading, away, plausible=size < 3.0, typical=size < 1.0, where=where)
