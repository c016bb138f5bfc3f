"""Derivatives of the simulated readings by any parameters, from simulations with dual numbers."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from threading import local

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.simulate import layout as at
from pneucli.simulate.build import DIFFERENTIABLE
from pneucli.simulate.dual import LANES, ROW
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.run import base_vector, kernel_arguments, kernel_for, temperature_lag, temperature_reading

COLUMNS = {"p1": at.D_R1, "p2": at.D_R2, "temperature": at.D_GAS_T, "flow": at.D_FLOW}
_LOCAL = local()
_CONSTANTS = np.array([name not in DIFFERENTIABLE for name in at.BASE_NAMES])


@dataclass(frozen=True)
class Directions:
    """A model, and for each parameter those with another value, each with the step of the parameter that leads there.

    The kernel takes base parameters, parameters of effects and tables of areas; how these change with a parameter is
    the mean over its steps. What follows from them in a simulation is differentiated exactly.
    """

    model: Model
    steps: Sequence[Sequence[tuple[float, Model]]]
    _found: dict[tuple[object, ...], Array] = field(default_factory=dict)

    def area_slopes(self, chamber: int, largest: float) -> Array:
        """Return the derivatives of a chamber's table of areas over commands up to ``largest`` V.

        Returns:
            Shape (areas, parameters), m^2 a unit of the parameter.
        """
        key = (chamber if self.model.valve_2 is not None else 1, largest)
        if key not in self._found:
            nominal = self.model.valve_of_chamber(chamber).table(largest)
            rows = np.zeros((len(self.steps), nominal.size))
            for j, steps in enumerate(self.steps):
                for step, other in steps:
                    if other.valve_of_chamber(chamber) != self.model.valve_of_chamber(chamber):
                        rows[j] += (other.valve_of_chamber(chamber).table(largest) - nominal) / (step * len(steps))
            self._found[key] = np.ascontiguousarray(rows.T)
        return self._found[key]

    def base_slopes(self, experiment: Experiment) -> Array:
        """Return the derivatives of the base parameters, shape (19, parameters)."""
        key = ("base", experiment.vessel, experiment.recording.added_mass, experiment.stroke_limits)
        if key not in self._found:
            self._found[key] = self._slopes(lambda model: base_vector(model, experiment))
        return self._found[key]

    def effect_slopes(self) -> Array:
        """Return the derivatives of the parameters of effects, shape (parameters of effects + 1, parameters)."""
        if ("effects",) not in self._found:
            kernel = kernel_for(self.model.effects)
            self._found["effects",] = self._slopes(lambda model: kernel.effect_vector(model.effect_values()))
        return self._found["effects",]

    def _slopes(self, vector_of: Callable[[Model], Array]) -> Array:
        nominal = vector_of(self.model)
        out = np.zeros((nominal.size, len(self.steps)))
        for j, steps in enumerate(self.steps):
            for step, other in steps:
                if other.values != self.model.values:
                    changed = vector_of(other)
                    moved = np.flatnonzero(changed != nominal)
                    out[moved, j] += (changed[moved] - nominal[moved]) / (step * len(steps))
        return np.where(np.isfinite(out), out, 0.0)  # of what is not known, and does not count


def _scratch(samples: int) -> Array:
    """Return memory of this thread for an output: new memory costs as much as half the simulation."""
    size = samples * at.D_OUTPUTS * ROW
    if getattr(_LOCAL, "numbers", np.zeros(0)).size < size:
        _LOCAL.numbers = np.empty(size)
    return np.asarray(_LOCAL.numbers[:size].reshape(samples, at.D_OUTPUTS, ROW))


def as_rows(values: Array) -> Array:
    """Return numbers (...) of any unit as dual numbers without derivatives, shape (..., 1 + LANES)."""
    rows = np.zeros((*values.shape, ROW))
    rows[..., 0] = values
    return rows


def differentiable(directions: Directions, experiment: Experiment) -> NDArray[np.bool_]:
    """Return by which parameters a simulation of an experiment can be differentiated, shape (parameters,).

    Args:
        directions: The parameters.
        experiment: The experiment.

    Returns:
        All that the gas depends on where the motion is the measured one and both pressures come from one simulation.
    """
    given = experiment.flags[at.MECHANICS] == 0.0 and experiment.flags[at.PNEUMATICS] > 0.0
    if not given or experiment.inferred_pressures or not kernel_for(directions.model.effects).has_duals:
        return np.zeros(len(directions.steps), dtype=bool)
    return np.asarray(np.logical_not(directions.base_slopes(experiment)[_CONSTANTS].any(axis=0)))


def derivatives(
    directions: Directions, experiment: Experiment, some: Sequence[int]
) -> Iterator[tuple[tuple[int, ...], Array]]:
    """Differentiate the readings of a simulation by some parameters, as many at a time as a dual number holds.

    Args:
        directions: The parameters.
        experiment: The experiment.
        some: Indices of parameters for which :func:`differentiable` holds.

    Yields:
        Indices of parameters, and the output as dual numbers, shape (n, 7, 1 + LANES), in a unit of the parameter: a
        derivative stands at the place of its parameter, after the value. The next one overwrites it.
    """
    kernel, model = kernel_for(directions.model.effects), directions.model
    time, inputs, restarts, base, th, on, flags, *areas, h_max, h_given = kernel_arguments(
        kernel, model, experiment, experiment.inputs
    )
    largest = experiment.flags[at.U_MAX]
    slopes = [directions.area_slopes(chamber, largest) for chamber in (experiment.recording.chamber, 2)]
    for first in range(0, len(some), LANES):
        part = tuple(some[first : first + LANES])
        rows = [as_rows(base), as_rows(th)]
        for numbers, own in zip(rows, (directions.base_slopes(experiment), directions.effect_slopes()), strict=True):
            numbers[:, 1 : 1 + len(part)] = own[:, part]
        places = np.resize(part, LANES)
        out = _scratch(experiment.time.size)
        kernel.run_duals(time, inputs, restarts, *rows, on, flags, *areas, h_max, h_given, *slopes, places, out)
        _read_temperature(directions, experiment, part, out)
        yield part, out


def _read_temperature(directions: Directions, experiment: Experiment, part: Sequence[int], out: Array) -> None:
    """Replace the gas temperature in dual numbers (n, 7, 1 + LANES) by the reading of a slow sensor, in place."""
    lag = temperature_lag(directions.model, experiment)
    if lag <= 0.0:
        return
    read = partial(temperature_reading, experiment.time, starts=experiment.gap_ends)
    gas, columns = out[:, at.D_GAS_T, 0].copy(), 1 + len(part)
    out[:, at.D_GAS_T, :columns] = read(out[:, at.D_GAS_T, :columns], time_constant=lag)
    for lane, steps in enumerate((directions.steps[j] for j in part), start=1):
        for step, other in steps:
            if (other_lag := temperature_lag(other, experiment)) != lag:
                change = read(gas, time_constant=other_lag) - out[:, at.D_GAS_T, 0]
                out[:, at.D_GAS_T, lane] += change / (step * len(steps))
