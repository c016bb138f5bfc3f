"""Models whose parameters are off by their intervals: what the rig may be as well."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pneucli.identify.estimation.fit import Fit
from pneucli.simulate.model import Model, parameter_value, with_parameters
from pneucli.simulate.valve_forms.area import ValveArea


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
