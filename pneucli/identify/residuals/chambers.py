"""The pressure residuals: chambers simulated with the measured motion."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.caches import compiled
from pneucli.identify.guesses.chamber_balance import (
    Chamber,
    ChamberGas,
    modelled_gas,
    pressure_deviation,
    sensor_error_deviation,
)
from pneucli.identify.guesses.flow_paths import opening_from_null
from pneucli.identify.residuals.base import (
    DiscrepancyTerm,
    Places,
    ResidualModel,
    apply_whitening,
    bounded_difference,
    initial_state_errors,
    initial_state_sensitivity,
    log_determinant,
    whiten,
)
from pneucli.physics.declaration import Effect
from pneucli.physics.ports import Balance
from pneucli.simulate import layout as at
from pneucli.simulate.derivatives import COLUMNS, Directions, derivatives, differentiable
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.run import run, simulate

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
