r"""The information of a manoeuvre: how far rival models differ in units of noise and discrepancy.

A manoeuvre is simulated with the best model, recorded with the noise of the bench, and compared with every rival
through the residual models with which the diagnosis compares. To first order the residuals of rival :math:`i` are
:math:`D_i`, those of a parameter's change are a column of :math:`J`. With :math:`M = [D\; J]` in units of the expected
deviation, :math:`A = M^T M` holds all that a plan needs, and the matrices of several manoeuvres add.

References:
    Hunter, W. G. and Reiner, A. M., Technometrics 7 (1965) 307 (largest difference of two models).
    Box, G. E. P. and Hill, W. J., Technometrics 9 (1967) 57 (expected change of entropy).
    Buzzi-Ferraris, G. and Forzatti, P., Chem. Eng. Sci. 38 (1983) 225 (against the variance of the prediction).
    Atkinson, A. C. and Fedorov, V. V., Biometrika 62 (1975) 57 (T-optimality: parameters of the rival adjust).

"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.objective import LeastSquaresProblem
from pneucli.identify.estimation.parameters import FreeParameter
from pneucli.identify.residuals import ResidualModel, residual_models
from pneucli.plan.deviation import (
    DeviationByChannel,
    ExpectedDeviation,
    LagDifference,
    accumulated_change,
    expected_deviations,
)
from pneucli.recording import Recording
from pneucli.simulate.model import Model, parameter_value
from pneucli.simulate.preparation import prepare

Array = NDArray[np.float64]

MAX_CONDITION = 1e12  # of a covariance that is inverted


@dataclass(frozen=True)
class Information:
    """The matrix ``A`` of one or more manoeuvres, shape (K + p, K + p): K rivals, then p parameters.

    ``distance`` (K,) is the rms difference of each rival from the best model in units of noise alone, in the channel in
    which it is largest.
    """

    matrix: Array
    rivals: int
    distance: Array

    def __add__(self, other: Information) -> Information:
        return Information(self.matrix + other.matrix, self.rivals, np.maximum(self.distance, other.distance))

    def between_rivals(self, covariance: Array) -> Array:
        """Return the Gram matrix (K, K) of the rivals, parameters adjusting within what they are known to.

        Args:
            covariance: Covariance of the parameters before the manoeuvre, shape (p, p).
        """
        k = self.rivals
        differences, cross, curvature = self.matrix[:k, :k], self.matrix[:k, k:], self.matrix[k:, k:]
        if curvature.size == 0:
            return differences
        root = covariance_root(covariance)
        inner = np.eye(root.shape[1]) + root.T @ curvature @ root
        half = root.T @ cross.T
        gram = differences - half.T @ np.linalg.solve(inner, half)
        return np.asarray(0.5 * (gram + gram.T))

    def parameter_covariance(self, covariance: Array) -> Array:
        """Return the covariance (p, p) of the parameters after the manoeuvre, from that before."""
        k = self.rivals
        root = covariance_root(covariance)
        inner = np.eye(root.shape[1]) + root.T @ self.matrix[k:, k:] @ root
        return np.asarray(root @ np.linalg.solve(inner, root.T))


def covariance_root(covariance: Array) -> Array:
    """Return a root R (p, r) of a covariance R R^T (p, p), without directions of no variance."""
    values, vectors = np.linalg.eigh(0.5 * (covariance + covariance.T))
    kept = values > max(values.max(initial=0.0), 0.0) / MAX_CONDITION
    return np.asarray(vectors[:, kept] * np.sqrt(values[kept]))


def information(
    recording: Recording,
    best: Model,
    others: Sequence[Model],
    free: Sequence[FreeParameter],
    deviations: DeviationByChannel,
    horizon: float,
    low_pass: float | None = None,
    lags: Sequence[Model] = (),
) -> Information | None:
    """Return what a recording would tell about rivals and parameters.

    Args:
        recording: The recording as the best model predicts it, with noise.
        best: The best model.
        others: The K rivals.
        free: The p parameters of the best model that are known only within an interval.
        deviations: The expected deviation by subsystem and channel.
        horizon: Restart interval of the comparison in s.
        low_pass: Corner in Hz of the comparison's low-pass.
        lags: The best model with each lag that it lacks, at its typical size.

    Returns:
        The information; None where the recording has nothing to compare.
    """
    models = _residual_models(recording, best, horizon, low_pass)
    if not models:
        return None
    current = [replace(f, start=parameter_value(best, f.name)) for f in free]
    problem = LeastSquaresProblem(best, models, current)
    nominal = np.concatenate(problem.data_residuals(best))
    rows = nominal.size
    scale = expected_scale(models, deviations, model_differences(problem, lags, nominal))
    differences = model_differences(problem, others, nominal)
    with np.errstate(all="ignore"):
        jacobian = problem.jacobian(problem.start)[:rows] if current else np.zeros((rows, 0))
    columns = np.column_stack([*differences, jacobian]) if differences or current else np.zeros((rows, 0))
    columns = np.nan_to_num(columns, nan=0.0, posinf=0.0, neginf=0.0)
    distance = _distances(models, columns[:, : len(others)])
    scaled = columns / scale[:, None]
    return Information(scaled.T @ scaled, len(others), distance)


def deviations_of(
    best: Fit, train: Sequence[ResidualModel], lags: Sequence[Model]
) -> dict[tuple[str, str], ExpectedDeviation]:
    """Return the expected deviation of a fitted model by subsystem and channel.

    Args:
        best: The fit.
        train: The residual models that it was fitted to.
        lags: Its model with each lag that it lacks, at its typical size.
    """
    problem = LeastSquaresProblem(best.model, train, ())
    nominal = np.concatenate(problem.data_residuals(best.model))
    return expected_deviations(train, best.residual, model_differences(problem, lags, nominal))


def model_differences(problem: LeastSquaresProblem, models: Sequence[Model], nominal: Array) -> list[Array]:
    """Return the differences of models from the best one, each (N,) in units of noise.

    Args:
        problem: The comparison with the best model.
        models: The models.
        nominal: The residuals of the best model, shape (N,).
    """
    with np.errstate(all="ignore"):
        found = [np.concatenate(problem.data_residuals(one)) - nominal for one in models]
    return [np.nan_to_num(one, nan=0.0, posinf=0.0, neginf=0.0) for one in found]


def rival_differences(
    recording: Recording, best: Model, others: Sequence[Model], horizon: float, low_pass: float | None = None
) -> dict[tuple[str, str], Array]:
    """Return the differences of rivals from the best model as the diagnosis would see them.

    Args:
        recording: The recording as the best model predicts it, with noise.
        best: The best model.
        others: The K rivals.
        horizon: Restart interval of the comparison in s.
        low_pass: Corner in Hz of the comparison's low-pass.

    Returns:
        Differences (K, n) in units of noise, by title of the subsystem and channel.
    """
    found: dict[tuple[str, str], Array] = {}
    for one in _residual_models(recording, best, horizon, low_pass):
        problem = LeastSquaresProblem(best, [one], ())
        with np.errstate(all="ignore"):
            nominal = problem.data_residuals(best)[0]
            rows = [problem.data_residuals(other)[0] - nominal for other in others]
        stacked = np.nan_to_num(np.array(rows)).reshape(len(others), len(one.channels), -1)
        found |= {(one.title, channel): stacked[:, i] for i, channel in enumerate(one.channels)}
    return found


def _residual_models(recording: Recording, best: Model, horizon: float, low_pass: float | None) -> list[ResidualModel]:
    experiment = prepare(recording, best.rig, horizon, low_pass)
    return residual_models([experiment], whiten_initial_state=True)


def expected_scale(
    models: Sequence[ResidualModel], deviations: DeviationByChannel, lags: Sequence[Array] = ()
) -> Array:
    """Return the expected deviation of each residual in units of noise, shape (N,).

    Args:
        models: The residual models.
        deviations: The expected deviation by subsystem and channel.
        lags: Differences that each lag would make, each (N,) in units of noise.
    """
    parts, at = [], 0
    for one in models:
        size, period = one.experiment.time.size, one.experiment.recording.period
        for channel in one.channels:
            expected = deviations.get((one.title, channel), ExpectedDeviation())
            changes = [LagDifference.of([lag[at : at + size]], period) for lag in lags]
            path = accumulated_change(one.experiment, channel)
            parts.append(np.full(size, expected.divisor(period, path, changes)))
            at += size
    return np.concatenate(parts)


def _distances(models: Sequence[ResidualModel], differences: Array) -> Array:
    parts = np.split(differences, np.cumsum([m.experiment.time.size for m in models for _ in m.channels])[:-1])
    return np.asarray(np.max([np.sqrt(np.mean(part**2, axis=0)) for part in parts], axis=0))
