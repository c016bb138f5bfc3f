"""The base class of residual models, which compare one subsystem of a recording with the model, and their whitening.

Each segment between restarts starts from the smoothed pressure, whatever the model. Its error persists for as long as
no gas flows, and whitening takes it out of the residuals (docs/method.md). Pressures without a smoother (recordings of
few samples) are taken as exact.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.caches import compiled
from pneucli.identify.guesses.flow_paths import Chamber, opening_from_null
from pneucli.physics.declaration import Effect
from pneucli.physics.ports import Balance
from pneucli.quantities import SIGNALS
from pneucli.simulate import layout as at
from pneucli.simulate.derivatives import Directions
from pneucli.simulate.experiment import Experiment, segment_lengths
from pneucli.simulate.model import Model
from pneucli.simulate.outputs import sample_deviations
from pneucli.simulate.run import recalled, simulate

MAX_RESIDUAL = 1e9  # times the noise: the residual of a diverging model


@dataclass(frozen=True)
class DiscrepancyTerm:
    """A form that the error of a model may take in one channel.

    ``unit_signal`` (n,) is one ``unit`` of the term named ``name`` over time. ``to_residual`` maps time courses of the
    term (k, n) to their effect on the residual, (k, n) in units of noise, to first order. The term may be a function of
    any signal, or only of ``argument`` where that is given. ``modelled`` (n,) is that signal as the model gives it: the
    measured one contains the error itself.
    """

    name: str
    unit: str
    unit_signal: Array
    to_residual: Callable[[Array], Array]
    argument: str | None = None
    modelled: Array | None = None


class Places(NamedTuple):
    """Places of derivatives: the row of each parameter in ``array`` (k, N), column after column from ``start`` on.

    The array holds zeros there; zeros that are not written take no memory.
    """

    array: Array
    rows: NDArray[np.intp]
    start: int


@dataclass(frozen=True)
class ResidualModel(ABC):
    """One experiment compared with the model through one subsystem.

    ``title`` names the subsystem to people; ``balances`` are those in which an effect must act to be observable
    here, ``base_groups`` the groups of base parameters that matter. ``predicts_force``: its errors are errors of a
    force. ``is_simulated``: it is simulated from each restart on, so that errors grow until the next. ``weights`` by
    channel (1 where absent) multiply the residuals of a fit.
    """

    experiment: Experiment
    weights: Mapping[str, float] = field(default_factory=dict, kw_only=True)
    title: ClassVar[str]
    balances: ClassVar[frozenset[Balance]]
    base_groups: ClassVar[frozenset[str]]
    predicts_force: ClassVar[bool] = False
    is_simulated: ClassVar[bool] = True

    @property
    def name(self) -> str:
        """Recording and subsystem, for people."""
        return f"{self.experiment.recording.name}: {type(self).__name__.lower()}"

    @property
    def subsystem_channels(self) -> tuple[str, ...]:
        """The channels of the subsystem, recorded or not."""
        return self.experiment.channels

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """The channels with residuals; a channel without any noise has no scale and is left out."""
        e = self.experiment
        return tuple(c for c in e.channels if c in self.subsystem_channels and (c not in e.noise or e.noise[c].rms))

    def is_sensitive_to(self, effect: Effect) -> bool:
        """Return whether the effect can change the residuals."""
        return self.experiment.can_show(effect) and bool(self.balances & effect.balances)

    def exclusive_channels(self, effect: Effect) -> tuple[str, ...]:
        """Return the channels that only effects at the same port as this one can change."""
        return ()

    def is_sensitive_to_base(self, name: str) -> bool:
        """Return whether a base parameter can change the residuals."""
        return name.partition(".")[0] in self.base_groups

    @abstractmethod
    def residual(self, model: Model, errors: Mapping[str, Array] | None = None) -> dict[str, Array]:
        """Evaluate measured minus model.

        Args:
            model: The model.
            errors: Sensitivities to the initial state, see :meth:`initial_state_sensitivity`; computed where absent.

        Returns:
            The residual by channel, each (n,), in SI units; 0 where nothing was measured.

        """

    def initial_state_sensitivity(self, model: Model) -> dict[str, Array]:
        """Return the effect of initial-state errors by channel, each (k, n), in units of noise, if there are any."""
        return {}

    def differentiable(self, directions: Directions) -> NDArray[np.bool_]:
        """Return by which parameters simulations with dual numbers differentiate the residuals, (parameters,)."""
        return np.zeros(len(directions.steps), dtype=bool)

    def write_derivatives(
        self, directions: Directions, errors: Mapping[str, Array], some: Sequence[int], places: Places
    ) -> None:
        """Differentiate the residuals by some parameters for which :meth:`differentiable` holds.

        Args:
            directions: The parameters.
            errors: Sensitivities to the initial state.
            some: Indices of parameters.
            places: Where derivatives belong, in units of noise, weighted, channel after channel.
        """
        raise NotImplementedError

    def flow_gain_sensitivity(self, model: Model) -> dict[str, Array]:
        """Return the effect of relative flow errors by channel, each (k, n), in units of noise, if air flows."""
        return {}

    def discrepancy_terms(self, model: Model, channel: str) -> Sequence[DiscrepancyTerm]:
        """Return the forms that an error of the model may take in a channel."""
        unit = np.ones(self.experiment.time.size)
        return (DiscrepancyTerm("error", SIGNALS[channel].unit, unit, lambda added: added / self.noise[channel]),)

    def apply_whitening(self, residual: Mapping[str, Array], errors: Mapping[str, Array]) -> dict[str, Array]:
        """Return the residuals whitened for initial-state errors."""
        return dict(residual)

    def log_determinant(self, errors: Mapping[str, Array]) -> Array:
        """Return the log determinant that belongs to the whitening, channel after channel, shape (N,)."""
        return np.zeros(self.experiment.time.size * len(self.channels))

    @cached_property
    def noise(self) -> dict[str, float]:
        """The standard deviation of each channel from the sensors alone."""
        e = self.experiment
        return {c: e.noise[c].rms for c in self.channels if c in e.noise}

    def monte_carlo_rms(self, model: Model, errors: Mapping[str, Array], draws: int, seed: int) -> dict[str, float]:
        """Propagate drawn sensor noise through the model.

        Args:
            model: The model.
            errors: Sensitivities to the initial state, for the whitening.
            draws: Number of draws.
            seed: Seed of the draws.

        Returns:
            The rms by channel, in units of the sensors' noise.

        """
        deviations = sample_deviations(model, self.experiment, draws)
        whitened = [self.apply_whitening({c: d[i] for c, d in deviations.items()}, errors) for i in range(draws)]
        power = {c: float(np.mean([np.mean(s[c] ** 2) for s in whitened])) for c in self.channels}
        return {c: float(np.sqrt(p)) / self.noise[c] for c, p in power.items()}

    def differs(self, a: Model, b: Model) -> bool:
        """Return whether two models that differ in one parameter have different residuals here."""
        if a.valves != b.valves:
            return self.valve_differs(a, b)
        changed = {name for name in b.values if a.values.get(name) != b.values[name]}
        effect_names = {name.partition(".")[0] for name in changed}
        has_sensitive_effect = any(effect.name in effect_names and self.is_sensitive_to(effect) for effect in b.effects)
        return has_sensitive_effect or any(self.is_sensitive_to_base(name) for name in changed)

    def valve_differs(self, a: Model, b: Model) -> bool:
        """Return whether the valves of two models differ at the openings of this recording."""
        if self.pressures_are_inputs:
            return False
        pairs = (
            [(a.chamber_2_valve, b.chamber_2_valve)] if self.experiment.recording.chamber == 2 else [(a.valve, b.valve)]
        )
        if len(self.opening_ranges) == 2:
            pairs.append((a.chamber_2_valve, b.chamber_2_valve))
        return any(
            changed_from < opened_to and changed_to > opened_from
            for (old, new), (opened_from, opened_to) in zip(pairs, self.opening_ranges, strict=True)
            for changed_from, changed_to in old.changed_ranges(new)  # type: ignore[arg-type]
        )

    @property
    def pressures_are_inputs(self) -> bool:
        """Whether measured pressures replace the valve."""
        return "valve" not in self.base_groups

    @cached_property
    def opening_ranges(self) -> list[tuple[float, float]]:
        """The range of openings (V) of each path, from rest to the largest opening."""
        e = self.experiment
        chambers: list[Chamber] = [e.recording.chamber] if e.vessel else [1, 2]
        openings = [u for u in (opening_from_null(e, chamber) for chamber in chambers) if u is not None]
        return [(min(float(u.min()), 0.0), max(float(u.max()), 0.0)) for u in openings]

    @cached_property
    def measured(self) -> dict[str, Array]:
        """The measured channels, each (n,), NaN where nothing was measured."""
        return {c: self.experiment.measured(c) for c in self.channels}


def force_discrepancy_terms(experiment: Experiment, noise: float) -> tuple[DiscrepancyTerm, ...]:
    """Return the forms of a missing force on the piston: constant 1 N, dry friction of 1 N, viscous friction 1 N s/m.

    None acts on a piston that rests on an end, which may carry any force.

    Args:
        experiment: The experiment.
        noise: Noise of the force in N.

    Returns:
        The three terms.

    """
    free = experiment.is_free.astype(np.float64)
    v = experiment.inputs[:, at.IN_V] * free
    each = (("force", "N", free), ("dry friction", "N", np.sign(v)), ("viscous friction", "N s/m", v))
    return tuple(DiscrepancyTerm(name, unit, signal, lambda added: added / noise) for name, unit, signal in each)


def bounded_difference(measured: Array, modelled: Array, noise: float) -> Array:
    """Subtract model from measurement, bounded for a diverging model.

    Args:
        measured: Measured channel, shape (n,), NaN where nothing was measured.
        modelled: Modelled channel, shape (n,).
        noise: Noise of the channel, in the same unit.

    Returns:
        The difference, shape (n,), 0 where nothing was measured.

    >>> bounded_difference(np.array([1.0, np.nan]), np.array([0.5, 9.0]), noise=1.0).tolist()
    [0.5, 0.0]
    """
    difference = np.empty(measured.size)
    _write_bounded_difference(measured, modelled, MAX_RESIDUAL * noise, difference)
    return difference


@compiled(nogil=True, error_model="numpy")
def _write_bounded_difference(measured: Array, modelled: Array, limit: float, out: Array) -> None:
    """Write the difference, in one pass; ``limit`` in the place of what is no number."""
    for i in range(measured.size):
        difference = measured[i] - modelled[i]
        if math.isnan(measured[i]):
            out[i] = 0.0
        elif difference < -limit:
            out[i] = -limit
        elif difference <= limit:
            out[i] = difference
        else:
            out[i] = limit


PRESSURE_COLUMNS = {"p1": at.IN_P1, "p2": at.IN_P2}
NOISE_DRAWS = 16  # draws of the sensors' noise
SMOOTHING_BIAS_FACTOR = 1.4  # times the noise left after smoothing: sqrt(2), since the bias at bends is as large
MIN_POWER = 1e-12  # of an error, relative to the noise
RECENT_SENSITIVITIES = 16  # of a recording: the candidates of a round, before and after their last fit
RECENT_BYTES = 8 << 20  # of all of them
PRESSURE_PERTURBATION = 2e-4  # of the highest pressure, for forward differences


def initial_state_errors(experiment: Experiment) -> dict[str, float]:
    """Estimate the standard deviations of initial pressures.

    Args:
        experiment: The experiment with its smoothers and noise.

    Returns:
        By pressure, the standard deviation in Pa.

    """
    e, rng = experiment, np.random.default_rng(0)
    values: dict[str, list[Array]] = {name: [] for name in PRESSURE_COLUMNS}
    for _ in range(NOISE_DRAWS):
        noise = e.draw_noise(rng)
        for name in PRESSURE_COLUMNS:
            drawn = noise.get(name, np.zeros(e.time.size))
            values[name].append((e.smoothers[name](drawn) if name in e.smoothers else drawn)[e.restarts])
    return {name: SMOOTHING_BIAS_FACTOR * float(np.std(np.array(drawn))) for name, drawn in values.items()}


def initial_state_sensitivity(model: Model, experiment: Experiment, errors: dict[str, float]) -> dict[str, Array]:
    """Compute the effect of initial-state errors on the pressure readings.

    Args:
        model: The model.
        experiment: The experiment.
        errors: Standard deviations of :func:`initial_state_errors`.

    Returns:
        By pressure, shape (1, n), in units of the sensor's noise.

    """
    e, numbers = experiment, {**model.base_values(), **model.values}
    key = (model.effects, tuple(numbers.items()), model.valve, model.valve_2)
    changes = recalled(
        e.recent_sensitivities, key, lambda: _pressure_changes(model, e), RECENT_SENSITIVITIES, RECENT_BYTES
    )
    out = {}
    for channel, change in zip(PRESSURE_COLUMNS, changes, strict=True):
        if channel in e.smoothers and channel in e.channels and e.noise[channel].rms:
            out[channel] = errors[channel] / e.noise[channel].rms * change[None]
    return out


def _pressure_changes(model: Model, experiment: Experiment) -> Array:
    """Return the changes of the readings of p1 and p2 where all pressures start 1 Pa higher, shape (2, n)."""
    perturbed, columns = experiment.inputs.copy(), list(PRESSURE_COLUMNS.values())
    perturbation = PRESSURE_PERTURBATION * float(perturbed[:, columns].max())
    perturbed[:, columns] += perturbation
    nominal, shifted = simulate(model, experiment), simulate(model, experiment, perturbed)
    with np.errstate(over="ignore", invalid="ignore"):  # a diverging model has no derivatives
        return np.array([shifted[c] - nominal[c] for c in PRESSURE_COLUMNS]) / perturbation


def apply_whitening(residual: Array, errors: Array, restarts: NDArray[np.int64]) -> Array:
    """Return a residual (..., n) whitened for initial-state errors, see :func:`whiten`."""
    out = np.array(residual, dtype=np.float64, order="C")
    rows = out.reshape(-1, out.shape[-1])
    whiten(rows, errors, restarts, np.arange(len(rows)))
    return out


def whiten(
    residuals: Array, errors: Array, restarts: NDArray[np.int64], rows: NDArray[np.intp], start: int = 0
) -> None:
    """Whiten residuals for initial-state errors, segment by segment, in place.

    In each segment the covariance, in units of the noise, is C = I + sum of e e'. The inverse square root of each
    factor shrinks the component of the residual along that error.

    Args:
        residuals: Residuals in units of the noise, shape (k, N), row after row in memory.
        errors: Effect of each error in units of the noise, shape (m, n).
        restarts: First samples of the segments.
        rows: Which of the residuals.
        start: Column at which their n samples begin.

    """
    for error in _sequentially_whitened(errors, restarts):
        _shrink(residuals, rows, start, error, restarts)


def log_determinant(errors: Array, restarts: NDArray[np.int64]) -> Array:
    """Compute log det C of that covariance, spread evenly over each segment.

    A likelihood adds it to the sum of squares, so that a model with larger initial-state errors does not win by them.

    Args:
        errors: Effect of each error in units of the noise, shape (k, n).
        restarts: First samples of the segments.

    Returns:
        The share of each sample, shape (n,); its sum is log det C.

    """
    n = errors.shape[-1]
    samples, total = segment_lengths(restarts, n), np.zeros(n)
    for error in _sequentially_whitened(errors, restarts):
        total += np.repeat(np.log1p(np.add.reduceat(error * error, restarts)) / samples, samples)
    return total


def _sequentially_whitened(errors: Array, restarts: NDArray[np.int64]) -> Array:
    """Return errors (k, n), each whitened for those before it."""
    out = errors.copy()
    for k in range(len(out) - 1):
        _shrink(out, np.arange(k + 1, len(out)), 0, out[k].copy(), restarts)
    return out


@compiled(nogil=True, error_model="numpy", fastmath={"reassoc", "contract"})  # sums in any order
def _shrink(residuals: Array, rows: NDArray[np.intp], start: int, error: Array, restarts: NDArray[np.int64]) -> None:
    """Shrink the component along an error (n,) of n columns of some rows, one segment after another."""
    for s in range(restarts.size):
        first, last = restarts[s], restarts[s + 1] if s + 1 < restarts.size else error.size
        e, power = error[first:last], 0.0
        for i in range(e.size):
            power += e[i] * e[i]
        shrinkage = (1.0 - 1.0 / math.sqrt(1.0 + power)) / max(power, MIN_POWER)
        for row in rows:
            along, product = residuals[row, start + first : start + last], 0.0
            for i in range(e.size):
                product += e[i] * along[i]
            for i in range(e.size):
                along[i] -= shrinkage * product * e[i]
