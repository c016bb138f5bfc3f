"""Made-up effects on made-up recordings: what each set of them explains is stated, and the program does all the rest.

The fits are linear and exact. Every reading has the same noise, every block of time the same cost, and each parameter
has readings of its own, so that an effect is as many standard errors from its absence as its cost alone makes it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np

from pneucli.diagnose.adequacy import LackOfFit
from pneucli.diagnose.data import DiagnosisData, Refit, ScreenedEffect
from pneucli.diagnose.score import FittedModel, RecordingCost
from pneucli.identify.estimation.fit import Fit, parameter_estimates
from pneucli.identify.estimation.parameters import effect_parameters
from pneucli.identify.residuals import ForceBalance
from pneucli.physics.declaration import Effect, Parameter
from pneucli.simulate.model import Model
from pneucli.simulate.rig_quantities import rig_quantities
from tests.diagnose.candidates import StatedErrors, costing
from tests.simulate.synthetic_experiments import FRICTION, RIG, VALVE, make_experiment, time_grid

BLOCKS, BLOCK_READINGS = 40, 250
READINGS = BLOCKS * BLOCK_READINGS
LARGEST = 9.0  # value of a parameter at its bound; the typical value is 1
MIN_SIGNIFICANCE = 1e-3  # standard errors of an effect that explains nothing

RESIDUAL_MODEL: Any = SimpleNamespace(
    channels=("force",),
    predicts_force=False,
    experiment=make_experiment("axis", time_grid(1.0), {"x": np.linspace(0.0, 0.2, 1001)}),
    is_sensitive_to=lambda effect: True,
)


def effect(name: str, *, parameters: int = 1, part: Any = "cylinder") -> Effect:
    """An effect whose parameters have no unit, a null of 0 and a typical value of 1; "a:1" is "a" at chamber 1."""
    declared = tuple(
        Parameter(f"size_{k + 1}", "1", 0.0, -LARGEST, LARGEST, (1.0,), "a size") for k in range(parameters)
    )
    side: Any = int(name[-1]) if name[-2:] in (":1", ":2") else None
    return Effect(name, name, part, declared, {}, "", "", "time", (), "", "none", side=side)


@dataclass(frozen=True)
class Facts:
    """What is stated about the effects.

    Attributes:
        excess: Cost in excess of noise without an effect, over the cost of noise.
        explained: Share of it that a set of effects explains. A set that is not stated explains as much as the largest
            of its parts that is, and the other effects alone.
        predicted: Share that the score test predicts for an effect, where it is not what the effect explains.
        size: Size of an effect over its typical size, 1 where it is not stated; its bound where ``at_bound`` has it.
        at_bound_with: The effect beside which an effect is at its bound.
        interval: Factor on the standard errors of an effect's interval.
        raises_error: Effects that raise the free-run error tenfold.
        raises_error_without: The effect without which an effect does.
        errors: The free-run error of sets of effects, where it is another one than by what they explain.
        needs: The effect without which an effect has no size to start from.
    """

    excess: float
    explained: Mapping[frozenset[str], float]
    predicted: Mapping[str, float] = field(default_factory=dict)
    size: Mapping[str, float] = field(default_factory=dict)
    at_bound: frozenset[str] = frozenset()
    at_bound_with: Mapping[str, str] = field(default_factory=dict)
    interval: Mapping[str, float] = field(default_factory=dict)
    raises_error: frozenset[str] = frozenset()
    raises_error_without: Mapping[str, str] = field(default_factory=dict)
    errors: Mapping[frozenset[str], float] = field(default_factory=dict)
    needs: Mapping[str, str] = field(default_factory=dict)

    def share(self, names: Sequence[str]) -> float:
        """Return the share of the excess that a set of effects explains."""
        chosen = frozenset(names)
        stated = [part for part in self.explained if part <= chosen]
        largest = max(stated, key=len, default=frozenset[str]())
        return self.explained.get(largest, 0.0) + sum(
            self.explained.get(frozenset([name]), 0.0) for name in chosen - largest
        )

    def variance(self, names: Sequence[str]) -> float:
        """Return the variance of the residuals with these effects in the model, over that of noise."""
        return 1.0 + self.excess * (1.0 - self.share(names))

    def significance(self, name: str, names: Sequence[str]) -> float:
        """Return the standard errors by which an effect differs from none, from the cost that it explains."""
        without = self.variance([other for other in names if other != name])
        return float(np.sqrt(READINGS * max(without / self.variance(names) - 1.0, 0.0)))


@dataclass(frozen=True)
class SyntheticData(DiagnosisData):
    """The data of a diagnosis with effects as they are stated; only fits and score tests are replaced."""

    facts: Facts = field(default_factory=lambda: Facts(0.0, {}))

    @cached_property
    def block_counts(self) -> tuple[int, ...]:
        return (BLOCKS,)

    def fitted_model(self, fit: Fit) -> FittedModel:
        """Return the fitted model with the effects of a fit."""
        return self.model_with([e.name for e in fit.model.effects])

    def model_with(self, names: Sequence[str]) -> FittedModel:
        """Return the fitted model with these effects."""
        variance = self.facts.variance(names)
        costs = np.full(BLOCKS, variance * BLOCK_READINGS)
        fitted = costing(self._fit(names), costs, np.full(BLOCKS, BLOCK_READINGS))
        ratio = float(np.sqrt(variance))
        self.lack_of_fit_cache[fitted] = [LackOfFit(ForceBalance, "force", ratio, ratio, ())], []
        return fitted

    def _fit(self, names: Sequence[str]) -> Fit:
        effects = [self.effects[name] for name in names]
        values = {f"{e.name}.{p.name}": self._value(e, names) for e in effects for p in e.parameters}
        model = Model(RIG, tuple(effects), FRICTION | values, VALVE)
        facts = rig_quantities(model, [RESIDUAL_MODEL.experiment])
        free = [f for e in effects for f in effect_parameters(e, model, facts)]
        significance = [self.facts.significance(e.name, names) for e in effects for _ in e.parameters]
        errors = np.array(
            [
                abs(f.to_coordinate(f.start)) / max(s, MIN_SIGNIFICANCE) or 1.0
                for f, s in zip(free, significance, strict=True)
            ]
        )
        # one reading of each parameter in each block; the residual there is +1 in one block and -1 in the next
        jacobian = np.tile(np.diag(1.0 / errors), (BLOCKS, 1)) / np.sqrt(BLOCKS)
        residual = np.repeat(np.where(np.arange(BLOCKS) % 2, -1.0, 1.0), len(free))
        blocks, covariance = np.repeat(np.arange(BLOCKS), len(free)), np.diag(errors**2)
        estimates = parameter_estimates(free, model, covariance)
        return Fit(model, tuple(free), estimates, residual, jacobian, blocks, covariance, 0.0, ())

    def _value(self, one: Effect, names: Sequence[str]) -> float:
        at_bound = one.name in self.facts.at_bound or self.facts.at_bound_with.get(one.name) in names
        return LARGEST if at_bound else self.facts.size.get(one.name, 1.0)

    def with_intervals(self, fitted: FittedModel) -> Fit:
        fit = fitted.fit
        if not fit.residual.size:  # it has them
            return fit
        factors = np.array([self.facts.interval.get(f.name.partition(".")[0], 1.0) for f in fit.free])
        covariance = fit.covariance * np.outer(factors, factors)
        return replace(fit, covariance=covariance, estimates=parameter_estimates(fit.free, fit.model, covariance))

    def has_initial_guess(self, fitted: FittedModel, effect: Effect) -> bool:
        return self.facts.needs.get(effect.name) in (None, *fitted.effect_names)

    def signatures_of(self, fitted: FittedModel, effects: Sequence[Effect]) -> list[ScreenedEffect]:
        names, found = fitted.effect_names, []
        for one in (e for e in effects if self.has_initial_guess(fitted, e)):
            share = self.facts.share([*names, one.name]) - self.facts.share(names)
            gain = READINGS * self.facts.excess * self.facts.predicted.get(one.name, share)
            values = {f"{one.name}.{p.name}": 1.0 for p in one.parameters}
            test: Any = SimpleNamespace(gain=gain, values=values, step_error=0.1, direct=False)
            found.append((one, [test]))
        return found

    def run_refit(self, task: Refit) -> FittedModel:
        names = task.base.effect_names
        if task.kind == "converge":
            return task.base
        if task.kind == "drop":
            return self.model_with([name for name in names if name != task.effect.name])
        assert self.has_initial_guess(task.base, task.effect)
        return self.model_with([*names, task.effect.name])

    def exclusive_channel_costs(self, fitted: FittedModel, effect: Effect) -> list[RecordingCost]:
        return []


def synthetic_data(effects: Sequence[Effect], facts: Facts, **more: Any) -> SyntheticData:
    """The data of a diagnosis with these effects in its catalogue, and one recording that is fitted."""

    def error(model: Model, _: Model | None) -> dict[str, float | None]:
        names = [e.name for e in model.effects]
        alone = {name for name, other in facts.raises_error_without.items() if other not in names}
        raised = 10.0 ** len((facts.raises_error | alone).intersection(names))
        usual = raised * float(np.sqrt(facts.variance(names)))
        return {"train": facts.errors.get(frozenset(names), usual), "test": None}

    given = {"free_run_errors": StatedErrors(error), "facts": facts, **more}
    return SyntheticData([RESIDUAL_MODEL], [], {e.name: e for e in effects}, **given)


def alone(**shares: float) -> dict[frozenset[str], float]:
    """What each effect explains, whatever else is in the model."""
    return {frozenset([name]): share for name, share in shares.items()}
