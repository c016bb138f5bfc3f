"""Observe a valve by charge and discharge curves of a vessel (thesis 7.4), and hold the model's valve against them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pneucli.errors import InputError
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.model_fit import fit_model
from pneucli.identify.guesses.chamber_balance import Chamber
from pneucli.identify.guesses.flow_paths import CommandConversion, as_valve_test, command_conversion
from pneucli.identify.guesses.friction_and_valve import PLACEHOLDER_VOLUME, guess_base_model
from pneucli.identify.residuals import residual_models
from pneucli.identify.valve.area_model import AreaModel, Direction
from pneucli.identify.valve.fit import (
    Posterior,
    fit_area_model,
    initial_pressure_sensitivity,
    initial_pressures,
    simulate_transients,
)
from pneucli.identify.valve.iso6358 import IsoConductance, iso_conductances
from pneucli.identify.valve.lack_of_fit import LackOfFit, compare_with_map
from pneucli.identify.valve.maps import (
    Z95,
    Coverage,
    GradientMap,
    InverseMap,
    gradient_map,
    gradient_with_error,
    inverse_map,
    invert_gradient,
    transient_coverage,
)
from pneucli.identify.valve.model_gradient import ModelGradient, model_gradient_of
from pneucli.identify.valve.noise_covariance import averaged_noise_autocovariance
from pneucli.identify.valve.resampling import interpolation_error, is_unevenly_sampled
from pneucli.identify.valve.transients import Transients, cut_transients
from pneucli.noise import NoiseModel, pool_noise
from pneucli.recording import Recording, Rig
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model

Array = NDArray[np.float64]

MIN_HELD_TIME = 0.3  # s for which a command must be held in all to have a correction of its own
GRID_POINTS = 41
MAX_GRADIENT_RATIO = 3.0  # times the steepest that the curves show: more is not of this valve


@dataclass(frozen=True)
class Curve:
    """One stretch at a constant command: measured and fitted p (Pa) over time (s), and dp/dt (Pa/s) over fitted p."""

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
    """Rms deviation of a recording's stretches of settled command, with free start pressures, over the noise."""

    recording: str
    use: str
    ratio_to_noise: float


@dataclass(frozen=True)
class ValveIdentification:
    """All that recordings tell of the paths of one chamber, beside what the model has of them.

    ``map`` and ``inverse`` are what was ``measured`` in a vessel, ``lack_of_fit`` is the model's difference from it;
    else they are the model's as its fit to a driven piston has it. ``iso`` are the model's characteristics.
    ``residuals`` are those of all recordings, held-out ones included. ``max_gradient`` is the largest |dp/dt| (Pa/s) of
    the map where data covered it, ``max_measured_gradient`` the largest that the recordings themselves show. Commands
    are those that went to the valve; ``area_model`` and ``lack_of_fit`` count from the null one.
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
    area_model: AreaModel
    posterior: Posterior
    resampled: tuple[tuple[str, float], ...] = ()  # recordings that were resampled, and the error of p1 in Pa

    @property
    def is_consistent(self) -> bool:
        """Whether the map stays near what the curves themselves show."""
        return self.max_gradient <= MAX_GRADIENT_RATIO * self.max_measured_gradient

    def residual_to_noise(self, use: str) -> float | None:
        """Return the residual over the noise of all recordings of one use, None where there are none."""
        ratios = [one.ratio_to_noise for one in self.residuals if one.use == use]
        return float(np.sqrt(np.mean(np.square(ratios)))) if ratios else None

    @property
    def label(self) -> str:
        """How the names of its parameters begin."""
        return self.area_model.model_gradient.valve.label

    @property
    def volume(self) -> float | None:
        """The volume in m^3 for which the gradients hold, None for a vessel of unknown volume."""
        model = self.area_model.model_gradient.model
        return known_vessel_volume(model)

    def gradient(self, u: Array, p: Array, supply: Array | float | None = None) -> Array:
        """Return dp/dt (Pa/s) at any ``u`` (V), ``p`` and ``supply`` (Pa), broadcast against each other."""
        supply = self.area_model.supply if supply is None else supply
        opening = self.command_conversion.to_opening(u)
        return self.area_model.gradient(
            self.posterior.theta, *np.broadcast_arrays(opening, p, np.asarray(supply, dtype=np.float64))
        )

    def command(self, gradient: Array, p: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return the command (V) for ``gradient`` (Pa/s) at ``p`` (Pa), and whether it is reachable."""
        gradient, p = np.broadcast_arrays(gradient, p)
        opening, reachable = invert_gradient(self.area_model, self.posterior, gradient, p, self.coverage)
        return self.command_conversion.from_opening(opening), reachable


def known_vessel_volume(model: Model) -> float | None:
    """Return the vessel's volume in m^3, stated or identified; None where it is not known."""
    volume = model.values["rig.vessel_volume"]
    return None if model.rig.vessel_volume is None and volume == PLACEHOLDER_VOLUME else volume


def identify_valve(experiments: Sequence[Experiment], found: Fit, chamber: Chamber = 1) -> ValveIdentification:
    """Observe the paths of a ``chamber`` in their valve tests among ``experiments``; a shut valve takes no part.

    ``found`` is the fitted model. The trend is its valve; where other recordings had a say in it, what the same kind
    of model makes of the valve tests alone, so that what it lacks elsewhere does not bend the map. Needs u and p1,
    and p_supply or ``rig.supply_pressure``; fits the recordings of use ``train`` and reports the others. Raises
    InputError where there is no valve test, no command other than zero, or none at which the model's valve opens.
    """
    found = with_null_at_zero(found)
    shown = [as_valve_test(e, chamber) for e in experiments if e.vessel and not e.recording.valve_shut]
    tests = [test for test in shown if test is not None]
    train = [e for e in tests if e.recording.use == "train"]
    if not train:
        raise InputError("recordings", "no valve test to train on", 'experiment = "valve", use = "train"')
    rig, recordings = found.model.rig, [e.recording for e in train]
    modelled = model_gradient_of(found, train)
    alone = all(e.vessel for e in experiments if e.recording.use == "train")
    trend = modelled if alone else model_gradient_of(_fit_valve_tests_only(found, train), train)
    data = _cut_tests(train, trend)
    law = _area_model(trend, data, rig)
    if not law.supply > law.ambient:
        lacking = f"the supply has {law.supply:.4g} Pa, no more than ambient pressure"
        raise InputError("valve tests", lacking, "a supply above it, over which a map goes", "see p_supply")
    sensor = pool_noise([e.noise["p1"] for e in train])
    if not sensor.rms:
        lacking = "p1 has no noise at all: a sensor that is dead, or a computed signal"
        raise InputError("valve tests", lacking, "a recorded p1", 'check its column, or state its noise = "1 mbar"')
    fit, covers = fit_area_model(law, data, sensor), transient_coverage(law, data)
    nodes = [float(d.sign * n) for d in law.directions for n in d.nodes]
    seen = assemble_identification(
        law,
        fit,
        covers,
        command_conversion(experiments[0].rig, chamber),
        curves=_curves(law, fit, data, recordings),
        compute_lack_of_fit=lambda grid: compare_with_map(modelled, law.supply, grid),
        iso=iso_conductances(law, fit, found, covers, nodes) if known_vessel_volume(found.model) else (),
        residuals=_residuals(law, fit, _cut_tests(tests, trend), tests, sensor),
        max_measured_gradient=data.max_slope,
    )
    return replace(
        seen, resampled=tuple((r.name, interpolation_error(r, "p1")) for r in recordings if is_unevenly_sampled(r))
    )


def assemble_identification(
    law: AreaModel,
    fit: Posterior,
    covers: Coverage,
    command: CommandConversion,
    *,
    compute_lack_of_fit: Callable[[GradientMap], LackOfFit],
    iso: tuple[IsoConductance, ...],
    max_measured_gradient: float,
    curves: tuple[Curve, ...] = (),
    residuals: tuple[RecordingResidual, ...] = (),
) -> ValveIdentification:
    """Return a fitted law with its map and inverse over the commands and pressures of the valve."""
    u, p = law.command_grid(GRID_POINTS)[:: int(command.sign)], np.linspace(law.ambient, law.supply, GRID_POINTS)
    grid = gradient_map(law, fit, u, p, covers)
    inverse = inverse_map(law, fit, np.linspace(grid.gradient.min(), grid.gradient.max(), GRID_POINTS), p, covers)
    return ValveIdentification(
        chamber=law.model_gradient.reference_test.recording.chamber,
        command_conversion=command,
        measured=bool(residuals),
        curves=tuple(replace(one, u=float(command.from_opening(np.array(one.u)))) for one in curves),
        map=replace(grid, u=command.from_opening(u)),
        inverse=replace(inverse, u=command.from_opening(inverse.u)),
        lack_of_fit=compute_lack_of_fit(grid),
        iso=iso,
        residuals=residuals,
        max_gradient=float(np.abs(grid.gradient[grid.covered]).max(initial=0.0)),
        max_measured_gradient=max_measured_gradient,
        coverage=covers,
        area_model=law,
        posterior=fit,
    )


def with_null_at_zero(found: Fit) -> Fit:
    """Return the fit of a model whose commands count from the null one."""
    return replace(found, model=replace(found.model, rig=replace(found.model.rig, valve_null=0.0)))


def _fit_valve_tests_only(found: Fit, train: Sequence[Experiment]) -> Fit:
    """Return the model's effects, as far as they show there, and a valve, fitted to the valve tests alone."""
    views = residual_models(train)
    effects = [effect for effect in found.model.effects if any(view.is_sensitive_to(effect) for view in views)]
    return fit_model(guess_base_model(train, found.model.rig, found.model.valve.form), views, effects)


def _cut_tests(tests: Sequence[Experiment], trend: ModelGradient) -> Transients:
    beside = [trend.memory_gradient(test) for test in tests]
    return cut_transients([test.recording for test in tests], trend.model.rig.supply_pressure, beside)


def _area_model(trend: ModelGradient, data: Transients, rig: Rig) -> AreaModel:
    """Return the law with its nodes."""
    directions = tuple(Direction(s, n) for s in (1, -1) if (n := _nodes(data, s)).size)
    if not directions:
        raise InputError("valve recordings", "u is zero throughout", "commands other than zero")
    supply = rig.supply_pressure or float(np.median(data.supply[data.valid]))
    return AreaModel(trend, directions, rig.ambient_pressure, supply, data.max_slope)


def _nodes(data: Transients, sign: int) -> Array:
    """Return the levels |u| of one sign that were held for ``MIN_HELD_TIME`` in all; at least the largest of those tested."""
    u = np.where(data.valid & (np.sign(data.u) == sign), np.abs(data.u), 0.0)
    if not u.any():
        return np.zeros(0)
    quantum = 1e-3 * u.max()
    levels, where = np.unique(np.round(u / quantum), return_inverse=True)
    held = np.bincount(where.ravel(), weights=np.broadcast_to(data.period, u.shape).ravel())
    nodes = quantum * levels[(held >= MIN_HELD_TIME) & (levels > 0)]
    return np.unique(np.append(nodes, u.max() if nodes.size == 0 or nodes[-1] < 0.99 * u.max() else nodes[-1]))


def _curves(law: AreaModel, fit: Posterior, data: Transients, train: Sequence[Recording]) -> tuple[Curve, ...]:
    value, error = gradient_with_error(law, fit, data.u, fit.simulated, data.supply)
    curves = []
    for k in range(data.period.size):
        seen = data.valid[:, k]
        u = float(data.u[0, k])
        if u and np.ptp(data.u[seen, k]) == 0.0:
            low, high = (value[seen, k] + z * error[seen, k] for z in (-Z95, Z95))
            name = train[data.recording[k]].name
            signals = (data.time[seen, k], data.p[seen, k], fit.simulated[seen, k], value[seen, k])
            curves.append(Curve(name, u, *signals, low, high))
    return tuple(curves)


def _residuals(
    law: AreaModel, fit: Posterior, data: Transients, tests: Sequence[Experiment], sensor: NoiseModel
) -> tuple[RecordingResidual, ...]:
    """Return the rms deviation over the noise of each recording's stretches, whose start pressures are fitted."""
    noise = np.array([np.sqrt(averaged_noise_autocovariance(sensor, int(j), 1)[0]) for j in data.averaged_readings])
    start = initial_pressures(data)
    for _ in range(3):
        simulated = simulate_transients(law, fit.theta, start, data)
        error = np.where(data.valid, data.p - simulated, 0.0)
        ahead = np.where(data.valid, initial_pressure_sensitivity(law, fit.theta, simulated, data)[1], 0.0)
        start = start + (ahead * error).sum(axis=0) / ((ahead**2).sum(axis=0) + 1e-12)
    power = np.bincount(data.recording, weights=((error / noise) ** 2).sum(axis=0), minlength=len(tests))
    samples = np.bincount(data.recording, weights=data.valid.sum(axis=0), minlength=len(tests))
    ratio = np.sqrt(power / np.maximum(samples, 1))
    seen = [(e.recording, float(q)) for e, q, n in zip(tests, ratio, samples, strict=True) if n]
    return tuple(RecordingResidual(recording.name, recording.use, q) for recording, q in seen)
