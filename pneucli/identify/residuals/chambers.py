"""The residuals of the chambers' pressures and of the forces on the piston, simulated with the measured motion.

The residual of the forces is the friction that measured motion and pressures imply, compared with what the model
allows.

Source: docs/method.md, residual models.
"""

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array, read_only
from pneucli.caches import compiled
from pneucli.identify.guesses.flow_paths import (
    Chamber,
    ChamberGas,
    modelled_gas,
    opening_from_null,
    pressure_deviation,
    sensor_error_deviation,
)
from pneucli.identify.residuals.base import (
    DiscrepancyTerm,
    Places,
    ResidualModel,
    apply_whitening,
    bounded_difference,
    force_discrepancy_terms,
    initial_state_errors,
    initial_state_sensitivity,
    log_determinant,
    whiten,
)
from pneucli.physics.declaration import Effect
from pneucli.physics.ports import Balance
from pneucli.simulate import layout as at
from pneucli.simulate.derivatives import COLUMNS, Directions, derivatives, differentiable
from pneucli.simulate.experiment import Experiment, cache_draws
from pneucli.simulate.model import Model
from pneucli.simulate.outputs import accelerometer_offset, with_estimated_pressures
from pneucli.simulate.position_smoother import PositionSmoother
from pneucli.simulate.run import base_vector, kernel_for, run, simulate, with_force_in_time

COMMAND_PERTURBATION = 1e-3  # of each command, for forward differences
CHAMBER_OF_SIGNAL: dict[str, Chamber] = {"p1": 1, "p2": 2}
STATE_OF_SIGNAL = {"p1": at.P1, "p2": at.P2}
SAMPLES_AT_ONCE = 64  # whose outputs stay in the nearest memory while they are transposed
PLAY_WIDTHS = (0.02, 0.06, 0.18)  # of the range of openings: half widths of a play for hysteresis terms


@dataclass(frozen=True)
class ChamberPressures(ResidualModel):
    """Gas and valve.

    ``whiten_initial_state`` whitens the residuals for the errors of the initial states, as every stage does.
    """

    whiten_initial_state: bool = False
    title: ClassVar[str] = "gas, valve and their sensors"
    balances: ClassVar[frozenset[Balance]] = frozenset({"gas", "pressure sensor"})
    base_groups: ClassVar[frozenset[str]] = frozenset({"rig", "valve"})

    @property
    def subsystem_channels(self) -> tuple[str, ...]:
        """The pressures, the gas temperature, and the flow through the valve."""
        return ("p1", "p2", "temperature", "flow")

    def exclusive_channels(self, effect: Effect) -> tuple[str, ...]:
        """Return the gas temperature for heat transfer: without it, the modelled temperature is constant."""
        return ("temperature",) if "heat" in effect.ports and "temperature" in self.channels else ()

    def residual(self, model: Model, errors: Mapping[str, Array] | None = None) -> dict[str, Array]:
        """Return measured minus model by channel, whitened for the initial-state ``errors``."""
        modelled = simulate(model, self.experiment)
        residual = {c: bounded_difference(self.measured[c], modelled[c], self.noise[c]) for c in self.channels}
        return self.apply_whitening(residual, self.initial_state_sensitivity(model) if errors is None else errors)

    def initial_state_sensitivity(self, model: Model) -> dict[str, Array]:
        """Return the effect of initial-state errors (:mod:`pneucli.identify.residuals.base`)."""
        return (
            initial_state_sensitivity(model, self.experiment, self._initial_state_errors)
            if self.whiten_initial_state
            else {}
        )

    def differentiable(self, directions: Directions) -> NDArray[np.bool_]:
        """Return by which parameters simulations differentiate the residuals."""
        return differentiable(directions, self.experiment)

    def write_derivatives(
        self, directions: Directions, errors: Mapping[str, Array], some: Sequence[int], places: Places
    ) -> None:
        """Differentiate the residuals by some parameters, see :meth:`ResidualModel.write_derivatives`."""
        e = self.experiment
        for part, simulated in derivatives(directions, e, some):
            rows = places.rows[list(part)]
            for start, c in zip(itertools.count(places.start, e.time.size), self.channels, strict=False):
                factor = -self.weights.get(c, 1.0) / self.noise[c]
                written = _write_derivatives(simulated, COLUMNS[c], factor, self.measured[c], places.array, rows, start)
                if c in errors:
                    whiten(places.array, errors[c], e.restarts, written, start)

    def discrepancy_terms(self, model: Model, channel: str) -> Sequence[DiscrepancyTerm]:
        """Return the forms of a missing flow into the chamber in kg/s, and of an error of its sensor in Pa.

        The flow may be constant, a share of the valve's flow or of the swept volume, or a hysteresis of the flow.
        """
        if channel not in CHAMBER_OF_SIGNAL:
            return super().discrepancy_terms(model, channel)
        e, pressure = self.experiment, run(model, self.experiment)[:, STATE_OF_SIGNAL[channel]]
        gas = self._gas(model, channel, pressure)
        opening = opening_from_null(e, e.recording.chamber if e.vessel else CHAMBER_OF_SIGNAL[channel])
        opening = np.zeros(e.time.size) if opening is None else opening
        decay, noise = (
            self.initial_state_sensitivity(model).get(channel, np.ones((1, e.time.size)))[0],
            self.noise[channel],
        )

        def flow(added_flow: Array) -> Array:
            return pressure_deviation(e, gas, added_flow, decay) / noise

        return (
            DiscrepancyTerm("flow", "kg/s", np.ones(gas.flow.size), flow),
            DiscrepancyTerm("share of the flow", "1", gas.flow, flow),
            DiscrepancyTerm("share of the swept volume", "1", gas.swept_flow, flow),
            *(
                DiscrepancyTerm("hysteresis of the flow", "1", gas.flow * play_operator(opening, width), flow, "u")
                for width in PLAY_WIDTHS
            ),
            DiscrepancyTerm(
                "error of its sensor",
                "Pa",
                np.ones(gas.flow.size),
                lambda error: sensor_error_deviation(e, error, decay) / noise,
                channel,
                pressure,
            ),
        )

    def _gas(self, model: Model, channel: str, pressure: Array) -> ChamberGas:
        base = model.base_values()
        dead_1, dead_2 = (base[f"rig.dead_volume_{i}"] + model.sum_of_port(f"volume_{i}") for i in (1, 2))
        rig = replace(model.rig, dead_volume_1=dead_1, dead_volume_2=dead_2)
        vessel = model.values.get("rig.vessel_volume", 1.0)
        return modelled_gas(self.experiment, rig, CHAMBER_OF_SIGNAL[channel], vessel, pressure)

    def flow_gain_sensitivity(self, model: Model) -> dict[str, Array]:
        """Return the effect of relative flow errors (:mod:`pneucli.identify.residuals.chambers`)."""
        return flow_gain_sensitivity(model, self.experiment)

    def apply_whitening(self, residual: Mapping[str, Array], errors: Mapping[str, Array]) -> dict[str, Array]:
        """Return the residuals whitened for initial-state errors."""
        starts = self.experiment.restarts
        return {c: apply_whitening(r, errors[c], starts) if c in errors else r for c, r in residual.items()}

    def log_determinant(self, errors: Mapping[str, Array]) -> Array:
        """Return the log determinant that belongs to the whitening, channel after channel, shape (N,)."""
        starts, none = self.experiment.restarts, np.zeros(self.experiment.time.size)
        return np.concatenate([log_determinant(errors[c], starts) if c in errors else none for c in self.channels])

    @cached_property
    def _initial_state_errors(self) -> dict[str, float]:
        return initial_state_errors(self.experiment)


@compiled(nogil=True, error_model="numpy")
def _write_derivatives(
    simulated: Array, column: int, factor: float, measured: Array, out: Array, rows: NDArray[np.intp], start: int
) -> NDArray[np.intp]:
    """Write the derivatives of one column of outputs (n, columns, 1 + lanes) to n columns from ``start`` on of rows of
    zeros; 0 without a reading. Return the rows that do not remain zero.
    """
    n, lanes = measured.size, np.empty(rows.size, dtype=np.int64)
    count = 0
    for j in range(rows.size):
        i = 0
        while i < n and simulated[i, column, 1 + j] == 0.0:
            i += 1
        if i < n:
            lanes[count] = j
            count += 1
    for first in range(0, n, SAMPLES_AT_ONCE):
        last = min(first + SAMPLES_AT_ONCE, n)
        for lane in lanes[:count]:
            for i in range(first, last):
                if not math.isnan(measured[i]):
                    out[rows[lane], start + i] = factor * simulated[i, column, 1 + lane]
    return rows[lanes[:count]]


def play_operator(opening: Array, width: float) -> Array:
    """Return the position of an opening within a play that it drags along.

    Args:
        opening: Opening in V, shape (n,).
        width: Half width of the play, as a share of the range of the opening.

    Returns:
        The position from -1 to 1, shape (n,); positive where the valve opens further. 0 for a constant opening.

    >>> play_operator(np.array([0.0, 1.0, 2.0, 1.0]), 0.5).tolist()
    [0.0, 1.0, 1.0, 0.0]

    """
    half_width = width * float(np.ptp(opening))
    centre, out = opening[0], np.zeros_like(opening)
    for i, value in enumerate(opening if half_width > 0.0 else ()):
        centre = min(max(centre, value - half_width), value + half_width)
        out[i] = (value - centre) / half_width
    return np.asarray(out * np.sign(opening))


def flow_gain_sensitivity(model: Model, experiment: Experiment) -> dict[str, Array]:
    """Compute the pressure change caused by commands with a relative error of 1, linearised, from each restart on.

    Where the area grows with the n-th power of the command, its relative error is n times the command's.

    Args:
        model: The model.
        experiment: The experiment.

    Returns:
        By pressure, shape (2, n), in units of the sensor's noise: commands that fill chamber 1, then those that vent
        it.

    """
    e, null = experiment, model.base_values()["valve.null"]
    nominal, shifted = (
        simulate(model, e),
        [simulate(model, e, _perturbed_commands(e.inputs, null, sign)) for sign in (1.0, -1.0)],
    )
    channels = [c for c in ("p1", "p2") if c in e.channels and e.noise[c].rms]
    return {
        c: np.array([(nominal[c] - one[c]) / (COMMAND_PERTURBATION * e.noise[c].rms) for one in shifted])
        for c in channels
    }


def _perturbed_commands(inputs: Array, null: float, sign: float) -> Array:
    """Return inputs (n, 8) with the commands on one side of the null slightly closer to it."""
    perturbed = inputs.copy()
    for column in (at.IN_U, at.IN_U2):
        opening = perturbed[:, column] - null
        perturbed[:, column] -= COMMAND_PERTURBATION * np.where(sign * opening > 0.0, opening, 0.0)
    return perturbed


MIN_REST_RATIO = 4.0  # times the smear time: the duration of rest, and of motion, around a break-away
ONSET_SPEED_RATIO = 0.5  # of the standstill speed, so two standard deviations of its noise: there a rest ends
MIN_BREAKAWAY_SPEED = 1e-9  # m/s, of a break-away within the noise: only its direction counts


@dataclass(frozen=True)
class ForceBalance(ResidualModel):
    """The force left over by the balance of forces, and the accelerometer at rest."""

    title: ClassVar[str] = "mechanics: friction, load or a force on the piston"
    balances: ClassVar[frozenset[Balance]] = frozenset({"mechanics", "friction", "pressure sensor"})
    base_groups: ClassVar[frozenset[str]] = frozenset({"rig", "friction"})
    predicts_force: ClassVar[bool] = True
    is_simulated: ClassVar[bool] = False

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """The force, and the accelerometer's reading where one was recorded."""
        e = self.experiment
        return ("force", "a") if "a" in e.raw and e.noise["a"].rms else ("force",)

    def residual(self, model: Model, errors: Mapping[str, Array] | None = None) -> dict[str, Array]:
        """Return the residual of the balance by channel, see :meth:`balance`."""
        return self.balance(model, self.experiment.inputs)

    def exclusive_channels(self, effect: Effect) -> tuple[str, ...]:
        """Return the accelerometer for its own faults: at rest, nothing else changes its reading."""
        return ("a",) if "read_a" in effect.ports and "a" in self.channels else ()

    def discrepancy_terms(self, model: Model, channel: str) -> Sequence[DiscrepancyTerm]:
        """Return the forms of a missing force or friction, or of an accelerometer's error at rest."""
        at_rest = super().discrepancy_terms(model, channel)
        return force_discrepancy_terms(self.experiment, self.noise[channel]) if channel == "force" else at_rest

    def with_modelled_inputs(self, model: Model, inputs: Array) -> Array:
        """Return inputs (n, 8) with unmeasured signals filled in."""
        return inputs

    @cached_property
    def noise(self) -> dict[str, float]:
        """The standard deviation of each channel from the sensors alone."""
        e = self.experiment
        mass = (e.rig.moving_mass or 1.0) + e.recording.added_mass
        share = {"p1": e.rig.piston_areas[0], "p2": e.rig.piston_areas[1], "a": mass, "force": 1.0}
        force_noise = [share[n] * e.noise[n].rms for n in share if n in e.noise]
        if not force_noise:  # the acceleration is all that was measured, through the position
            drawn = self._noise_realisation(e.draw_noise(np.random.default_rng(0)))[1][0]
            force_noise = [mass * float(np.std(drawn - e.acceleration))]
        force = max(float(np.sqrt(np.sum(np.square(force_noise)))), 1e-6)
        return {"force": force} | {c: e.noise[c].rms for c in ("a",) if c in e.noise}

    def monte_carlo_rms(self, model: Model, errors: Mapping[str, Array], draws: int, seed: int) -> dict[str, float]:
        """Propagate drawn sensor noise through the balance.

        It matters at the edge of stiction and where a lag is inverted.

        Args:
            model: The model.
            errors: Unused, since the balance has no initial state.
            draws: Number of draws.
            seed: Seed of the draws.

        Returns:
            The rms by channel, in units of the sensors' noise; 1 for the accelerometer at rest, whatever the model.

        """
        e = self.experiment
        nominal = self.balance(model, e.inputs)
        without_noise = self.balance(model, e.inputs, noise=np.zeros(2))
        power = {c: float(np.mean(((nominal[c] - without_noise[c]) / self.noise[c]) ** 2)) for c in self.channels}
        for inputs, loads in self._noise_realisations(draws, seed):
            drawn = self.balance(model, inputs, loads)
            for c in self.channels:
                count = max(int(np.count_nonzero(nominal[c])), 1)
                power[c] += float(np.sum(((drawn[c] - nominal[c]) / self.noise[c]) ** 2)) / (count * draws)
        return {c: 1.0 if c == "a" else float(np.sqrt(p)) for c, p in power.items()}

    def _noise_realisations(self, draws: int, seed: int) -> Iterable[tuple[Array, tuple[Array, Array]]]:
        """Return inputs (n, 8) and accelerations of repeated readings of the same run; rests remain rests."""
        drawn = (self._noise_realisation(noise) for noise in self.experiment.iterate_noise(draws, seed))
        numbers = draws * self.experiment.time.size * (len(at.INPUTS) + 2)
        return cache_draws(self._realisation_cache, (draws, seed), drawn, numbers)

    def _noise_realisation(self, noise: Mapping[str, Array]) -> tuple[Array, tuple[Array, Array]]:
        e, (a, removed_force) = self.experiment, self._acceleration_and_removed_force
        shift = e.input_errors(noise)
        shift[e.inputs[:, at.IN_V] == 0.0, at.IN_V] = 0.0
        more = noise["a"] if "a" in noise else self._acceleration_error(noise, shift)
        return e.inputs + shift, (a + more, removed_force + self._removed_force(noise, shift))

    def _acceleration_error(self, noise: Mapping[str, Array], shift: Array) -> Array:
        smoother = self.experiment.motion_smoother
        if isinstance(smoother, PositionSmoother):
            return smoother.draw_error(noise["x"])[2]
        return np.asarray(np.gradient(shift[:, at.IN_V], self.experiment.time))

    @cached_property
    def _realisation_cache(self) -> dict[tuple[int, int], list[tuple[Array, tuple[Array, Array]]]]:
        return {}

    @cached_property
    def _breakaways_and_uncertain_direction(self) -> tuple[Array, NDArray[np.bool_]]:
        """Velocities at break-aways (n,), and where the direction of motion is uncertain (n,)."""
        e = self.experiment
        smoothed = e.measured_motion[1]
        smear_samples = max(round(e.smear_time / e.recording.period), 1)
        breakaway = breakaway_velocities(
            e.inputs[:, at.IN_V],
            smoothed,
            ONSET_SPEED_RATIO * e.standstill_speed,
            round(MIN_REST_RATIO * smear_samples),
        )
        bouncing = ~e.is_free & (e.inputs[:, at.IN_V] != 0.0)
        return breakaway, uncertain_direction(e.inputs[:, at.IN_V], breakaway, smear_samples) | bouncing

    @cached_property
    def _acceleration_and_removed_force(self) -> tuple[Array, Array]:
        """The acceleration (n,) and the force (n,) of what smoothing took out of the pressures.

        An accelerometer's reading is taken as it is: it jumps where the piston breaks away and stops, which smoothing
        would spread.
        """
        e = self.experiment
        return e.acceleration, self._removed_force(e.raw, e.inputs)

    def _removed_force(self, raw: Mapping[str, Array], inputs: Array) -> Array:
        """Return the force (n,) that smoothing removed from the pressures, linear in ``raw`` and ``inputs`` (n, 8)."""
        (area_1, area_2), removed_force = self.experiment.rig.piston_areas, np.zeros(self.experiment.time.size)
        for name, column, share in (("p1", at.IN_P1, area_1), ("p2", at.IN_P2, -area_2)):
            if name in raw:
                removed_force += share * (raw[name] - inputs[:, column])
        return removed_force

    @cached_property
    def _remaining_force_noise(self) -> Array:
        """The noise that smoothing leaves in the pressure force (N), and in its rate (N/s)."""
        e = self.experiment
        force_noise = [
            share * e.noise[n].rms for n, share in zip(("p1", "p2"), e.rig.piston_areas, strict=True) if n in e.noise
        ]
        removed_power = float(np.mean(self._acceleration_and_removed_force[1] ** 2))
        drawn, force = e.draw_noise(np.random.default_rng(0)), np.zeros(e.time.size)
        for name, share in (("p1", e.rig.piston_areas[0]), ("p2", -e.rig.piston_areas[1])):
            if name in drawn:
                force += share * (e.smoothers[name](drawn[name]) if name in e.smoothers else drawn[name])
        remaining_power = max(float(np.sum(np.square(force_noise))) - removed_power, 0.0)
        return np.array([np.sqrt(remaining_power), np.std(np.gradient(force, e.time))])

    def balance(
        self, model: Model, inputs: Array, loads: tuple[Array, Array] | None = None, noise: Array | None = None
    ) -> dict[str, Array]:
        """Evaluate the balance of forces.

        Args:
            model: The model.
            inputs: Kernel inputs, shape (n, 8), of the experiment or of a repeated reading.
            loads: Acceleration (m/s^2) and removed force (N) of the same reading, each (n,); by default the
                experiment's.
            noise: Noise of the pressure force (N) and of its rate (N/s); by default what smoothing leaves.

        Returns:
            ``force``: the remaining force in N; ``gap``: the probability that the model gives only bounds of the force,
            between two branches of friction, and ``width`` their distance in N; ``a``, where recorded: the
            accelerometer's error in m/s^2 at rest. Each (n,).

        """
        e, kernel = self.experiment, kernel_for(model.effects)
        (a, removed_force), (breakaway, uncertain) = (
            loads or self._acceleration_and_removed_force,
            self._breakaways_and_uncertain_direction,
        )
        out, gap, width = np.zeros((3, e.time.size))
        kernel.functions.run_balance(
            read_only(e.time),
            with_force_in_time(model, e, self.with_modelled_inputs(model, inputs)),
            read_only(a),
            removed_force,
            breakaway,
            uncertain,
            e.contact_side,
            self._remaining_force_noise if noise is None else noise,
            base_vector(model, e),
            kernel.effect_vector(model.effect_values()),
            kernel.effect_switches(e.active_effects(model.effects)),
            out,
            gap,
            width,
        )
        found = {"force": out, "gap": gap, "width": width}
        if "a" not in self.channels:
            return found
        resting = (e.inputs[:, at.IN_V] == 0.0) & ~uncertain & (breakaway == 0.0)
        return found | {"a": np.where(resting, e.raw["a"] - accelerometer_offset(model, e), 0.0)}


@dataclass(frozen=True)
class ForceBalanceInferredPressure(ForceBalance):
    """The balance of forces with the pressures that the model of gas and valve gives for measured motion and commands.

    Initial pressures are unknown and are chosen to minimise the remaining force. While the gas stays enclosed it acts
    like a spring of unknown preload, so that part of such a force cannot be distinguished from it.
    """

    balances: ClassVar[frozenset[Balance]] = ForceBalance.balances | ChamberPressures.balances
    base_groups: ClassVar[frozenset[str]] = ForceBalance.base_groups | ChamberPressures.base_groups

    def with_modelled_inputs(self, model: Model, inputs: Array) -> Array:
        """Return inputs (n, 8) with the model's pressures."""
        return with_estimated_pressures(model, self.experiment, inputs)


def breakaway_velocities(v: Array, smoothed: Array, onset_speed: float, min_samples: int) -> Array:
    """Locate break-aways: the last sample of each rest that motion follows.

    The velocity ``v`` is set to zero at rest and leaves zero late, once it exceeds noise. The smoothed velocity shows
    where it began to grow beyond ``onset_speed``; the break-away is the sample before.

    Args:
        v: Velocity in m/s, shape (n,), zero at rest.
        smoothed: Smoothed velocity in m/s, shape (n,).
        onset_speed: Speed at which motion begins, in m/s.
        min_samples: Number of samples of rest before, and of motion in one direction after.

    Returns:
        The velocity in m/s at each break-away, 0 elsewhere, shape (n,).

    """
    out = np.zeros(v.size)
    moving = v != 0.0
    for k in np.flatnonzero(~moving[:-1] & moving[1:]):
        preceding, following = moving[max(k - min_samples, 0) : k + 1], v[k + 1 : k + 1 + min_samples]
        if k >= min_samples and not preceding.any() and (np.all(following > 0) or np.all(following < 0)):
            direction = np.sign(following[0])
            below_onset = np.flatnonzero(direction * smoothed[k - min_samples : k + 1] < onset_speed)
            onset = k - min_samples + int(below_onset[-1]) if below_onset.size else k
            out[onset] = direction * max(direction * smoothed[onset], MIN_BREAKAWAY_SPEED)
    return out


def uncertain_direction(v: Array, breakaway: Array, smear_samples: int) -> NDArray[np.bool_]:
    """Mask the samples whose direction of motion is uncertain.

    It is uncertain near a reversal, at both ends, and from a break-away until the velocity exceeds noise.

    Args:
        v: Velocity in m/s, shape (n,), zero at rest.
        breakaway: Velocity at break-aways, 0 elsewhere, shape (n,).
        smear_samples: Number of samples over which smoothing spreads a stop.

    Returns:
        The mask, shape (n,); False at the break-aways themselves.

    """
    out = np.zeros(v.size, dtype=bool)
    change = np.flatnonzero(np.diff(np.sign(v)) != 0)
    for shift in range(1 - smear_samples, smear_samples + 1):
        out[np.clip(change + shift, 0, v.size - 1)] = True
    out[:smear_samples] = out[-smear_samples:] = True
    for onset in np.flatnonzero(breakaway):
        out[onset : onset + int(np.argmax(v[onset:] != 0.0))] = True
    out[breakaway != 0.0] = False
    return out
