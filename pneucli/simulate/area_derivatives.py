"""Derivatives of the readings of p1 and p2 by parameters of the valves' areas, all from one simulation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.run import kernel_arguments, kernel_for

Array = NDArray[np.float64]

MEMORY = 32 << 20  # bytes of the derivatives of one simulation
MIN_AT_ONCE = 4  # parameters in one simulation: it takes as long as about three without derivatives


@dataclass(frozen=True)
class AreaChanges:
    """A model, and for each parameter those with other areas, each with the step of the parameter that leads there."""

    model: Model
    steps: Sequence[Sequence[tuple[float, Model]]]
    _shapes: dict[tuple[int, float], Array] = field(default_factory=dict)

    def shapes(self, chamber: int, largest: float) -> Array:
        """Return the derivatives of a chamber's table of areas over commands up to ``largest`` V.

        Returns:
            The mean over the steps of each parameter, shape (areas, parameters), m^2 a unit of the parameter.
        """
        key = (chamber if self.model.valve_2 is not None else 1, largest)
        if key not in self._shapes:
            nominal = self.model.valve_of_chamber(chamber).table(largest)
            rows = np.zeros((len(self.steps), nominal.size))
            for j, steps in enumerate(self.steps):
                for step, other in steps:
                    rows[j] += (other.valve_of_chamber(chamber).table(largest) - nominal) / (step * len(steps))
            self._shapes[key] = np.ascontiguousarray(rows.T)
        return self._shapes[key]


def can_simulate_derivatives(model: Model, experiment: Experiment) -> bool:
    """Return whether one simulation can give the pressures' derivatives by areas.

    Args:
        model: The model.
        experiment: The experiment.

    Returns:
        Whether the motion is the measured one, both pressures come from one simulation, and the supply pressure does
        not depend on the flow of the valve.
    """
    active = experiment.active_effects(model.effects)
    supply_droops = any("supply" in effect.ports for effect in model.effects if effect.name in active)
    imposed = experiment.flags[at.MECHANICS] == 0.0 and experiment.flags[at.PNEUMATICS] > 0.0
    return imposed and not experiment.infers_p2 and not supply_droops


def area_derivatives(changes: AreaChanges, experiment: Experiment) -> Iterator[tuple[slice, Array]]:
    """Differentiate the readings of p1 and p2, some parameters at a time.

    Args:
        changes: The changes of the areas.
        experiment: The experiment, for which :func:`can_simulate_derivatives` holds.

    Yields:
        Which parameters, and the derivatives by them, shape (2, parameters, n), Pa a unit of the parameter.
    """
    largest = experiment.flags[at.U_MAX]
    shapes = [changes.shapes(chamber, largest) for chamber in (experiment.recording.chamber, 2)]
    at_once = max(MEMORY // (2 * 8 * experiment.time.size), MIN_AT_ONCE)
    for first in range(0, len(changes.steps), at_once):
        some = slice(first, first + at_once)
        derivatives = _simulated(changes.model, experiment, [np.ascontiguousarray(shape[:, some]) for shape in shapes])
        yield some, np.ascontiguousarray(derivatives.transpose(1, 2, 0))


def _simulated(model: Model, experiment: Experiment, shapes: Sequence[Array]) -> Array:
    """Return the derivatives of both readings, shape (n, 2, parameters), for those of both tables of areas."""
    kernel, n = kernel_for(model.effects), experiment.time.size
    derivatives = np.zeros((n, 2, shapes[0].shape[1]))
    given = kernel_arguments(kernel, model, experiment, experiment.inputs)
    kernel.functions.run_area_derivatives(*given, *shapes, np.zeros((n, at.OUTPUTS)), derivatives)
    return derivatives
