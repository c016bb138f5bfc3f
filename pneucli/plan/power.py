r"""The power of a plan: the probability that its recordings show an effect, from the sensitivities of the residuals.

The best model predicts each recording with the noise of its bench. Through the residual models of the diagnosis it is
compared with the model that has one effect more at its typical size, or that lacks one. To first order this difference
is a column of :math:`M`, as is the derivative by each parameter of the best model, all in units of the expected
deviation. :math:`A = M^T M` holds all that the power needs; the matrices of several recordings add, those of the fitted
ones as well. With :math:`d` the row of an effect and :math:`n` those of all else, whose prior precision is :math:`P`,
:math:`A_{dd} - A_{dn} (A_{nn} + P)^{-1} A_{nd}` is the information about the size of the effect. What the plan adds to
it is the square of the size in standard errors.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import ndtr

from pneucli.arrays import Array
from pneucli.identify.estimation.blocks import channel_slices
from pneucli.identify.estimation.objective import LeastSquaresProblem
from pneucli.identify.estimation.parameters import FreeParameter, null_value
from pneucli.identify.estimation.score_test import initial_guesses
from pneucli.identify.residuals import ResidualModel, residual_models
from pneucli.messages.plan import GOOD_POWER, Power
from pneucli.physics.declaration import Effect, consists_of_times
from pneucli.physics.sides import declared_name
from pneucli.plan.bench import Manoeuvre, Outcome
from pneucli.plan.simulation import simulate_manoeuvre, synthetic_recording
from pneucli.simulate.model import Model, parameter_value, with_effect
from pneucli.simulate.preparation import prepare
from pneucli.simulate.rig_quantities import rig_quantities

DETECTION_LEVEL = 3.16  # standard errors that a catalogue of effects takes: 4 less the 0.84 of 80 % power
SIGMA_80 = 4.0  # standard errors of a size that is found with a power of 80 %
MIN_BLOCK_TIME = 0.02  # s, of a discrepancy whose correlation time is unknown
MIN_CURVATURE = 1e-10  # of the largest one, below which recordings do not show a direction
LATE_PARTS = ("valve", "line")  # whose dynamics no rig lacks
NOISE_SEED = 4900


@dataclass(frozen=True)
class Deviation:
    """The deviation of the best model from recordings in one channel of one subsystem.

    ``ratio`` is its rms over the noise (1: noise alone), ``time_constant`` the correlation time in s of what exceeds
    noise.
    """

    ratio: float = 1.0
    time_constant: float = 0.0

    def divisor(self, period: float) -> float:
        """Return the standard deviation per sample, in units of noise, of white noise that tells as little.

        A discrepancy repeats over its correlation time: ``2 time_constant / period`` samples are one reading.

        >>> Deviation(1.0, 0.1).divisor(1e-3)
        1.0
        >>> round(Deviation(2.0, 0.05).divisor(1e-3), 2)  # sqrt(1 + 3 * 100)
        17.35
        """
        return float(np.sqrt(1.0 + (self.ratio**2 - 1.0) * max(1.0, 2.0 * self.time_constant / period)))


ByChannel = Mapping[tuple[str, str], Deviation]  # by title of the subsystem and channel


@dataclass(frozen=True)
class Difference:
    """How far a model differs from the best one in the channel where it differs most, (n,) in units of noise.

    ``unexplained`` is the rms, in the same units, that the best model leaves in this channel.
    """

    channel: str
    values: Array
    unexplained: float = 1.0

    @property
    def rms(self) -> float:
        """Root mean square."""
        return float(np.sqrt(np.mean(self.values**2)))


@dataclass(frozen=True)
class Prediction:
    """A recording of a plan as the best model predicts it: ``information`` is its matrix ``A``, in the order of
    ``Expectation.columns``; ``differences`` are those of some other models, none where nothing is compared.
    """

    outcome: Outcome
    information: Array
    differences: Mapping[str, Difference]


@dataclass(frozen=True)
class Expectation:
    """What the recordings of a plan will be compared with, and what is known before.

    Attributes:
        model: The best model.
        others: The K models by name of an effect: the best one with it at its typical size, or without it.
        free: The p parameters of the best model.
        prior: The matrix ``A`` before the plan, of priors and recordings, shape (K + p, K + p).
        horizon: Restart interval of the comparison in s.
        low_pass: Corner in Hz of the comparison's low-pass; None: no filter.
        deviations: The deviation of the best model, where it is known.
        usual: That of any other channel.
    """

    model: Model
    others: Mapping[str, Model]
    free: Sequence[FreeParameter]
    prior: Array
    horizon: float
    low_pass: float | None = None
    deviations: ByChannel = field(default_factory=dict)
    usual: Deviation = Deviation()

    @property
    def columns(self) -> list[str]:
        """Names of the columns: effects, then parameters."""
        return [*self.others, *(f.name for f in self.free)]

    @property
    def lags(self) -> set[str]:
        """Names of the lags of valve and line that the best model lacks: every spool and every hose is late."""
        added = {e.name: e for other in self.others.values() for e in other.effects}
        late = [e for e in added.values() if e.side is None and e.part in LATE_PARTS and consists_of_times(e)]
        return {e.name for e in late} - {e.name for e in self.model.effects}

    def with_recordings(self, models: Sequence[ResidualModel]) -> Expectation:
        """Return what is expected after recordings, whose information becomes part of the prior one."""
        prior = self.prior.copy()
        for one in models:
            scaled = self._scaled(one, self._changes(one))
            prior += scaled @ scaled.T
        return replace(self, prior=prior)

    def predict(self, manoeuvre: Manoeuvre, shown: Collection[str] = ()) -> Prediction:
        """Return a recording as the best model predicts it, with its information.

        Args:
            manoeuvre: The manoeuvre.
            shown: The effects whose differences are kept.
        """
        outcome = simulate_manoeuvre(manoeuvre, self.model)
        recording = synthetic_recording(manoeuvre, outcome, "plan", NOISE_SEED)
        experiment = prepare(recording, self.model.rig, self.horizon, self.low_pass)
        information, found = np.zeros_like(self.prior), dict[str, list[Difference]]()
        for one in residual_models([experiment], whiten_initial_state=True):
            changes = self._changes(one)
            for name in shown:
                row = changes[self.columns.index(name)].reshape(len(one.channels), -1)
                channels = zip(one.channels, row, self._deviations(one), strict=True)
                found.setdefault(name, []).extend(Difference(c, part.copy(), d.ratio) for c, part, d in channels)
            scaled = self._scaled(one, changes)
            information += scaled @ scaled.T
        return Prediction(outcome, information, {n: max(those, key=lambda d: d.rms) for n, those in found.items()})

    def _deviations(self, one: ResidualModel) -> list[Deviation]:
        return [self.deviations.get((one.title, channel), self.usual) for channel in one.channels]

    def _changes(self, one: ResidualModel) -> Array:
        """Return the changes (K + p, N) of the residuals by each column, in units of noise."""
        start = [replace(f, start=parameter_value(self.model, f.name)) for f in self.free]
        problem = LeastSquaresProblem(self.model, [one], start)
        (nominal,) = problem.data_residuals(self.model)
        with np.errstate(all="ignore"):
            rows = [problem.data_residuals(other)[0] - nominal for other in self.others.values()]
            rows += [*problem.jacobian(problem.start)[: nominal.size].T] if self.free else []
        return np.nan_to_num(np.array(rows).reshape(-1, nominal.size), nan=0.0, posinf=0.0, neginf=0.0)

    def _scaled(self, one: ResidualModel, changes: Array) -> Array:
        """Return the changes (K + p, N) in units of the expected deviation."""
        period = one.experiment.recording.period
        scale = [np.full(one.experiment.time.size, d.divisor(period)) for d in self._deviations(one)]
        return np.asarray(changes / np.concatenate(scale))

    def size_over_error(self, information: Array, effect: str) -> float:
        """Return the size of an effect over the standard error that a plan would give it, all else adjusting.

        Args:
            information: The sum of the matrices ``A`` of the plan.
            effect: The effect.
        """
        added = self._size_information(self.prior + information, effect) - self._size_information(self.prior, effect)
        return float(np.sqrt(max(added, 0.0)))

    def _size_information(self, matrix: Array, effect: str) -> float:
        """Return the information about the size of an effect beside parameters of others, and lags of typical size."""
        names, lags = self.columns, self.lags - {declared_name(effect)}
        at, count = names.index(effect), len(self.others)
        rest = [i for i, n in enumerate(names) if (n.partition(".")[0] != effect if i >= count else n in lags)]
        prior = np.diag([1.0 if i < count else 0.0 for i in rest])
        inner = matrix[np.ix_(rest, rest)] + prior
        level = 1.0 / np.sqrt(np.maximum(np.diag(inner), np.finfo(float).tiny))
        across = level * matrix[rest, at]
        absorbed = np.linalg.pinv(inner * np.outer(level, level), rcond=MIN_CURVATURE, hermitian=True) @ across
        return float(matrix[at, at] - across @ absorbed)

    def power(self, information: Array, effect: str) -> float:
        """Return the probability that a plan finds an effect; arguments as of ``size_over_error``."""
        return detection_power(self.size_over_error(information, effect))


def detection_power(size_over_error: float) -> float:
    """Return the probability that an effect is found whose size is so many standard errors.

    >>> round(detection_power(4.0), 2)
    0.8
    """
    return float(ndtr(size_over_error - DETECTION_LEVEL) + ndtr(-size_over_error - DETECTION_LEVEL))


def power_table(expectation: Expectation, information: Array) -> list[Power]:
    """Return the power to find each effect that the best model lacks at its typical size, and its size at 80 % power.

    Args:
        expectation: The models, and what is known before the plan.
        information: The sum of the matrices ``A`` of the plan.

    Returns:
        Two entries for each effect, one for an effect without a null.
    """
    best, rows = expectation.model, []
    there = {e.name for e in best.effects}
    for name, model in ((name, model) for name, model in expectation.others.items() if name not in there):
        p = model.effects[-1].in_model_with(best.effects).leading_parameter
        value, null = model.values[f"{name}.{p.name}"], null_value(p, best)
        size, over_error = abs(value - (null or 0.0)), expectation.size_over_error(information, name)
        rows.append(Power(name, p.name, size, p.unit, detection_power(over_error), typical=True))
        if null is not None:
            least = SIGMA_80 * size / over_error if over_error > 0.0 else float("inf")
            rows.append(Power(name, p.name, least, p.unit, GOOD_POWER, typical=False))
    return rows


def with_absent_effects(
    model: Model, effects: Iterable[Effect], recordings: Sequence[ResidualModel]
) -> dict[str, Model]:
    """Return a model with each effect that it lacks and recordings can show, at its typical size, by name.

    Args:
        model: The model.
        effects: The effects to choose from.
        recordings: Residual models of the benches.
    """
    there = {e.name for e in model.effects}
    absent = [e for e in effects if e.name not in there and e.part not in model.excluded_parts]
    shown = [e for e in absent if any(m.is_sensitive_to(e) for m in recordings)]
    quantities = rig_quantities(model, [one.experiment for one in recordings])
    starts = [(e, initial_guesses(e, quantities, model.rig.priors)) for e in shown]
    return {e.name: with_effect(model, e, values[len(values) // 2]) for e, values in starts if values}


def prior_information(count: int, free: Sequence[FreeParameter]) -> Array:
    """Return the matrix ``A`` of priors alone: of none about effects, of those of parameters.

    Args:
        count: Number of effects.
        free: The parameters.
    """
    return np.diag([*np.zeros(count), *(f.prior_sigma**-2 for f in free)])


def deviations_of(models: Sequence[ResidualModel], residual: Array) -> dict[tuple[str, str], Deviation]:
    """Return the deviation of a fitted model in each channel of each subsystem.

    Args:
        models: The residual models of the fit.
        residual: Its residuals in units of noise, shape (N,).
    """
    parts: dict[tuple[str, str], list[tuple[Array, float]]] = {}
    slices = iter(channel_slices(models))
    for one in models:
        for channel in one.channels:
            row = (residual[next(slices)], one.experiment.recording.period)
            parts.setdefault((one.title, channel), []).append(row)
    return {key: _deviation(rows) for key, rows in parts.items()}


def _deviation(rows: Sequence[tuple[Array, float]]) -> Deviation:
    count = sum(np.count_nonzero(row) for row, _ in rows)
    ratio = float(np.sqrt(sum(float(row @ row) for row, _ in rows) / count)) if count else 1.0
    if ratio <= 1.0:
        return Deviation()
    return Deviation(ratio, float(np.median([_correlation_time(row, period) for row, period in rows])))


def _correlation_time(row: Array, period: float) -> float:
    """Return the time in s in which the autocorrelation (n,) falls to 1/e of its value at one sample."""
    power = np.abs(np.fft.rfft(row, 2 * row.size)) ** 2
    covariance = np.fft.irfft(power)[: row.size // 2]
    if covariance.size < 3 or not covariance[1] > 0.0:
        return MIN_BLOCK_TIME
    decayed = np.flatnonzero(covariance[1:] < covariance[1] / np.e)
    return float(decayed[0] * period) if decayed.size else float(0.5 * row.size * period)
