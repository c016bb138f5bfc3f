"""Identify a valve from charge and discharge curves of a vessel (thesis 7.4)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pneucli.errors import InputError
from pneucli.identify.valve.fit import Fit, fit_law, sensitivities, simulate
from pneucli.identify.valve.iso import IsoConductance, iso_conductance
from pneucli.identify.valve.law import LEAK, Direction, Law
from pneucli.identify.valve.maps import (
    Z95,
    GradientMap,
    InverseMap,
    commands_for,
    gradient_map,
    gradient_with_error,
    inverse_map,
)
from pneucli.identify.valve.stretches import Stretches, cut
from pneucli.noise import estimate, pool
from pneucli.recording import Recording, Rig

Array = NDArray[np.float64]

HELD = 0.3  # s for which a command must be held in all to have a correction of its own
GRID = 41


@dataclass(frozen=True)
class Value:
    """A number with its 95 % interval."""

    value: float
    ci_low: float
    ci_high: float


@dataclass(frozen=True)
class CommandArea:
    """Effective area (alpha A_v of thesis 2.46) at a command: m^2, or 1/m where the volume is unknown."""

    u: float
    area: Value


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
class ValveIdentification:
    """All that charge and discharge tell of a valve.

    ``overlap`` is keyed "charge", "discharge" (V), ``exponent`` likewise; ``volume`` is None where the rig gives none:
    areas are then areas per volume (1/m) and ``iso`` is empty. ``residual_rms`` (Pa) per recording, test ones
    included, over stretches of settled command with a free start pressure; ``noise_rms`` the residuals' rms over the
    training recordings. ``leak`` is dp/dt (Pa/s) over ``map.p`` that flows at every command.
    """

    commands: tuple[CommandArea, ...]
    overlap: Mapping[str, Value]
    exponent: Mapping[str, Value]
    curves: tuple[Curve, ...]
    map: GradientMap
    inverse: InverseMap
    leak: Array
    iso: tuple[IsoConductance, ...]
    volume: float | None
    residual_rms: Mapping[str, float]
    noise_rms: float
    law: Law
    fit: Fit

    def area_function(self, u: Array) -> Array:
        """Return the effective area (m^2; 1/m without a volume) at commands ``u`` (V): its mean over pressure ratios.

        Positive for both signs; the flow is from the supply for u > 0 and to ambient for u < 0.
        """
        return _mean_area(self.law, self.fit.theta, np.asarray(u, dtype=np.float64))

    def gradient(self, u: Array, p: Array, supply: Array | float | None = None) -> Array:
        """Return dp/dt (Pa/s) at any ``u`` (V), ``p`` and ``supply`` (Pa), broadcast against each other."""
        supply = self.law.supply if supply is None else supply
        return self.law.gradient(self.fit.theta, *np.broadcast_arrays(u, p, np.asarray(supply, dtype=np.float64)))

    def command(self, gradient: Array, p: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return the command (V) for ``gradient`` (Pa/s) at ``p`` (Pa), and whether it is reachable."""
        return commands_for(self.law, self.fit.theta, *np.broadcast_arrays(gradient, p))

    def scale_to_volume(self, volume: float) -> ValveIdentification:
        """Return the identification for a chamber of ``volume`` (m^3): gradients go with 1 / V (thesis 2.22).

        Valid where the gas exchanges heat as it did in the tested vessel. Raises InputError without a vessel volume.
        """
        if self.volume is None:
            raise InputError("rig.vessel", "no volume", "the volume of the tested vessel", "set rig.vessel.volume")
        factor = self.volume / volume
        law = replace(self.law, gain=self.law.gain * factor, scale=self.law.scale * factor)
        scaled_map, inverse = self.map.scaled(factor), self.inverse.scaled(factor)
        return replace(self, law=law, map=scaled_map, inverse=inverse, leak=self.leak * factor, volume=volume)


def identify_valve(recordings: Sequence[Recording], rig: Rig) -> ValveIdentification:
    """Identify the valve from the valve tests among ``recordings``; recordings with the valve shut take no part.

    Needs u and p1, and p_supply or ``rig.supply_pressure``; fits the recordings of use ``train`` and reports the
    others. Raises InputError where there is no valve test or no command other than zero.
    """
    tests = [r for r in recordings if r.kind.vessel and not r.valve_shut]
    train = [r for r in tests if r.use == "train"]
    if not train:
        raise InputError("recordings", "no valve test to train on", 'experiment = "valve", use = "train"')
    data = cut(train, rig.supply_pressure)
    law, guess = _start(data, rig)
    sensor = pool([r.noise.get("p1") or estimate(r.time, r["p1"]) for r in train])
    if not sensor.rms:
        found = "p1 has no noise at all: a sensor that is dead, or a computed signal"
        raise InputError("valve tests", found, "a recorded p1", 'check its column, or state its noise = "1 mbar"')
    fit = fit_law(law, data, guess, sensor)
    top = {d.sign: float(d.nodes[-1]) for d in law.directions}
    u = np.linspace(-top.get(-1, 0.0), top.get(1, 0.0), GRID)
    p = np.linspace(rig.ambient_pressure, law.supply, GRID)
    gradients = gradient_map(law, fit, u, p, _covered(data, u, p))
    asked = np.linspace(gradients.gradient.min(), gradients.gradient.max(), GRID)
    residuals = np.where(data.valid, fit.simulated - data.p, 0.0)
    return ValveIdentification(
        commands=tuple(_area(law, fit, float(d.sign * n)) for d in law.directions for n in d.nodes),
        overlap={_NAMES[d.sign]: _value(fit, o + 1, 0.0) for o, d in zip(law.offsets(), law.directions, strict=True)},
        exponent={_NAMES[d.sign]: _value(fit, o + 2, 0.0) for o, d in zip(law.offsets(), law.directions, strict=True)},
        curves=_curves(law, fit, data, train),
        map=gradients,
        inverse=inverse_map(law, fit.theta, asked, p),
        leak=law.leak(fit.theta, p),
        iso=iso_conductance(law, fit, data, rig) if rig.vessel_volume else (),
        volume=rig.vessel_volume,
        residual_rms=_residual_rms(law, fit, cut(tests, rig.supply_pressure), tests),
        noise_rms=float(np.sqrt(np.sum(residuals**2) / data.valid.sum())),
        law=law,
        fit=fit,
    )


_NAMES = {1: "charge", -1: "discharge"}


def _start(data: Stretches, rig: Rig) -> tuple[Law, Array]:
    """Return the law with its nodes and the first guess of its parameters."""
    directions = tuple(Direction(s, n) for s in (1, -1) if (n := _nodes(data, s)).size)
    if not directions:
        raise InputError("valve recordings", "u is zero throughout", "commands other than zero")
    gas = rig.heat_capacity_ratio * np.sqrt(2 * rig.gas_constant * rig.gas_temperature)
    supply = rig.supply_pressure or float(np.median(data.supply[data.valid]))
    law = Law(directions, float(gas / (rig.vessel_volume or 1.0)), rig.ambient_pressure, supply, supply)
    guess = np.zeros(law.size)
    for o, d in zip(law.offsets(), law.directions, strict=True):
        guess[o + 1 : o + 3] = 0.01 * d.nodes[-1], 1.0
    unit = law.gradient(guess, data.u, data.p, data.supply)
    for o, d in zip(law.offsets(), law.directions, strict=True):
        mine = (np.sign(data.u) == d.sign) & (np.abs(data.u) > 0.3 * d.nodes[-1]) & data.valid
        rise = np.where(mine[1:], np.diff(data.p, axis=0), 0.0).sum()
        expected = np.where(mine[1:], unit[1:] * data.period, 0.0).sum()
        guess[o] = np.log(max(rise / expected, 1e-12))
    largest = float(np.max(np.abs(law.gradient(guess, data.u, data.p, data.supply)[data.valid])))
    return replace(law, scale=largest), guess


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


def _value(fit: Fit, index: int, lowest: float) -> Value:
    value, error = float(fit.theta[index]), Z95 * float(np.sqrt(fit.covariance[index, index]))
    return Value(value, max(lowest, value - error), value + error)


def _mean_area(law: Law, theta: Array, u: Array) -> Array:
    log_area, shape = law.factors(theta, u)
    r = np.linspace(-1, 1, 21).reshape(-1, *[1] * u.ndim)
    correction = sum(c * r**k for k, c in enumerate(shape))
    return np.asarray(np.exp(log_area) * np.exp(correction).mean(axis=0))


def _area(law: Law, fit: Fit, u: float) -> CommandArea:
    at, step = np.array([u]), 1e-6
    area = float(_mean_area(law, fit.theta, at)[0])
    shifts = step * np.eye(law.size)[: law.size - LEAK]
    slopes = np.array([(np.log(_mean_area(law, fit.theta + s, at)[0] / area)) / step for s in shifts])
    slopes = np.append(slopes, np.zeros(LEAK))
    spread = float(np.exp(Z95 * np.sqrt(slopes @ fit.covariance @ slopes)))
    return CommandArea(u, Value(area, area / spread, area * spread))


def _curves(law: Law, fit: Fit, data: Stretches, train: Sequence[Recording]) -> tuple[Curve, ...]:
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


def _covered(data: Stretches, u: Array, p: Array) -> NDArray[np.bool_]:
    """Return whether a command of the same sign within 10 % of the range, or both neighbours, saw that pressure."""
    covered = np.zeros((u.size, p.size), dtype=bool)
    levels = np.unique(data.u[data.valid])
    spans = [(c, data.p[data.valid & (data.u == c)]) for c in levels[:: max(1, levels.size // 200)]]
    saw = np.array([[s.min() <= q <= s.max() for q in p] for _, s in spans])
    at = np.array([c for c, _ in spans])
    for i, command in enumerate(u):
        near = (np.abs(at - command) <= 0.1 * np.abs(u).max()) & (np.sign(at) == np.sign(command))
        below, above = (saw[(np.sign(at) == np.sign(command)) & s].any(axis=0) for s in (at <= command, at >= command))
        covered[i] = saw[near].any(axis=0) | (below & above)
    return covered


def _residual_rms(law: Law, fit: Fit, data: Stretches, recordings: Sequence[Recording]) -> dict[str, float]:
    """Return the rms deviation (Pa) over each recording's stretches, whose start pressures are fitted."""
    start = np.nanmean(data.p[:10], axis=0)
    for _ in range(2):
        simulated = simulate(law, fit.theta, start, data)
        error = np.where(data.valid, data.p - simulated, 0.0)
        ahead = np.where(data.valid, sensitivities(law, fit.theta, simulated, data)[1], 0.0)
        start = start + (ahead * error).sum(axis=0) / (ahead**2).sum(axis=0)
    error = np.where(data.valid, data.p - simulate(law, fit.theta, start, data), 0.0)
    power = np.bincount(data.recording, weights=(error**2).sum(axis=0), minlength=len(recordings))
    samples = np.bincount(data.recording, weights=data.valid.sum(axis=0), minlength=len(recordings))
    return {r.name: float(np.sqrt(power[k] / samples[k])) for k, r in enumerate(recordings) if samples[k]}
