"""The map of a valve that was never tested on a vessel, from the model that was fitted to a driven piston."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pneucli.arrays import Array
from pneucli.distributions import student_t_quantile
from pneucli.errors import InputError
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.guesses.chamber_balance import PRESSURE_SIGNALS, Chamber
from pneucli.identify.guesses.flow_paths import (
    FlowPathData,
    as_valve_test,
    command_conversion,
    flow_path_data,
    valve_driven,
)
from pneucli.identify.valve.area_model import AreaModel, Direction
from pneucli.identify.valve.fit import Posterior
from pneucli.identify.valve.identification import assemble_identification, with_null_at_zero
from pneucli.identify.valve.iso6358 import iso_conductances
from pneucli.identify.valve.lack_of_fit import LackOfFit
from pneucli.identify.valve.maps import sample_coverage
from pneucli.identify.valve.model_gradient import ModelGradient, model_gradient_of
from pneucli.identify.valve.result import ValveIdentification
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model

CELL_COUNTS = (20, 12)  # cells of command and pressure in which measured gradients are averaged
MIN_VISITS = 4  # of a cell, from which the scatter gives an error


def identify_valve_on_piston(experiments: Sequence[Experiment], fitted: Fit, chamber: Chamber) -> ValveIdentification:
    """Derive the map of a chamber's paths from the fitted model; compare it with gradients of the driven piston.

    The map holds for the vessel's volume, or for the chamber with its piston at mid-stroke.

    Args:
        experiments: The experiments; driven ones of use ``train`` are used.
        fitted: The fit of the model.
        chamber: Which chamber.

    Returns:
        The identification; its map is the model's, not a measured one.

    Raises:
        InputError: No recording contains these paths, or no command differs from zero.

    """
    driven = [e for e in valve_driven(experiments) if e.recording.use == "train"]
    tests = [test for e in driven if (test := as_valve_test(e, chamber)) is not None]
    model = fitted.model
    if not tests or not model.valve_of_chamber(chamber).commands:
        raise InputError(
            "recordings", f"no flow into chamber {chamber} by a command", "a driven recording to train on", code="E062"
        )
    volume = model.values.get("rig.vessel_volume") or mid_stroke_volume(model, chamber)
    command, fitted = command_conversion(model.rig, chamber), with_null_at_zero(fitted)
    fitted = replace(fitted, model=fitted.model.with_values({"rig.vessel_volume": volume}))
    model_gradient = model_gradient_of(fitted, tests, with_memory=False)
    u, p, supply = np.concatenate([test.inputs[:, (at.IN_U, at.IN_P1, at.IN_SUPPLY)] for test in tests]).T
    largest = {sign: float(np.max(sign * u)) for sign in (1, -1)}
    directions = tuple(
        Direction(sign, np.array([max_command])) for sign, max_command in largest.items() if max_command > 0.0
    )
    if not directions:
        raise InputError("recordings", "u is zero throughout", "commands other than zero", code="E062")
    ambient, supply_pressure = model.rig.ambient_pressure, model.rig.supply_pressure or float(np.median(supply))
    max_pressure = (
        supply_pressure if supply_pressure > ambient else float(p.max())
    )  # no supply matters where a vessel is only vented
    area_model = AreaModel(model_gradient, directions, ambient, max_pressure, 1.0)
    covariance = np.zeros((area_model.size, area_model.size))
    covariance[: model_gradient.start.size, : model_gradient.start.size] = model_gradient.covariance
    posterior, coverage = (
        Posterior(area_model.initial_theta(), covariance, np.zeros((0, 0))),
        sample_coverage(u, p, area_model),
    )
    chambers = zip(flow_path_data(driven, model.rig, chamber, volume), tests, strict=True)
    gradients = [_measured_and_model_gradient(model_gradient, path, test, volume) for path, test in chambers]
    has_volume = model.rig.has_cylinder or model.rig.vessel_volume
    return assemble_identification(
        area_model,
        posterior,
        coverage,
        command,
        compute_lack_of_fit=lambda _: _lack_of_fit_in_cells(model_gradient, area_model, tests, gradients),
        iso=iso_conductances(area_model, posterior, fitted, coverage, ()) if has_volume else (),
        max_measured_gradient=max(float(np.abs(measured).max()) for measured, _ in gradients),
    )


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


def _measured_and_model_gradient(
    model_gradient: ModelGradient, driven: FlowPathData, test: Experiment, volume: float
) -> tuple[Array, Array]:
    """Compute the measured gradient and the model's, both for one volume."""
    e, kappa = driven.experiment, model_gradient.model.base_values()["rig.polytropic_exponent"]
    u, p, supply = test.inputs[:, (at.IN_U, at.IN_P1, at.IN_SUPPLY)].T
    quasi_static = model_gradient.at_coordinates(model_gradient.start)
    model = quasi_static(u, p, supply)
    rates = [
        (volume * y - kappa * p * driven.volume_rate) / driven.volume
        for y in (model, quasi_static(_previous_command(u), p, supply))
    ]
    modelled_pressure = np.append(0.0, np.cumsum(0.5 * np.diff(e.time) * (rates[0][:-1] + rates[1][1:])))
    name = PRESSURE_SIGNALS[1 if e.vessel else test.recording.chamber][0]
    remaining = e.raw[name] - modelled_pressure
    difference = e.smoothers[name].slope(remaining) if name in e.smoothers else np.gradient(remaining, e.time)
    return model + difference * driven.volume / volume, model


def _previous_command(u: Array) -> Array:
    """Return the command that was held until each sample."""
    return np.append(u[:1], u[:-1])


def _lack_of_fit_in_cells(
    model_gradient: ModelGradient,
    area_model: AreaModel,
    tests: Sequence[Experiment],
    gradients: Sequence[tuple[Array, Array]],
) -> LackOfFit:
    """Compare measured with modelled gradients, averaged over cells of command and pressure."""
    low, *_, high = area_model.command_grid(2)
    edges = [
        np.linspace(low, high, CELL_COUNTS[0] + 1),
        np.linspace(area_model.ambient, area_model.supply, CELL_COUNTS[1] + 1),
    ]
    total = np.zeros(
        (4, CELL_COUNTS[0] * CELL_COUNTS[1])
    )  # samples, visits, sums of what was measured and of the model
    squares = np.zeros((3, total.shape[1]))
    for test, pair in zip(tests, gradients, strict=True):
        u, p = test.inputs[:, (at.IN_U, at.IN_P1)].T
        where = [np.clip(np.searchsorted(edge, y) - 1, 0, edge.size - 2) for edge, y in zip(edges, (u, p), strict=True)]
        cell = where[0] * CELL_COUNTS[1] + where[1]
        visit_starts = np.flatnonzero(np.diff(cell, prepend=-1))
        cells, length = cell[visit_starts], np.diff(np.append(visit_starts, cell.size))
        sums = [np.add.reduceat(y, visit_starts) for y in pair]
        for k, y in enumerate((length, np.ones(length.size), *sums)):
            np.add.at(total[k], cells, y)
        difference = sums[0] - sums[1]
        for k, y in enumerate((difference * difference, difference * length, length * length)):
            np.add.at(squares[k], cells, y)
    return _cell_lack_of_fit(model_gradient, area_model, edges, total, squares)


def _cell_lack_of_fit(
    model_gradient: ModelGradient, area_model: AreaModel, edges: Sequence[Array], total: Array, squares: Array
) -> LackOfFit:
    """Return the lack of fit from sums over samples and visits; its error is a sandwich estimate over visits."""
    samples, visits, measured, modelled = total
    covered, counts = visits >= MIN_VISITS, np.maximum(samples, 1.0)
    mean = (measured - modelled) / counts
    scatter = np.maximum(squares[0] - 2.0 * mean * squares[1] + mean**2 * squares[2], 0.0)
    degrees_of_freedom = np.maximum(visits - 1.0, 1.0)
    error_of_sum = np.sqrt(scatter * visits / degrees_of_freedom)
    half_interval = student_t_quantile(0.975, degrees_of_freedom) * error_of_sum / counts
    u, p = np.meshgrid(*(0.5 * (edge[1:] + edge[:-1]) for edge in edges), indexing="ij")
    error = model_gradient.standard_error(u, p, np.full(u.shape, area_model.supply))
    parts = (y.reshape(CELL_COUNTS) for y in (measured / counts, half_interval, covered, modelled / counts))
    measured, half_interval, covered, modelled = parts
    return LackOfFit(u, p, modelled, error, measured, half_interval, covered)
