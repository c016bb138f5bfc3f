"""What a recording says of a part of the rig: residuals of one subsystem at a time, the rest fed with measurements.

``chambers``: the pressures are simulated with the measured motion, so friction has no say. ``forces``: the measured
motion and pressures leave a friction force, which is held against the model's set of possible ones, so the gas has no
say. ``imposed``: the force that the model needs for the given motion against the measured one. ``whole``: all channels
simulated, where a subsystem lacks a signal. Each view is smooth in its parameters, which a free run with stick and
slip is not.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.restarts import carried, start_errors, volume, whitened
from pneucli.identify.rests import RESTED, STARTED, breakaways, unsure
from pneucli.physics.declaration import Effect
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import U_MAX, Experiment, smooth_motion
from pneucli.simulate.model import Model
from pneucli.simulate.outputs import outputs
from pneucli.simulate.run import base_vector, kernel_for, simulate
from pneucli.simulate.valve_area import POINTS

Array = NDArray[np.float64]
Kind = Literal["chambers", "forces", "imposed", "whole"]

FAR = 1e9  # times the noise: more than any model errs that does not run away
# ports by the view in which they show; sensors of pressure show in both
MECHANICAL = {"dry_rise", "slowing", "dry_factor", "static_factor", "viscous_factor", "force", "mass"} | {
    "bristle_stiffness",
    "bristle_damping",
    "read_a",
}
SENSING = {"read_p1", "read_p2", "unread_p1", "unread_p2", "sensor_lag", "sensor_delay"}


@dataclass(frozen=True)
class View:
    """One experiment seen through one subsystem.

    ``whitened`` chambers are so for the errors of their starts: right for costs that are compared. Where the model is
    wrong, the sum of squares itself is the better guide, since it is the error that the user sees.
    """

    experiment: Experiment
    kind: Kind
    whitened: bool = False

    @property
    def name(self) -> str:
        """Recording and view, for people."""
        return f"{self.experiment.recording.name}: {self.kind}"

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """The channels whose residuals the view holds; one without any noise has no measure for them."""
        e = self.experiment
        if self.kind == "forces":
            return ("force", "a") if "a" in e.raw and e.noise["a"].rms else ("force",)
        chosen = ("p1", "p2", "temperature") if self.kind == "chambers" else e.channels
        return tuple(c for c in e.channels if c in chosen and (c not in e.noise or e.noise[c].rms))

    def feels(self, effect: Effect) -> bool:
        """Whether the effect can show in this view."""
        if effect.name not in self.experiment.active((effect,)):
            return False
        mechanical = bool(MECHANICAL & effect.ports.keys())
        sensing = bool(SENSING & effect.ports.keys())
        if self.kind == "chambers":
            return sensing or not mechanical
        if self.kind == "forces":
            return sensing or mechanical
        return True

    def residual(self, model: Model, errors: Mapping[str, Array] | None = None) -> dict[str, Array]:
        """Return measured minus model by channel, each (n,), SI; 0 where nothing was measured.

        ``errors`` of the starts are what :meth:`carried` gives, by default for this very model.
        """
        e = self.experiment
        if self.kind == "forces":
            return self.balance(model, e.inputs)
        modelled = simulate(model, e) if self.kind == "chambers" else outputs(model, e)
        residual = {c: _difference(self._measured[c], modelled[c], self.noise[c]) for c in self.channels}
        return self.settled(residual, self.carried(model) if errors is None else errors)

    def carried(self, model: Model) -> dict[str, Array]:
        """Return what errors of the chambers' starts become, in units of noise (:mod:`pneucli.identify.restarts`)."""
        if self.kind != "chambers" or not self.whitened:
            return {}
        return carried(model, self.experiment, self._start_errors)

    def settled(self, residual: Mapping[str, Array], errors: Mapping[str, Array]) -> dict[str, Array]:
        """Return residuals whitened for such errors."""
        starts = self.experiment.restarts
        return {c: whitened(r, errors[c], starts) if c in errors else r for c, r in residual.items()}

    def volume(self, errors: Mapping[str, Array]) -> Array:
        """Return what a likelihood adds to the squares of the residuals for such errors, channel after channel (N,)."""
        starts, none = self.experiment.restarts, np.zeros(self.experiment.time.size)
        return np.concatenate([volume(errors[c], starts) if c in errors else none for c in self.channels])

    @cached_property
    def _start_errors(self) -> dict[str, tuple[float, float]]:
        return start_errors(self.experiment)

    @cached_property
    def noise(self) -> dict[str, float]:
        """The standard deviation of each channel that the sensors alone would give."""
        e = self.experiment
        if self.kind == "forces":
            share = {"p1": e.rig.areas[0], "p2": e.rig.areas[1], "a": e.rig.moving_mass or 1.0, "force": 1.0}
            parts = [share[n] * e.noise[n].rms for n in share if n in e.noise]
            force = max(float(np.sqrt(np.sum(np.square(parts)))), 1e-6)
            return {"force": force} | {c: e.noise[c].rms for c in ("a",) if c in e.noise}
        return {c: e.noise[c].rms for c in self.channels if c in e.noise}

    @cached_property
    def openings(self) -> slice:
        """The part of the valve's table that its opening may pass through, from rest to the largest commands."""
        u = self.experiment.inputs[:, at.IN_U]
        place = (np.array([min(u.min(), 0.0), max(u.max(), 0.0)]) / U_MAX + 1.0) * 0.5 * (POINTS - 1)
        return slice(max(int(place[0]), 0), int(place[1]) + 2)

    @cached_property
    def _measured(self) -> dict[str, Array]:
        return {c: self.experiment.measured(c) for c in self.channels}

    @cached_property
    def _turns(self) -> tuple[Array, NDArray[np.bool_]]:
        """Velocities at which the piston breaks away (n,), and where the direction of motion is not known (n,)."""
        e = self.experiment
        smoothed = smooth_motion(e.raw, e.smoothers, e.fusion, e.time)[1]
        smeared = max(round(e.smear / e.recording.period), 1)
        leaving = breakaways(e.inputs[:, at.IN_V], smoothed, STARTED * e.still, round(RESTED * smeared))
        return leaving, unsure(e.inputs[:, at.IN_V], leaving, smeared)

    @cached_property
    def _loads(self) -> tuple[Array, Array]:
        return self.loads(self.experiment.raw, self.experiment.inputs)

    def loads(self, raw: Mapping[str, Array], inputs: Array) -> tuple[Array, Array]:
        """Return the acceleration (n,) and the force (n,) of what smoothing took out of the pressures.

        Both are linear in the readings ``raw`` and their smoothed ``inputs`` (n, 10). The accelerometer's reading is
        taken as it is: it jumps where the piston breaks away and stops, which smoothing would spread.
        """
        (area_1, area_2), rough = self.experiment.rig.areas, np.zeros(self.experiment.time.size)
        for name, column, share in (("p1", at.IN_P1, area_1), ("p2", at.IN_P2, -area_2)):
            if name in raw:
                rough += share * (raw[name] - inputs[:, column])
        a = raw["a"] if "a" in raw else np.gradient(inputs[:, at.IN_V], self.experiment.time)
        return a, rough

    @cached_property
    def _left_noise(self) -> Array:
        """The noise that smoothing leaves in the force of the pressures, and its rate: (N, N/s)."""
        e = self.experiment
        parts = [share * e.noise[n].rms for n, share in zip(("p1", "p2"), e.rig.areas, strict=True) if n in e.noise]
        taken = float(np.mean(self._loads[1] ** 2))
        drawn, force = e.draw_noise(np.random.default_rng(0)), np.zeros(e.time.size)
        for name, share in (("p1", e.rig.areas[0]), ("p2", -e.rig.areas[1])):
            if name in drawn:
                force += share * (e.smoothers[name](drawn[name]) if name in e.smoothers else drawn[name])
        left = max(float(np.sum(np.square(parts))) - taken, 0.0)
        return np.array([np.sqrt(left), np.std(np.gradient(force, e.time))])

    def balance(
        self, model: Model, inputs: Array, loads: tuple[Array, Array] | None = None, noise: Array | None = None
    ) -> dict[str, Array]:
        """Return the force left over in N, and the accelerometer's reading in m/s^2 where the piston rests; with
        ``gap`` (n,), the chance that the model states no force but bounds, between two branches of friction.

        ``inputs`` (n, 10) and ``loads`` are the experiment's own, or of other readings of the same run; ``noise``
        (N, N/s) is that of the force of the pressures and of its rate, by default as smoothing leaves it.
        """
        e, kernel = self.experiment, kernel_for(model.effects)
        (a, rough), (leaving, doubtful) = loads or self._loads, self._turns
        out, gap = np.zeros(e.time.size), np.zeros(e.time.size)
        kernel.functions.run_balance(
            e.time,
            inputs.copy(),
            a,
            rough,
            leaving,
            doubtful,
            self._left_noise if noise is None else noise,
            base_vector(model, e),
            kernel.vector(model.effect_values()),
            kernel.switches(e.active(model.effects)),
            out,
            gap,
        )
        if "a" not in self.channels:
            return {"force": out, "gap": gap}
        resting = (e.inputs[:, at.IN_V] == 0.0) & ~doubtful & (leaving == 0.0)
        return {"force": out, "gap": gap, "a": np.where(resting, e.raw["a"] - resting_reading(model, e), 0.0)}


def _difference(measured: Array, modelled: Array, noise: float) -> Array:
    """Return measured minus model (n,), 0 where nothing was measured; of a model that runs away, very much."""
    with np.errstate(invalid="ignore", over="ignore"):
        difference = measured - modelled
    difference[np.isnan(measured)] = 0.0
    return np.clip(np.nan_to_num(difference, copy=False, nan=FAR * noise), -FAR * noise, FAR * noise)


def resting_reading(model: Model, experiment: Experiment) -> float:
    """Return what the model's accelerometer reads at rest in m/s^2."""
    reading = 0.0
    for effect in model.effects:
        if "read_a" in effect.ports and effect.name in experiment.active((effect,)):
            reading = float(effect.ports["read_a"](reading, *model.own(effect)))  # type: ignore[arg-type]
    return reading


def views_of(experiments: Sequence[Experiment], *, whitened: bool = False) -> list[View]:
    """Return the views that the recorded signals allow."""
    found: list[View] = []
    for e in experiments:
        if e.recording.imposed == "motion":
            found.append(View(e, "imposed"))
            continue
        if e.recording.experiment == "valve":
            found.append(View(e, "chambers", whitened))
            continue
        if "x" not in e.raw:
            found.append(View(e, "whole"))
            continue
        found.append(View(e, "forces"))
        if e.recording.experiment == "axis":
            given = e.flags.copy()
            given[at.MECHANICS] = 0.0
            found.append(View(replace(e, flags=given), "chambers", whitened))
    return [view for view in found if view.channels]
