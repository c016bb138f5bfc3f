"""The map of a valve that filled no vessel: the model's own, as its fit to a driven piston has it, with that error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

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
from pneucli.identify.valve.identification import ValveIdentification, assemble_identification, with_null_at_zero
from pneucli.identify.valve.iso6358 import iso_conductances
from pneucli.identify.valve.lack_of_fit import LackOfFit
from pneucli.identify.valve.maps import sample_coverage
from pneucli.identify.valve.model_gradient import ModelGradient, model_gradient_of
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model

Array = NDArray[np.float64]

CELL_COUNTS = (20, 12)  # of command and pressure, in which measured gradients are averaged
MIN_VISITS = 4  # of a cell, from which their scatter tells an error


def identify_valve_on_piston(experiments: Sequence[Experiment], found: Fit, chamber: Chamber) -> ValveIdentification:
    """Return the paths of a chamber as the fitted model ``found`` has them from the driven training ``experiments``.

    The map is that of the vessel, or of the chamber with its piston held at mid-stroke where there is none. Raises
    InputError where no recording shows these paths.
    """
    shown = [e for e in valve_driven(experiments) if e.recording.use == "train"]
    tests = [test for e in shown if (test := as_valve_test(e, chamber)) is not None]
    model = found.model
    if not tests or not model.valve_of_chamber(chamber).commands:
        raise InputError("recordings", f"no flow into chamber {chamber} by a command", "a driven recording to train on")
    volume = model.values.get("rig.vessel_volume") or mid_stroke_volume(model, chamber)
    command, found = command_conversion(model.rig, chamber), with_null_at_zero(found)
    found = replace(found, model=found.model.with_values({"rig.vessel_volume": volume}))
    trend = model_gradient_of(found, tests, with_memory=False)
    u, p, supply = np.concatenate([test.inputs[:, (at.IN_U, at.IN_P1, at.IN_SUPPLY)] for test in tests]).T
    tops = {sign: float(np.max(sign * u)) for sign in (1, -1)}
    directions = tuple(Direction(sign, np.array([top])) for sign, top in tops.items() if top > 0.0)
    if not directions:
        raise InputError("recordings", "u is zero throughout", "commands other than zero")
    ambient, stated = model.rig.ambient_pressure, model.rig.supply_pressure or float(np.median(supply))
    highest = stated if stated > ambient else float(p.max())  # no supply takes part where a vessel is only vented
    law = AreaModel(trend, directions, ambient, highest, 1.0)
    covariance = np.zeros((law.size, law.size))
    covariance[: trend.start.size, : trend.start.size] = trend.covariance
    fit, covers = Posterior(law.initial_theta(), covariance, np.zeros((0, 0))), sample_coverage(u, p, law)
    chambers = zip(flow_path_data(shown, model.rig, chamber, volume), tests, strict=True)
    gradients = [measured_and_model_gradient(trend, one, test, volume) for one, test in chambers]
    knows = model.rig.has_cylinder or model.rig.vessel_volume
    return assemble_identification(
        law,
        fit,
        covers,
        command,
        compute_lack_of_fit=lambda _: lack_of_fit_in_cells(trend, law, tests, gradients),
        iso=iso_conductances(law, fit, found, covers, ()) if knows else (),
        max_measured_gradient=max(float(np.abs(measured).max()) for measured, _ in gradients),
    )


def mid_stroke_volume(model: Model, chamber: Chamber) -> float:
    """Return the volume in m^3 of a chamber whose piston stands at mid-stroke."""
    base = model.base_values()
    stroke = model.rig.stroke or 0.0
    return base[f"rig.dead_volume_{chamber}"] + 0.5 * stroke * base[f"rig.piston_area_{chamber}"]


def measured_and_model_gradient(
    trend: ModelGradient, shown: FlowPathData, test: Experiment, volume: float
) -> tuple[Array, Array]:
    """Return the gradient that was measured and the model's, both (n,) in Pa/s for a ``volume`` (m^3).

    The measured pressure less what the model's flows make of it over time is smoothed and derived as any pressure is:
    so smoothing spreads the difference alone, not the gradient, which a moving command changes fast.
    """
    e, kappa = shown.experiment, trend.model.base_values()["rig.polytropic_exponent"]
    u, p, supply = test.inputs[:, (at.IN_U, at.IN_P1, at.IN_SUPPLY)].T
    still = trend.at_coordinates(trend.start)
    model = still(u, p, supply)
    own = [
        (volume * y - kappa * p * shown.volume_rate) / shown.volume
        for y in (model, still(_previous_command(u), p, supply))
    ]
    made = np.append(0.0, np.cumsum(0.5 * np.diff(e.time) * (own[0][:-1] + own[1][1:])))
    name = PRESSURE_SIGNALS[1 if e.vessel else test.recording.chamber][0]
    left = e.raw[name] - made
    off = e.smoothers[name].slope(left) if name in e.smoothers else np.gradient(left, e.time)
    return model + off * shown.volume / volume, model


def _previous_command(u: Array) -> Array:
    """Return the command that stood until each sample."""
    return np.append(u[:1], u[:-1])


def lack_of_fit_in_cells(
    trend: ModelGradient, law: AreaModel, tests: Sequence[Experiment], gradients: Sequence[tuple[Array, Array]]
) -> LackOfFit:
    """Hold the model against measured gradients (Pa/s; measured, model), averaged over cells of command and pressure.

    The model is taken at the samples' own commands, pressures and supply, so that a cell may be large. Each visit to a
    cell counts as one reading of it: within one, errors go together.
    """
    low, *_, high = law.command_grid(2)
    edges = [np.linspace(low, high, CELL_COUNTS[0] + 1), np.linspace(law.ambient, law.supply, CELL_COUNTS[1] + 1)]
    total = np.zeros(
        (4, CELL_COUNTS[0] * CELL_COUNTS[1])
    )  # samples, visits, sums of what was measured and of the model
    squares = np.zeros((3, total.shape[1]))
    for test, pair in zip(tests, gradients, strict=True):
        u, p = test.inputs[:, (at.IN_U, at.IN_P1)].T
        where = [np.clip(np.searchsorted(edge, y) - 1, 0, edge.size - 2) for edge, y in zip(edges, (u, p), strict=True)]
        cell = where[0] * CELL_COUNTS[1] + where[1]
        begins = np.flatnonzero(np.diff(cell, prepend=-1))
        visited, length = cell[begins], np.diff(np.append(begins, cell.size))
        sums = [np.add.reduceat(y, begins) for y in pair]
        for k, y in enumerate((length, np.ones(length.size), *sums)):
            np.add.at(total[k], visited, y)
        off = sums[0] - sums[1]
        for k, y in enumerate((off * off, off * length, length * length)):
            np.add.at(squares[k], visited, y)
    return _cell_lack_of_fit(trend, law, edges, total, squares)


def _cell_lack_of_fit(
    trend: ModelGradient, law: AreaModel, edges: Sequence[Array], total: Array, squares: Array
) -> LackOfFit:
    """Return the lack of fit from sums over samples and over visits; the error is a sandwich over the visits."""
    samples, visits, measured, modelled = total
    seen, many = visits >= MIN_VISITS, np.maximum(samples, 1.0)
    mean = (measured - modelled) / many
    scatter = np.maximum(squares[0] - 2.0 * mean * squares[1] + mean**2 * squares[2], 0.0)
    freedom = np.maximum(visits - 1.0, 1.0)
    spread = student.ppf(0.975, freedom) * np.sqrt(scatter * visits / freedom) / many
    u, p = np.meshgrid(*(0.5 * (edge[1:] + edge[:-1]) for edge in edges), indexing="ij")
    error = trend.standard_error(u, p, np.full(u.shape, law.supply))
    parts = (y.reshape(CELL_COUNTS) for y in (measured / many, spread, seen, modelled / many))
    measured, spread, seen, modelled = parts
    return LackOfFit(u, p, modelled, error, measured, spread, seen)
