"""Read the paths of a chamber from the fitted model (thesis 7.4): map, inverse, characteristics, and lack of fit."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from pneucli.arrays import Array, Integers, Mask
from pneucli.distributions import student_t_quantile
from pneucli.errors import InputError
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.guesses.base_model import PLACEHOLDER_VOLUME
from pneucli.identify.guesses.flow_paths import (
    PRESSURE_SIGNALS,
    Chamber,
    CommandConversion,
    FlowPathData,
    as_valve_test,
    command_conversion,
    flow_path_data,
    valve_driven,
)
from pneucli.identify.residuals import ChamberPressures
from pneucli.identify.valve.iso6358 import IsoConductance, iso_conductances
from pneucli.identify.valve.model_gradient import (
    REPEATABILITY,
    Coverage,
    GradientMap,
    InverseMap,
    ModelGradient,
    coverage_of,
    gradient_map,
    inverse_map,
    invert_gradient,
    memory_gradient,
    model_gradient_of,
)
from pneucli.messages.identify import Budget
from pneucli.quantities import Z95
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.run import simulate

MAX_COMMANDS = 40  # more make cells of equal width
COMMAND_CELLS, PRESSURE_CELLS = 20, 12  # in which measured gradients are averaged
MIN_VISITS = 4  # of a cell, from which the scatter gives an error
SETTLING_TIME = 0.03  # s left out after a jump of the command, where spool, hose and clock dominate
TINY = 1e-300
NOISE_DRAWS = 16  # of the pressure sensor
MIN_COMMAND_JUMP = 0.005  # of the command's range in one sample
MIN_GRADIENT_RATIO = 0.01  # of the largest gradient; relative differences of smaller ones are not counted
MAX_RELATIVE_INTERVAL = 0.1  # half of it, of the gradient: a less certain one says little of the model
MIN_RELATIVE_DIFFERENCE = 0.02  # of the gradient: a difference beyond it counts as a misfit
MIN_INTERVALS = 1.5  # times the wider interval, three standard errors, beyond which it counts: chance makes 0.3 %
MAX_SHARE_OUTSIDE = 0.05  # share of points with a misfit beyond which the lack of fit is significant


@dataclass(frozen=True)
class LackOfFit:
    """The model compared with measured gradients at points ``u`` (V from the null) and ``p`` (Pa), arrays ``(nu, np)``.

    All gradients in Pa/s; ``model_error`` is the standard error of the model's fit, ``half_interval`` half the 95 %
    interval of ``measured``; ``covered`` marks points with data.
    """

    u: Array
    p: Array
    model: Array
    model_error: Array
    measured: Array
    half_interval: Array
    covered: Mask

    @property
    def difference(self) -> Array:
        """Measured minus modelled gradient in Pa/s."""
        return self.measured - self.model

    @cached_property
    def outside(self) -> Mask:
        """Where the difference exceeds both 95 % intervals."""
        distance = np.abs(self.difference)
        return np.asarray(self.covered & (distance > Z95 * self.model_error) & (distance > self.half_interval))

    @cached_property
    def has_flow(self) -> Mask:
        """Where the gradient is large enough, and known well enough, for a relative difference."""
        magnitude = np.abs(self.measured)
        largest = magnitude.max(where=self.covered, initial=0.0)
        is_known = self.half_interval < MAX_RELATIVE_INTERVAL * magnitude
        return np.asarray(self.covered & (magnitude > MIN_GRADIENT_RATIO * largest) & is_known)

    @property
    def relative_difference(self) -> Array:
        """The difference relative to the measured gradient, 0 where it does not count."""
        return np.asarray(np.abs(self.difference) / np.where(self.has_flow, np.abs(self.measured), np.inf))

    @property
    def median(self) -> float | None:
        """Median relative difference where data cover the map and air flows; None without such points."""
        return self._quantile(0.5)

    @property
    def p95(self) -> float | None:
        """95th percentile of the relative difference; None without such points."""
        return self._quantile(0.95)

    @property
    def share_outside(self) -> float | None:
        """Share of those points outside both intervals; None without such points."""
        return float(np.mean(self.outside[self.has_flow])) if self.has_flow.any() else None

    @property
    def is_significant(self) -> bool:
        """Whether more than 5 % of the points are off by 2 % of the gradient, and by 1.5 times either interval."""
        allowed = np.maximum(Z95 * self.model_error, self.half_interval)
        limit = np.maximum(MIN_INTERVALS * allowed, MIN_RELATIVE_DIFFERENCE * np.abs(self.measured))
        distance = np.abs(self.difference[self.has_flow]) > limit[self.has_flow]
        return bool(distance.size and np.mean(distance) > MAX_SHARE_OUTSIDE)

    def misfit(self, points: Mask, unit: Array) -> float:
        """Return the standard deviation of the model from the measured gradients at some points beyond their error.

        Args:
            points: The points, shape (nu, np).
            unit: What it is a share of, in Pa/s, shape (nu, np).

        Returns:
            The share, dimensionless; 0 without points.

        References:
            DerSimonian, R. and Laird, N., Controlled Clinical Trials 7 (1986) 177 (variance beyond known errors).
        """
        if not points.any():
            return 0.0
        share, error = (y[points] / np.abs(unit[points]) for y in (self.difference, self.half_interval / Z95))
        weight = 1.0 / (error**2 + REPEATABILITY**2)
        excess = np.sum(weight * (share**2 - error**2)) / np.sum(weight)
        return float(np.sqrt(max(excess, 0.0)))

    def _quantile(self, q: float) -> float | None:
        return float(np.quantile(self.relative_difference[self.has_flow], q)) if self.has_flow.any() else None


@dataclass(frozen=True)
class MeasuredGradient:
    """What a recording shows of the gradient of a map's volume beside the model's; arrays of shape (n,).

    ``remaining`` in Pa is the smoothed pressure less the integral of the model's gradient; ``noise`` is its standard
    deviation, ``drift`` how much the integral grows if the pressure is wrong by that all the time, and ``scale`` the
    volume over that of the map. ``largest`` in Pa/s is the largest measured gradient.
    """

    test: Experiment
    remaining: Array
    noise: Array
    drift: Array
    scale: Array
    largest: float


def measured_gradient(model: ModelGradient, driven: FlowPathData, test: Experiment, volume: float) -> MeasuredGradient:
    """Compute the gradient that a recording shows, for the volume of a map.

    Args:
        model: The gradient of the fitted model.
        driven: The paths in the recording.
        test: The recording as a valve test.
        volume: Volume of the map in m^3.

    Returns:
        The gradient.

    """
    e, kappa = driven.experiment, model.model.base_values()["rig.polytropic_exponent"]
    u, p, supply = test.inputs[:, (at.IN_U, at.IN_P1, at.IN_SUPPLY)].T
    memory = memory_gradient(model.model, test) if e.vessel else 0.0
    modelled = model(u, p, supply)
    before, after = (
        (volume * (y + memory) - kappa * p * driven.volume_rate) / driven.volume
        for y in (modelled, model(np.append(u[:1], u[:-1]), p, supply))  # the command was held until each sample
    )
    integral = _integral(e.time, before, after)
    name, power = PRESSURE_SIGNALS[1 if e.vessel else test.recording.chamber][0], np.zeros(e.time.size)
    remaining, rng = _smoothed(e, name, e.raw[name] - integral), np.random.default_rng(0)
    for _ in range(NOISE_DRAWS if name in e.noise else 0):
        power += _smoothed(e, name, e.noise[name].draw(e.time, rng)) ** 2
    noise, scale = np.sqrt(power / NOISE_DRAWS), driven.volume / volume
    rate = 0.5 * np.abs(model(u, p + noise, supply) - model(u, p - noise, supply)) / scale
    largest = float(np.abs(modelled + np.gradient(remaining, e.time) * scale).max())
    return MeasuredGradient(test, remaining, noise, _integral(e.time, rate, rate), scale, largest)


def _integral(time: Array, before: Array, after: Array) -> Array:
    """Return the integral of a rate (n,) by trapezoids between its values after and before each sample."""
    return np.append(0.0, np.cumsum(0.5 * np.diff(time) * (before[:-1] + after[1:])))


def _smoothed(e: Experiment, name: str, y: Array) -> Array:
    return e.smoothers[name](y) if name in e.smoothers else y


def lack_of_fit(model: ModelGradient, gradients: Sequence[MeasuredGradient]) -> LackOfFit:
    """Compare the model with measured gradients, averaged over cells of command and pressure.

    The error of a cell is that of the noise at both ends of each visit and between, or the scatter of its visits where
    that is larger. A cell that a moving piston passed needs visits that scatter: noise is not all that errs there.

    Args:
        model: The gradient of the fitted model.
        gradients: The measured gradients.

    Returns:
        The comparison at the centres of the cells and the supply pressure of the model.

    """
    levels, edges = _command_cells(np.concatenate([one.test.inputs[:, at.IN_U] for one in gradients]))
    pressures = np.linspace(model.ambient, model.supply, PRESSURE_CELLS + 1)
    u, p = np.meshgrid(levels, 0.5 * (pressures[1:] + pressures[:-1]), indexing="ij")
    passes = [_visits(one, edges, pressures) for one in gradients]
    cell = np.concatenate([one[0] for one in passes])
    seconds, rise, variance = np.concatenate([one[1] for one in passes], axis=1)

    def total(y: Array | None) -> Array:
        return np.bincount(cell, y, u.size).astype(np.float64)

    visits, duration = total(None), np.maximum(total(seconds), TINY)
    mean, freedom = total(rise) / duration, np.maximum(visits - 1.0, 1.0)
    scatter = total((rise - mean[cell] * seconds) ** 2) * visits / freedom
    by_scatter = student_t_quantile(0.975, freedom) * np.sqrt(scatter) * (visits >= MIN_VISITS)
    by_noise = student_t_quantile(0.975, NOISE_DRAWS) * np.sqrt(total(variance))
    half = np.maximum(by_noise, by_scatter) / duration
    covered = visits >= (1 if gradients[0].test.vessel else MIN_VISITS)
    measured = model(u, p) + mean.reshape(u.shape)
    return LackOfFit(
        u, p, model(u, p), model.fit_error(u, p), measured, half.reshape(u.shape), covered.reshape(u.shape)
    )


def _command_cells(u: Array) -> tuple[Array, Array]:
    """Return the commands of cells (m,) in V, and the edges between them (m - 1,): held commands, or equal widths."""
    levels = np.unique(np.round(u, 9))
    if levels.size > MAX_COMMANDS:
        edges = np.linspace(levels[0], levels[-1], COMMAND_CELLS + 1)
        return 0.5 * (edges[1:] + edges[:-1]), edges[1:-1]
    return levels, 0.5 * (levels[1:] + levels[:-1])


def _visits(one: MeasuredGradient, edges: Array, pressures: Array) -> tuple[Integers, Array]:
    """Return the cell of each visit (m,); its duration in s, the rise of what remains in Pa, its variance, (3, m)."""
    test = one.test
    u, p = test.inputs[:, (at.IN_U, at.IN_P1)].T
    cell = np.searchsorted(edges, u, side="right") * PRESSURE_CELLS
    cell += np.searchsorted(pressures[1:-1], p, side="right")
    if test.vessel:
        jumps = np.flatnonzero(np.abs(np.diff(u)) > MIN_COMMAND_JUMP * float(np.ptp(u))) + 1
        for jump in jumps:
            cell[jump : jump + max(round(SETTLING_TIME / test.recording.period), 1)] = -1
    starts = np.flatnonzero(np.diff(cell, prepend=-2))
    ends = np.append(starts[1:], cell.size) - 1
    kept = (cell[starts] >= 0) & (ends > starts)
    first, last = starts[kept], ends[kept]
    scale = 0.5 * (one.scale[first] + one.scale[last])
    rise, drift = (y[last] - y[first] for y in (one.remaining, one.drift))
    variance = one.noise[first] ** 2 + one.noise[last] ** 2 + drift**2
    return cell[first], np.array([test.time[last] - test.time[first], scale * rise, scale**2 * variance])


MAX_GRADIENT_RATIO = 3.0  # times the steepest measured slope: a steeper map does not describe this valve


@dataclass(frozen=True)
class Curve:
    """A held command: measured and fitted p (Pa) over time (s), and the model's dp/dt (Pa/s) along the fitted one."""

    recording: str
    u: float
    time: Array
    measured: Array
    fitted: Array
    gradient: Array
    ci_low: Array
    ci_high: Array


@dataclass(frozen=True)
class RecordingResidual:
    """Rms residual of the model in a recording over the noise, whitened for the errors of initial pressures."""

    recording: str
    use: str
    ratio_to_noise: float


@dataclass(frozen=True)
class ValveIdentification:
    """The paths of one chamber of the fitted model, and how far measured gradients are off.

    ``measured``: the curves are those of a vessel, else of a driven piston. ``residuals`` cover all valve tests,
    held-out ones included. ``max_gradient`` is the largest |dp/dt| (Pa/s) of the map where data cover it,
    ``max_measured_gradient`` the largest in the recordings. Commands are those of the valve; ``model_gradient`` and
    ``lack_of_fit`` count from the null.
    """

    chamber: Chamber
    command_conversion: CommandConversion
    measured: bool
    curves: tuple[Curve, ...]
    map: GradientMap
    inverse: InverseMap
    lack_of_fit: LackOfFit
    iso: tuple[IsoConductance, ...]
    residuals: tuple[RecordingResidual, ...]
    max_gradient: float
    max_measured_gradient: float
    coverage: Coverage
    model_gradient: ModelGradient
    budgets: Mapping[str, Budget] = field(default_factory=dict)  # of its characteristics

    @property
    def is_consistent(self) -> bool:
        """Whether the map stays close to the slopes of the curves."""
        return self.max_gradient <= MAX_GRADIENT_RATIO * self.max_measured_gradient

    def residual_to_noise(self, use: str) -> float | None:
        """Return the rms residual over the noise of all recordings of one use, None without any."""
        ratios = [one.ratio_to_noise for one in self.residuals if one.use == use]
        return float(np.sqrt(np.mean(np.square(ratios)))) if ratios else None

    @property
    def label(self) -> str:
        """The prefix of its parameter names."""
        return self.model_gradient.valve.label

    @property
    def volume(self) -> float | None:
        """The volume in m^3 for which the gradients hold, None for a vessel of unknown volume."""
        model = self.model_gradient.model
        return known_vessel_volume(model)

    def gradient(self, u: Array, p: Array, supply: Array | float | None = None) -> Array:
        """Return dp/dt (Pa/s) at any ``u`` (V), ``p`` and ``supply`` (Pa), broadcast against each other."""
        supply = self.model_gradient.supply if supply is None else supply
        opening = self.command_conversion.to_opening(u)
        return self.model_gradient(*np.broadcast_arrays(opening, p, np.asarray(supply, dtype=np.float64)))

    def command(self, gradient: Array, p: Array) -> tuple[Array, Mask]:
        """Return the command (V) for ``gradient`` (Pa/s) at ``p`` (Pa), and whether it is reachable."""
        gradient, p = np.broadcast_arrays(gradient, p)
        opening, reachable = invert_gradient(self.model_gradient, gradient, p, self.coverage)
        return self.command_conversion.from_opening(opening), reachable


def known_vessel_volume(model: Model) -> float | None:
    """Return the volume of the vessel.

    Args:
        model: The fitted model.

    Returns:
        The stated or identified volume in m^3; None where it is unknown.

    """
    volume = model.values["rig.vessel_volume"]
    return None if model.rig.vessel_volume is None and volume == PLACEHOLDER_VOLUME else volume


GRID_POINTS = 41  # of the map, over command and over pressure
MIN_CURVE_SAMPLES, MAX_CURVE_SAMPLES = 4, 200  # of a held command; of more, evenly spaced ones are kept


def identify_valve(experiments: Sequence[Experiment], fitted: Fit, chamber: Chamber = 1) -> ValveIdentification:
    """Read the paths of a chamber from the fitted model, and compare it with measured gradients.

    The map holds for the vessel's volume, or where no valve test was recorded for the chamber with its piston at
    mid-stroke. Its interval contains the error of the fit, and what measured gradients show of an error of the model.

    Args:
        experiments: The experiments; valve tests, or else driven pistons, of use ``train`` count, the others only for
            residuals. A shut valve takes no part.
        fitted: The fit of the model.
        chamber: Which chamber.

    Returns:
        The identification.

    Raises:
        InputError: No recording shows these paths, no command differs from zero, or the model's valve never opens.

    References:
        Thesis, section 7.4.

    """
    driven = [e for e in valve_driven(experiments) if as_valve_test(e, chamber) is not None]
    train = [e for e in driven if e.recording.use == "train"]
    has_vessel = any(e.vessel for e in train)
    train = [e for e in train if e.vessel or not has_vessel]
    if not train:
        fault = f"no flow into chamber {chamber} by a command"
        raise InputError("recordings", fault, "a valve test or a driven piston to train on", code="E062")
    command, fitted = command_conversion(fitted.model.rig, chamber), with_null_at_zero(fitted)
    volume = fitted.model.values.get("rig.vessel_volume") or mid_stroke_volume(fitted.model, chamber)
    fitted = replace(fitted, model=fitted.model.with_values({"rig.vessel_volume": volume}))
    tests = [_test(e, chamber) for e in train]
    model = model_gradient_of(fitted, tests)
    paths: Iterator[FlowPathData] = flow_path_data(train, fitted.model.rig, chamber, volume)
    gradients = [measured_gradient(model, path, test, volume) for path, test in zip(paths, tests, strict=True)]
    lack = lack_of_fit(model, gradients)
    shut = lack.covered & (model.valve(lack.u) == 0.0)
    model = replace(
        model,
        relative_misfit=lack.misfit(lack.has_flow, lack.measured),
        shut_misfit=lack.misfit(shut, np.ones(shut.shape)),
    )
    coverage = coverage_of(tests, model.valve)
    u, p = model.command_grid(GRID_POINTS)[:: int(command.sign)], np.linspace(model.ambient, model.supply, GRID_POINTS)
    grid = gradient_map(model, u, p, coverage)
    inverse = inverse_map(model, np.linspace(grid.gradient.min(), grid.gradient.max(), GRID_POINTS), p, coverage)
    has_volume = known_vessel_volume(fitted.model) if has_vessel else fitted.model.rig.has_cylinder
    shown = [_test(e, chamber) for e in driven if e.vessel] if has_vessel else []
    curves = [curve for test in tests if has_vessel for curve in _curves(model, test)]
    return ValveIdentification(
        chamber=chamber,
        command_conversion=command,
        measured=has_vessel,
        curves=tuple(replace(one, u=float(command.from_opening(np.array(one.u)))) for one in curves),
        map=replace(grid, u=command.from_opening(u)),
        inverse=replace(inverse, u=command.from_opening(inverse.u)),
        lack_of_fit=lack,
        iso=iso_conductances(model.valve, fitted) if has_volume else (),
        residuals=tuple(_residuals(model.model, shown)),
        max_gradient=float(np.abs(grid.gradient[grid.covered]).max(initial=0.0)),
        max_measured_gradient=max(one.largest for one in gradients),
        coverage=coverage,
        model_gradient=model,
    )


def with_null_at_zero(fitted: Fit) -> Fit:
    """Return the fit of the same model with commands that count from the null.

    Args:
        fitted: The fit.

    Returns:
        The fit with a null of 0 V.

    """
    return replace(fitted, model=replace(fitted.model, rig=replace(fitted.model.rig, valve_null=0.0)))


def mid_stroke_volume(model: Model, chamber: Chamber) -> float:
    """Return the volume of a chamber at mid-stroke.

    Args:
        model: The model.
        chamber: Which chamber.

    Returns:
        The volume in m^3.

    """
    base = model.base_values()
    stroke = model.rig.stroke or 0.0
    return base[f"rig.dead_volume_{chamber}"] + 0.5 * stroke * base[f"rig.piston_area_{chamber}"]


def _test(experiment: Experiment, chamber: Chamber) -> Experiment:
    test = as_valve_test(experiment, chamber)
    assert test is not None  # as its caller asked
    return test


def _curves(model: ModelGradient, test: Experiment) -> Iterator[Curve]:
    """Yield measured and modelled pressure wherever a command other than zero was held."""
    u, supply = test.inputs[:, (at.IN_U, at.IN_SUPPLY)].T
    fitted, measured = simulate(model.model, test)["p1"], test.measured("p1")
    starts = np.flatnonzero(np.diff(u, prepend=np.nan) != 0.0)
    lengths = np.diff(np.append(starts, u.size))
    is_curve = (lengths >= MIN_CURVE_SAMPLES) & (u[starts] != 0.0)
    for first, length in zip(starts[is_curve].tolist(), lengths[is_curve].tolist(), strict=True):
        some = np.linspace(first, first + length - 1, min(length, MAX_CURVE_SAMPLES)).round().astype(np.int64)
        rows = some[np.isfinite(measured[some])]
        gradient, half = model(u[rows], fitted[rows], supply[rows]), Z95 * model.standard_error(u[rows], fitted[rows])
        signals = test.time[rows], measured[rows], fitted[rows], gradient, gradient - half, gradient + half
        yield Curve(test.recording.name, float(u[first]), *signals)


def _residuals(model: Model, tests: Sequence[Experiment]) -> Iterator[RecordingResidual]:
    """Yield the rms residual of the pressure over its noise, of each test whose sensor has any."""
    for test in tests:
        view = ChamberPressures(test, whiten_initial_state=True)
        if "p1" in view.channels:
            residual = view.residual(model)["p1"][np.isfinite(view.measured["p1"])]
            ratio = float(np.sqrt(np.mean(residual**2))) / view.noise["p1"]
            yield RecordingResidual(test.recording.name, test.recording.use, ratio)
