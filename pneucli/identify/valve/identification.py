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
from pneucli.identify.guesses.flow_paths import Command, command_of, on_a_vessel
from pneucli.identify.guesses.friction_and_valve import STAND_IN_VOLUME, first_guess
from pneucli.identify.residuals import views_of
from pneucli.identify.valve.area_model import Direction, Law
from pneucli.identify.valve.fit import (
    Posterior,
    averaged_noise,
    first_pressures,
    fit_law,
    simulate,
    start_sensitivity,
)
from pneucli.identify.valve.iso6358 import IsoConductance, iso_conductance
from pneucli.identify.valve.lack_of_fit import LackOfFit, lack_of_fit
from pneucli.identify.valve.maps import (
    Z95,
    Coverage,
    GradientMap,
    InverseMap,
    commands_for,
    coverage,
    gradient_map,
    gradient_with_error,
    inverse_map,
)
from pneucli.identify.valve.model_gradient import Trend, trend_of
from pneucli.identify.valve.resampling import error_of, is_uneven
from pneucli.identify.valve.transients import Stretches, cut
from pneucli.noise import NoiseModel, pool
from pneucli.recording import Recording, Rig
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model

Array = NDArray[np.float64]

HELD = 0.3  # s for which a command must be held in all to have a correction of its own
GRID = 41
STEEPEST = 3.0  # times the steepest that the curves show: more is not of this valve


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
class Residual:
    """Rms deviation of a recording's stretches of settled command, with free start pressures, over the noise."""

    recording: str
    use: str
    ratio_to_noise: float


@dataclass(frozen=True)
class ValveIdentification:
    """All that recordings tell of the paths of one chamber, beside what the model has of them.

    ``map`` and ``inverse`` are what was ``measured`` in a vessel, ``lack`` is the model's difference from it; else they
    are the model's as its fit to a driven piston has it. ``iso`` are the model's characteristics. ``residuals`` are
    those of all recordings, held-out ones included. ``steepest`` is the largest
    |dp/dt| (Pa/s) of the map where data covered it, ``shown`` the largest that the recordings themselves show.
    Commands are those that went to the valve; ``law`` and ``lack`` count from the null one.
    """

    chamber: Chamber
    command_of: Command
    measured: bool
    curves: tuple[Curve, ...]
    map: GradientMap
    inverse: InverseMap
    lack: LackOfFit
    iso: tuple[IsoConductance, ...]
    residuals: tuple[Residual, ...]
    steepest: float
    shown: float
    covers: Coverage
    law: Law
    fit: Posterior
    uneven: tuple[tuple[str, float], ...] = ()  # recordings that were resampled, and the error of p1 in Pa

    @property
    def described(self) -> bool:
        """Whether the map stays near what the curves themselves show."""
        return self.steepest <= STEEPEST * self.shown

    def over_noise(self, use: str) -> float | None:
        """Return the residual over the noise of all recordings of one use, None where there are none."""
        ratios = [one.ratio_to_noise for one in self.residuals if one.use == use]
        return float(np.sqrt(np.mean(np.square(ratios)))) if ratios else None

    @property
    def label(self) -> str:
        """How the names of its parameters begin."""
        return self.law.trend.valve.label

    @property
    def volume(self) -> float | None:
        """The volume in m^3 for which the gradients hold, None for a vessel of unknown volume."""
        model = self.law.trend.model
        return volume_of(model)

    def gradient(self, u: Array, p: Array, supply: Array | float | None = None) -> Array:
        """Return dp/dt (Pa/s) at any ``u`` (V), ``p`` and ``supply`` (Pa), broadcast against each other."""
        supply = self.law.supply if supply is None else supply
        opening = self.command_of.opening(u)
        return self.law.gradient(self.fit.theta, *np.broadcast_arrays(opening, p, np.asarray(supply, dtype=np.float64)))

    def command(self, gradient: Array, p: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return the command (V) for ``gradient`` (Pa/s) at ``p`` (Pa), and whether it is reachable."""
        gradient, p = np.broadcast_arrays(gradient, p)
        opening, reachable = commands_for(self.law, self.fit, gradient, p, self.covers)
        return self.command_of.of(opening), reachable


def volume_of(model: Model) -> float | None:
    """Return the vessel's volume in m^3, stated or identified; None where it is not known."""
    volume = model.values["rig.vessel_volume"]
    return None if model.rig.vessel_volume is None and volume == STAND_IN_VOLUME else volume


def identify_valve(experiments: Sequence[Experiment], found: Fit, chamber: Chamber = 1) -> ValveIdentification:
    """Observe the paths of a ``chamber`` in their valve tests among ``experiments``; a shut valve takes no part.

    ``found`` is the fitted model. The trend is its valve; where other recordings had a say in it, what the same kind
    of model makes of the valve tests alone, so that what it lacks elsewhere does not bend the map. Needs u and p1,
    and p_supply or ``rig.supply_pressure``; fits the recordings of use ``train`` and reports the others. Raises
    InputError where there is no valve test, no command other than zero, or none at which the model's valve opens.
    """
    found = from_null(found)
    shown = [on_a_vessel(e, chamber) for e in experiments if e.vessel and not e.recording.valve_shut]
    tests = [test for test in shown if test is not None]
    train = [e for e in tests if e.recording.use == "train"]
    if not train:
        raise InputError("recordings", "no valve test to train on", 'experiment = "valve", use = "train"')
    rig, recordings = found.model.rig, [e.recording for e in train]
    modelled = trend_of(found, train)
    alone = all(e.vessel for e in experiments if e.recording.use == "train")
    trend = modelled if alone else trend_of(_of_tests_alone(found, train), train)
    data = _cut(train, trend)
    law = _law(trend, data, rig)
    if not law.supply > law.ambient:
        lacking = f"the supply has {law.supply:.4g} Pa, no more than ambient pressure"
        raise InputError("valve tests", lacking, "a supply above it, over which a map goes", "see p_supply")
    sensor = pool([e.noise["p1"] for e in train])
    if not sensor.rms:
        lacking = "p1 has no noise at all: a sensor that is dead, or a computed signal"
        raise InputError("valve tests", lacking, "a recorded p1", 'check its column, or state its noise = "1 mbar"')
    fit, covers = fit_law(law, data, sensor), coverage(law, data)
    nodes = [float(d.sign * n) for d in law.directions for n in d.nodes]
    seen = identified(
        law,
        fit,
        covers,
        command_of(experiments[0].rig, chamber),
        curves=_curves(law, fit, data, recordings),
        lack=lambda grid: lack_of_fit(modelled, law.supply, grid),
        iso=iso_conductance(law, fit, found, covers, nodes) if volume_of(found.model) else (),
        residuals=_residuals(law, fit, _cut(tests, trend), tests, sensor),
        shown=data.steepest,
    )
    return replace(seen, uneven=tuple((r.name, error_of(r, "p1")) for r in recordings if is_uneven(r)))


def identified(
    law: Law,
    fit: Posterior,
    covers: Coverage,
    command: Command,
    *,
    lack: Callable[[GradientMap], LackOfFit],
    iso: tuple[IsoConductance, ...],
    shown: float,
    curves: tuple[Curve, ...] = (),
    residuals: tuple[Residual, ...] = (),
) -> ValveIdentification:
    """Return a fitted law with its map and inverse over the commands and pressures of the valve."""
    u, p = law.commands(GRID)[:: int(command.sign)], np.linspace(law.ambient, law.supply, GRID)
    grid = gradient_map(law, fit, u, p, covers)
    inverse = inverse_map(law, fit, np.linspace(grid.gradient.min(), grid.gradient.max(), GRID), p, covers)
    return ValveIdentification(
        chamber=law.trend.bench.recording.chamber,
        command_of=command,
        measured=bool(residuals),
        curves=tuple(replace(one, u=float(command.of(np.array(one.u)))) for one in curves),
        map=replace(grid, u=command.of(u)),
        inverse=replace(inverse, u=command.of(inverse.u)),
        lack=lack(grid),
        iso=iso,
        residuals=residuals,
        steepest=float(np.abs(grid.gradient[grid.covered]).max(initial=0.0)),
        shown=shown,
        covers=covers,
        law=law,
        fit=fit,
    )


def from_null(found: Fit) -> Fit:
    """Return the fit of a model whose commands count from the null one."""
    return replace(found, model=replace(found.model, rig=replace(found.model.rig, valve_null=0.0)))


def _of_tests_alone(found: Fit, train: Sequence[Experiment]) -> Fit:
    """Return the model's effects, as far as they show there, and a valve, fitted to the valve tests alone."""
    views = views_of(train)
    effects = [effect for effect in found.model.effects if any(view.feels(effect) for view in views)]
    return fit_model(first_guess(train, found.model.rig, found.model.valve.form), views, effects)


def _cut(tests: Sequence[Experiment], trend: Trend) -> Stretches:
    beside = [trend.beside(test) for test in tests]
    return cut([test.recording for test in tests], trend.model.rig.supply_pressure, beside)


def _law(trend: Trend, data: Stretches, rig: Rig) -> Law:
    """Return the law with its nodes."""
    directions = tuple(Direction(s, n) for s in (1, -1) if (n := _nodes(data, s)).size)
    if not directions:
        raise InputError("valve recordings", "u is zero throughout", "commands other than zero")
    supply = rig.supply_pressure or float(np.median(data.supply[data.valid]))
    return Law(trend, directions, rig.ambient_pressure, supply, data.steepest)


def _nodes(data: Stretches, sign: int) -> Array:
    """Return the levels |u| of one sign that were held for ``HELD`` in all; at least the largest of those tested."""
    u = np.where(data.valid & (np.sign(data.u) == sign), np.abs(data.u), 0.0)
    if not u.any():
        return np.zeros(0)
    quantum = 1e-3 * u.max()
    levels, where = np.unique(np.round(u / quantum), return_inverse=True)
    held = np.bincount(where.ravel(), weights=np.broadcast_to(data.period, u.shape).ravel())
    nodes = quantum * levels[(held >= HELD) & (levels > 0)]
    return np.unique(np.append(nodes, u.max() if nodes.size == 0 or nodes[-1] < 0.99 * u.max() else nodes[-1]))


def _curves(law: Law, fit: Posterior, data: Stretches, train: Sequence[Recording]) -> tuple[Curve, ...]:
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
    law: Law, fit: Posterior, data: Stretches, tests: Sequence[Experiment], sensor: NoiseModel
) -> tuple[Residual, ...]:
    """Return the rms deviation over the noise of each recording's stretches, whose start pressures are fitted."""
    noise = np.array([np.sqrt(averaged_noise(sensor, int(j), 1)[0]) for j in data.joined])
    start = first_pressures(data)
    for _ in range(3):
        simulated = simulate(law, fit.theta, start, data)
        error = np.where(data.valid, data.p - simulated, 0.0)
        ahead = np.where(data.valid, start_sensitivity(law, fit.theta, simulated, data)[1], 0.0)
        start = start + (ahead * error).sum(axis=0) / ((ahead**2).sum(axis=0) + 1e-12)
    power = np.bincount(data.recording, weights=((error / noise) ** 2).sum(axis=0), minlength=len(tests))
    samples = np.bincount(data.recording, weights=data.valid.sum(axis=0), minlength=len(tests))
    ratio = np.sqrt(power / np.maximum(samples, 1))
    seen = [(e.recording, float(q)) for e, q, n in zip(tests, ratio, samples, strict=True) if n]
    return tuple(Residual(recording.name, recording.use, q) for recording, q in seen)
