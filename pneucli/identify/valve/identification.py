"""Identify a valve from charge and discharge curves of a vessel (thesis 7.4); compare the model's valve with it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from pneucli.arrays import Array
from pneucli.errors import InputError
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.model_fit import fit_model
from pneucli.identify.guesses.base_model import guess_base_model
from pneucli.identify.guesses.chamber_balance import Chamber
from pneucli.identify.guesses.flow_paths import CommandConversion, as_valve_test, command_conversion
from pneucli.identify.residuals import residual_models
from pneucli.identify.valve.area_model import AreaModel, Direction
from pneucli.identify.valve.fit import (
    Posterior,
    averaged_noise_autocovariance,
    fit_area_model,
    initial_pressure_sensitivity,
    initial_pressures,
    simulate_transients,
)
from pneucli.identify.valve.iso6358 import IsoConductance, iso_conductances
from pneucli.identify.valve.lack_of_fit import LackOfFit, compare_with_map
from pneucli.identify.valve.maps import (
    Coverage,
    GradientMap,
    gradient_map,
    gradient_with_error,
    inverse_map,
    transient_coverage,
)
from pneucli.identify.valve.model_gradient import ModelGradient, model_gradient_of
from pneucli.identify.valve.result import Curve, RecordingResidual, ValveIdentification, known_vessel_volume
from pneucli.identify.valve.transients import Transients, cut_transients, interpolation_error, is_unevenly_sampled
from pneucli.messages.formatting import format_quantity
from pneucli.noise import NoiseModel, pool_noise
from pneucli.quantities import Z95
from pneucli.recording import Recording, Rig
from pneucli.simulate.experiment import Experiment

MIN_HELD_TIME = 0.3  # s: a command that is held for less in total gets no correction of its own
GRID_POINTS = 41  # of the map, over command and over pressure


def identify_valve(experiments: Sequence[Experiment], fitted: Fit, chamber: Chamber = 1) -> ValveIdentification:
    """Identify the paths of a chamber from its valve tests.

    The map is the gradient of the fitted model with smooth corrections. Where other recordings took part in that fit, a
    model of the same kind is refitted to the valve tests alone, so that its errors elsewhere do not bend the map.
    Recordings of use ``train`` are fitted, the others only evaluated; a shut valve takes no part.

    Args:
        experiments: The experiments; valve tests need u and p1, and p_supply or ``rig.supply_pressure``.
        fitted: The fit of the model.
        chamber: Which chamber.

    Returns:
        The identification.

    Raises:
        InputError: There is no valve test, no command other than zero, or none at which the model's valve opens.

    References:
        Thesis, section 7.4.

    """
    fitted = with_null_at_zero(fitted)
    valve_tests = [as_valve_test(e, chamber) for e in experiments if e.vessel and not e.recording.valve_shut]
    tests = [test for test in valve_tests if test is not None]
    train = [e for e in tests if e.recording.use == "train"]
    if not train:
        raise InputError("recordings", "no valve test to train on", 'experiment = "valve", use = "train"', code="E061")
    rig, recordings = fitted.model.rig, [e.recording for e in train]
    full_gradient = model_gradient_of(fitted, train)
    has_only_valve_tests = all(e.vessel for e in experiments if e.recording.use == "train")
    model_gradient = (
        full_gradient if has_only_valve_tests else model_gradient_of(_fit_valve_tests_only(fitted, train), train)
    )
    data = _cut_tests(train, model_gradient)
    area_model = _area_model(model_gradient, data, rig)
    if not area_model.supply > area_model.ambient:
        fault = f"the supply has {format_quantity(area_model.supply, 'Pa')}, no more than ambient pressure"
        raise InputError("valve tests", fault, "a supply above it, over which a map goes", "see p_supply", code="E065")
    sensor = pool_noise([e.noise["p1"] for e in train])
    if not sensor.rms:
        fault = "p1 has no noise at all: a sensor that is dead, or a computed signal"
        raise InputError(
            "valve tests", fault, "a recorded p1", 'check its column, or state its noise = "1 mbar"', code="E062"
        )
    posterior, coverage = fit_area_model(area_model, data, sensor), transient_coverage(area_model, data)
    nodes = [float(d.sign * n) for d in area_model.directions for n in d.nodes]
    identification = assemble_identification(
        area_model,
        posterior,
        coverage,
        command_conversion(experiments[0].rig, chamber),
        curves=_curves(area_model, posterior, data, recordings),
        compute_lack_of_fit=lambda grid: compare_with_map(full_gradient, area_model.supply, grid),
        iso=iso_conductances(area_model, posterior, fitted, coverage, nodes)
        if known_vessel_volume(fitted.model)
        else (),
        residuals=_residuals(area_model, posterior, _cut_tests(tests, model_gradient), tests, sensor),
        max_measured_gradient=data.max_slope,
    )
    return replace(
        identification,
        resampled=tuple((r.name, interpolation_error(r, "p1")) for r in recordings if is_unevenly_sampled(r)),
    )


def assemble_identification(
    area_model: AreaModel,
    posterior: Posterior,
    coverage: Coverage,
    command: CommandConversion,
    *,
    compute_lack_of_fit: Callable[[GradientMap], LackOfFit],
    iso: tuple[IsoConductance, ...],
    max_measured_gradient: float,
    curves: tuple[Curve, ...] = (),
    residuals: tuple[RecordingResidual, ...] = (),
) -> ValveIdentification:
    """Evaluate map and inverse of a fitted area model over the commands and pressures of the valve.

    Args:
        area_model: The area model.
        posterior: Its fitted parameters.
        coverage: The region that data cover.
        command: Conversion between command and opening.
        compute_lack_of_fit: Function of the map that compares the model with it.
        iso: The model's characteristics.
        max_measured_gradient: Largest measured |dp/dt| in Pa/s.
        curves: The transients at constant commands.
        residuals: The residuals of the recordings; empty for a map that is the model's own.

    Returns:
        The identification.

    """
    u, p = (
        area_model.command_grid(GRID_POINTS)[:: int(command.sign)],
        np.linspace(area_model.ambient, area_model.supply, GRID_POINTS),
    )
    grid = gradient_map(area_model, posterior, u, p, coverage)
    inverse = inverse_map(
        area_model, posterior, np.linspace(grid.gradient.min(), grid.gradient.max(), GRID_POINTS), p, coverage
    )
    return ValveIdentification(
        chamber=area_model.model_gradient.reference_test.recording.chamber,
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
        coverage=coverage,
        area_model=area_model,
        posterior=posterior,
    )


def with_null_at_zero(fitted: Fit) -> Fit:
    """Return the fit of the same model with commands that count from the null.

    Args:
        fitted: The fit.

    Returns:
        The fit with a null of 0 V.

    """
    return replace(fitted, model=replace(fitted.model, rig=replace(fitted.model.rig, valve_null=0.0)))


def _fit_valve_tests_only(fitted: Fit, train: Sequence[Experiment]) -> Fit:
    """Fit a valve and the model's effects, as far as they are observable there, to the valve tests alone."""
    residual_models_of_tests = residual_models(train)
    effects = [
        effect
        for effect in fitted.model.effects
        if any(one.is_sensitive_to(effect) for one in residual_models_of_tests)
    ]
    return fit_model(
        guess_base_model(train, fitted.model.rig, fitted.model.valve.form), residual_models_of_tests, effects
    )


def _cut_tests(tests: Sequence[Experiment], model_gradient: ModelGradient) -> Transients:
    memory = [model_gradient.memory_gradient(test) for test in tests]
    return cut_transients([test.recording for test in tests], model_gradient.model.rig.supply_pressure, memory)


def _area_model(model_gradient: ModelGradient, data: Transients, rig: Rig) -> AreaModel:
    """Return the area model with a node for each command that was held."""
    directions = tuple(Direction(s, n) for s in (1, -1) if (n := _nodes(data, s)).size)
    if not directions:
        raise InputError("valve recordings", "u is zero throughout", "commands other than zero", code="E062")
    supply = rig.supply_pressure or float(np.median(data.supply[data.valid]))
    return AreaModel(model_gradient, directions, rig.ambient_pressure, supply, data.max_slope)


def _nodes(data: Transients, sign: int) -> Array:
    """Return the levels |u| of one sign that were held for ``MIN_HELD_TIME`` in total, or else the largest level."""
    u = np.where(data.valid & (np.sign(data.u) == sign), np.abs(data.u), 0.0)
    if not u.any():
        return np.zeros(0)
    quantum = 1e-3 * u.max()
    levels, level_index = np.unique(np.round(u / quantum), return_inverse=True)
    held_time = np.bincount(level_index.ravel(), weights=np.broadcast_to(data.period, u.shape).ravel())
    nodes = quantum * levels[(held_time >= MIN_HELD_TIME) & (levels > 0)]
    return np.unique(np.append(nodes, u.max() if nodes.size == 0 or nodes[-1] < 0.99 * u.max() else nodes[-1]))


def _curves(
    area_model: AreaModel, posterior: Posterior, data: Transients, train: Sequence[Recording]
) -> tuple[Curve, ...]:
    value, error = gradient_with_error(area_model, posterior, data.u, posterior.simulated, data.supply)
    curves = []
    for k in range(data.period.size):
        valid = data.valid[:, k]
        u = float(data.u[0, k])
        if u and np.ptp(data.u[valid, k]) == 0.0:
            low, high = (value[valid, k] + z * error[valid, k] for z in (-Z95, Z95))
            name = train[data.recording[k]].name
            signals = (data.time[valid, k], data.p[valid, k], posterior.simulated[valid, k], value[valid, k])
            curves.append(Curve(name, u, *signals, low, high))
    return tuple(curves)


def _residuals(
    area_model: AreaModel, posterior: Posterior, data: Transients, tests: Sequence[Experiment], sensor: NoiseModel
) -> tuple[RecordingResidual, ...]:
    """Return the rms residual over the noise of each recording's transients, with fitted initial pressures."""
    noise = np.array([np.sqrt(averaged_noise_autocovariance(sensor, int(j), 1)[0]) for j in data.averaged_readings])
    start = initial_pressures(data)
    for _ in range(3):
        simulated = simulate_transients(area_model, posterior.theta, start, data)
        error = np.where(data.valid, data.p - simulated, 0.0)
        sensitivity = np.where(
            data.valid, initial_pressure_sensitivity(area_model, posterior.theta, simulated, data)[1], 0.0
        )
        start = start + (sensitivity * error).sum(axis=0) / ((sensitivity**2).sum(axis=0) + 1e-12)
    power = np.bincount(data.recording, weights=((error / noise) ** 2).sum(axis=0), minlength=len(tests))
    samples = np.bincount(data.recording, weights=data.valid.sum(axis=0), minlength=len(tests))
    ratio = np.sqrt(power / np.maximum(samples, 1))
    rows = [(e.recording, float(r)) for e, r, n in zip(tests, ratio, samples, strict=True) if n]
    return tuple(RecordingResidual(recording.name, recording.use, r) for recording, r in rows)
