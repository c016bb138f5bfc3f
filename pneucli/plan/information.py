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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.estimation.blocks import residual_counts
from pneucli.identify.estimation.objective import LeastSquaresProblem
from pneucli.identify.estimation.parameters import FreeParameter
from pneucli.identify.residuals import ResidualModel, residual_models
from pneucli.recording import Recording
from pneucli.simulate.model import Model, parameter_value
from pneucli.simulate.preparation import prepare

Array = NDArray[np.float64]

MIN_BLOCK_TIME = 0.02  # s, of a discrepancy whose correlation time is unknown
MAX_CONDITION = 1e12  # of a covariance that is inverted
DeviationByChannel = Mapping[tuple[str, str], "ExpectedDeviation"]


@dataclass(frozen=True)
class ExpectedDeviation:
    """The deviation of the best model from recordings in one channel of one subsystem.

    Attributes:
        ratio: Its rms over the noise; 1: noise alone.
        time_constant: Correlation time in s of what exceeds noise; 0: white.
    """

    ratio: float = 1.0
    time_constant: float = 0.0

    def divisor(self, period: float) -> float:
        """Return the standard deviation per sample, in units of noise, of white noise that tells as little.

        A discrepancy repeats over its correlation time: ``2 time_constant / period`` samples are one reading.

        Args:
            period: Sampling period in s.

        >>> ExpectedDeviation(1.0, 0.1).divisor(1e-3)
        1.0
        >>> round(ExpectedDeviation(2.0, 0.05).divisor(1e-3), 2)  # sqrt(1 + 3 * 100)
        17.35
        """
        excess = max(self.ratio**2 - 1.0, 0.0)
        return float(np.sqrt(1.0 + excess * max(1.0, 2.0 * self.time_constant / period)))


def expected_deviations(
    residual_model_list: Sequence[ResidualModel], residual: Array
) -> dict[tuple[str, str], ExpectedDeviation]:
    """Return the deviation of a fitted model in each channel of each subsystem.

    Args:
        residual_model_list: The residual models of the fit.
        residual: Its residuals in units of noise, shape (N,).

    Returns:
        The deviation by title of the subsystem and channel.
    """
    parts: dict[tuple[str, str], list[tuple[Array, float]]] = {}
    offsets = np.cumsum([0, *residual_counts(residual_model_list)])
    for one, begin, end in zip(residual_model_list, offsets, offsets[1:], strict=False):
        values = residual[begin:end].reshape(len(one.channels), -1)
        for channel, row in zip(one.channels, values, strict=True):
            parts.setdefault((one.title, channel), []).append((row, one.experiment.recording.period))
    return {key: _deviation(rows) for key, rows in parts.items()}


def _deviation(rows: Sequence[tuple[Array, float]]) -> ExpectedDeviation:
    squares = sum(float(row @ row) for row, _ in rows)
    count = sum(np.count_nonzero(row) for row, _ in rows)
    ratio = float(np.sqrt(squares / count)) if count else 1.0
    times = [_correlation_time(row, period) for row, period in rows]
    return ExpectedDeviation(max(ratio, 1.0), float(np.median(times)) if ratio > 1.0 else 0.0)


def _correlation_time(row: Array, period: float) -> float:
    """Return the time in s in which the autocorrelation (n,) falls to 1/e of its value at one sample."""
    power = np.abs(np.fft.rfft(row, 2 * row.size)) ** 2
    covariance = np.fft.irfft(power)[: row.size // 2]
    if covariance.size < 3 or not covariance[1] > 0.0:
        return MIN_BLOCK_TIME
    decayed = np.flatnonzero(covariance[1:] < covariance[1] / np.e)
    return float(decayed[0] * period) if decayed.size else float(0.5 * row.size * period)


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
        root = _root(covariance)
        inner = np.eye(root.shape[1]) + root.T @ curvature @ root
        half = root.T @ cross.T
        gram = differences - half.T @ np.linalg.solve(inner, half)
        return np.asarray(0.5 * (gram + gram.T))

    def parameter_covariance(self, covariance: Array) -> Array:
        """Return the covariance (p, p) of the parameters after the manoeuvre, from that before."""
        k = self.rivals
        root = _root(covariance)
        inner = np.eye(root.shape[1]) + root.T @ self.matrix[k:, k:] @ root
        return np.asarray(root @ np.linalg.solve(inner, root.T))


def _root(covariance: Array) -> Array:
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
    scale = np.concatenate([_scale(one, deviations) for one in models])
    with np.errstate(all="ignore"):
        differences = [np.concatenate(problem.data_residuals(other)) - nominal for other in others]
        jacobian = problem.jacobian(problem.start)[:rows] if current else np.zeros((rows, 0))
    columns = np.column_stack([*differences, jacobian]) if differences or current else np.zeros((rows, 0))
    columns = np.nan_to_num(columns, nan=0.0, posinf=0.0, neginf=0.0)
    distance = _distances(models, columns[:, : len(others)])
    scaled = columns / scale[:, None]
    return Information(scaled.T @ scaled, len(others), distance)


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


def _scale(model: ResidualModel, deviations: DeviationByChannel) -> Array:
    size, period = model.experiment.time.size, model.experiment.recording.period
    return np.concatenate(
        [
            np.full(size, deviations.get((model.title, channel), ExpectedDeviation()).divisor(period))
            for channel in model.channels
        ]
    )


def _distances(models: Sequence[ResidualModel], differences: Array) -> Array:
    parts = np.split(differences, np.cumsum([m.experiment.time.size for m in models for _ in m.channels])[:-1])
    return np.asarray(np.max([np.sqrt(np.mean(part**2, axis=0)) for part in parts], axis=0))
