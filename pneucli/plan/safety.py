"""Whether a manoeuvre keeps the limits of a rig in every model that may be true, parameters off by their intervals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from pneucli.identify.estimation.fit import Fit
from pneucli.plan.limits import Limits, Violation, violations
from pneucli.plan.manoeuvre import Manoeuvre
from pneucli.plan.simulation import simulate_manoeuvre
from pneucli.recording import Rig
from pneucli.simulate.model import Model, parameter_value, with_parameters
from pneucli.simulate.valve_forms.area import ValveArea

SHIFTED_BEST = 4  # draws of the best model's parameters
SHIFTED_RIVAL = 1  # draws of each rival's
SEED = 49
BEST_MODEL = "best model"


@dataclass(frozen=True)
class Refused:
    """A manoeuvre that could exceed a limit: the model with which it does, and the limits."""

    manoeuvre: Manoeuvre
    model: str
    violations: tuple[Violation, ...]


@dataclass
class Safety:
    """The models in which every manoeuvre of a plan is simulated, and the manoeuvres that were refused.

    Attributes:
        rig: The rig.
        limits: Its limits.
        models: Models by name: the best one, its rivals, and each with parameters off by their intervals.
        refused: The refused manoeuvres.
    """

    rig: Rig
    limits: Limits
    models: Mapping[str, Model]
    refused: list[Refused] = field(default_factory=list)

    def __call__(self, manoeuvre: Manoeuvre) -> bool:
        """Return whether a manoeuvre keeps all limits, with a reserve, in every model; a refusal is noted."""
        limits = self.limits.with_reserve()
        for name, model in self.models.items():
            if found := violations(simulate_manoeuvre(manoeuvre, model), limits, self.rig):
                self.refused.append(Refused(manoeuvre, name, tuple(found)))
                return False
        return True


def models_to_check(best: Fit, rivals: Mapping[str, Model]) -> dict[str, Model]:
    """Return the models in which a manoeuvre must keep the limits.

    Args:
        best: The fit of the best model, whose covariance says how far parameters may be off.
        rivals: The models of its rivals by name.

    Returns:
        Models by name.
    """
    models: dict[str, Model] = {}
    for number, (rival, model) in enumerate({BEST_MODEL: best.model, **rivals}.items()):
        models[rival] = model
        count = SHIFTED_RIVAL if number else SHIFTED_BEST
        for k, shifted in enumerate(shifted_models(best, model, count, SEED + number), 1):
            models[f"{rival}, parameters off by their intervals ({k})"] = shifted
    return models


def shifted_models(fitted: Fit, model: Model, count: int, seed: int, sigma: float = 2.0) -> list[Model]:
    """Draw models whose parameters are off by their intervals.

    Args:
        fitted: The fit whose covariance says how far.
        model: The model to shift; parameters that it lacks are ignored.
        count: Number of models.
        seed: Seed of the draws.
        sigma: Standard errors at which each draw lies, along a random direction.

    Returns:
        The models.
    """
    rng, k = np.random.default_rng(seed), len(fitted.free)
    if k == 0:
        return [model] * count
    values, vectors = np.linalg.eigh(fitted.covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    models = []
    for _ in range(count):
        direction = rng.standard_normal(k)
        direction *= sigma / max(np.abs(direction).max(), 1e-9)
        change = root @ direction
        shifted = {}
        for f, dz in zip(fitted.free, change, strict=True):
            z = f.to_coordinate(parameter_value(model, f.name)) if _has(model, f.name) else np.nan
            value = f.from_coordinate(z + float(dz)) if np.isfinite(z) else np.nan
            if np.isfinite(value):
                shifted[f.name] = float(np.clip(value, f.lower, f.upper))
        models.append(with_monotone_valves(with_parameters(model, shifted)))
    return models


def with_monotone_valves(model: Model) -> Model:
    """Return a model whose valve maps pass no more at a command than at one farther from the null on the same side.

    The area within the dead zone is known to orders of magnitude only: a draw of it alone is an open valve at rest.
    """
    first, second = model.valve, model.valve_2
    if isinstance(first, ValveArea):
        model = replace(model, valve=_monotone(first))
    return replace(model, valve_2=_monotone(second)) if isinstance(second, ValveArea) else model


def _monotone(valve: ValveArea) -> ValveArea:
    commands, areas = np.array(valve.commands), np.array(valve.areas)
    vents = commands < 0.0
    inward = np.concatenate([np.minimum.accumulate(areas[vents]), np.minimum.accumulate(areas[~vents][::-1])[::-1]])
    return replace(valve, areas=tuple(float(a) for a in inward))


def _has(model: Model, name: str) -> bool:
    try:
        parameter_value(model, name)
    except KeyError:
        return False
    return True
