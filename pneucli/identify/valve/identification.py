"""Read the paths of a chamber from the fitted model (thesis 7.4): map, inverse, characteristics, and lack of fit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pneucli.arrays import Array, Mask
from pneucli.errors import InputError
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.guesses.base_model import PLACEHOLDER_VOLUME
from pneucli.identify.guesses.chamber_balance import Chamber
from pneucli.identify.guesses.flow_paths import (
    CommandConversion,
    FlowPathData,
    as_valve_test,
    command_conversion,
    flow_path_data,
    valve_driven,
)
from pneucli.identify.residuals import ChamberPressures
from pneucli.identify.valve.iso6358 import IsoConductance, iso_conductances
from pneucli.identify.valve.lack_of_fit import LackOfFit, lack_of_fit, measured_gradient
from pneucli.identify.valve.model_gradient import (
    Coverage,
    GradientMap,
    InverseMap,
    ModelGradient,
    coverage_of,
    gradient_map,
    inverse_map,
    invert_gradient,
    model_gradient_of,
)
from pneucli.messages.identify import Budget
from pneucli.quantities import Z95
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.run import simulate

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
