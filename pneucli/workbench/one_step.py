"""One Gauss-Newton step on one recording: what the page shows at once, until the fit to all recordings has ended."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pneucli.arrays import Array
from pneucli.identify.estimation.parameters import FreeParameter
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model, parameter_value, with_parameters
from pneucli.simulate.outputs import simulate_outputs

MAX_RESIDUALS = 20_000  # of the step: it is to be seen at once, and more samples hardly change it
RANK_TOLERANCE = 1e-3  # of the largest singular value, below which a direction is not moved
STEPS = (1.0, 0.5, 0.25, 0.1, 0.03)  # shares of the step, until one lowers the cost


def gauss_newton_step(
    model: Model, experiment: Experiment, free: Sequence[FreeParameter], noise: Mapping[str, float]
) -> Model:
    """Return the model after one bounded Gauss-Newton step on one recording.

    Args:
        model: The model to start from.
        experiment: The recording.
        free: The parameters that may move; their values in the model are the start.
        noise: Noise floor of the channels, SI; one without is left out.

    Returns:
        The model whose cost is lower; the same model where no share of the step lowers it.

    """
    start = np.array([p.to_coordinate(max(parameter_value(model, p.name), _smallest(p))) for p in free])

    def at(z: Array) -> Model:
        return with_parameters(model, {p.name: _bounded(p, c) for p, c in zip(free, z, strict=True)})

    def residual(one: Model) -> Array:
        return _residual(one, experiment, noise)

    first = residual(at(start))
    if not free or not first.size:
        return model
    columns = []
    for i, parameter in enumerate(free):
        moved = start.copy()
        moved[i] += _difference_step(parameter, start[i])
        columns.append((residual(at(moved)) - first) / (moved[i] - start[i]))
    step = _solve(np.array(columns).T, -first)
    cost = float(first @ first)
    for share in STEPS:
        stepped = at(start + share * step)
        if float(np.sum(residual(stepped) ** 2)) < cost:
            return stepped
    return model


def _smallest(parameter: FreeParameter) -> float:
    return np.finfo(float).tiny if parameter.logarithmic else -np.inf


def _bounded(parameter: FreeParameter, z: float) -> float:
    return float(np.clip(parameter.from_coordinate(z), parameter.lower, parameter.upper))


def _difference_step(parameter: FreeParameter, z: float) -> float:
    """Return a step of the difference that stays within the bounds."""
    inside = parameter.from_coordinate(z + parameter.step) <= parameter.upper
    return parameter.step if inside else -parameter.step


def _residual(model: Model, experiment: Experiment, noise: Mapping[str, float]) -> Array:
    """Return measured minus model in units of the noise, of every so many samples; 0 where nothing was measured."""
    modelled = simulate_outputs(model, experiment)
    known = [c for c in modelled if noise.get(c, 0.0) > 0.0]
    stride = max(1, len(known) * experiment.time.size // MAX_RESIDUALS)
    parts = [(experiment.measured(c) - modelled[c])[::stride] / noise[c] for c in known]
    return np.nan_to_num(np.concatenate(parts), posinf=0.0, neginf=0.0) if parts else np.zeros(0)


def _solve(jacobian: Array, wanted: Array) -> Array:
    """Return the least-squares step; directions that the recording hardly shows stay where they are."""
    size = np.linalg.norm(jacobian, axis=0)
    scale = np.where(size > 0.0, size, 1.0)
    return np.asarray(np.linalg.lstsq(jacobian / scale, wanted, rcond=RANK_TOLERANCE)[0] / scale)
