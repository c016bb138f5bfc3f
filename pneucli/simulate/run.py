"""Run a model over an experiment."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cache
from threading import Lock
from typing import Any

import numpy as np

from pneucli.arrays import Array, read_only
from pneucli.physics.declaration import Effect
from pneucli.physics.effects import catalogue_with_sides, with_catalogue
from pneucli.simulate import layout as at
from pneucli.simulate.build import Kernel, build
from pneucli.simulate.experiment import OUTPUT_COLUMNS, Experiment
from pneucli.simulate.force_clock import with_force_in_time
from pneucli.simulate.model import Model
from pneucli.simulate.temperature_sensor import temperature_reading

RECENT_RUNS = 4  # of a recording: more are hardly asked for again
RECENT_BYTES = 16 << 20  # of all of them
_LOCK = Lock()  # threads simulate the same recording


@cache
def kernel_for(effects: tuple[Effect, ...]) -> Kernel:
    """Return the compiled kernel of the catalogue and of these effects.

    One kernel serves every model. One without effects would be a tenth faster for the base model
    (``benchmarks.simulate``), and take as long again to compile and to load.

    Args:
        effects: Effects of the catalogue, their variants, or plugins.

    Returns:
        The kernel.
    """
    return build(with_catalogue(effects))


def simulate(model: Model, experiment: Experiment, inputs: Array | None = None) -> dict[str, Array]:
    """Simulate the readings of every sensor.

    Args:
        model: The model.
        experiment: The experiment.
        inputs: Inputs in place of the experiment's own, shape (n, 8).

    Returns:
        Readings by channel in SI units, each (n,).
    """
    out = run(model, experiment, inputs)
    readings = {channel: out[:, column] for channel, column in OUTPUT_COLUMNS.items()}
    if (lag := temperature_lag(model, experiment)) > 0.0:
        temperature = readings["temperature"]
        readings["temperature"] = temperature_reading(experiment.time, temperature, lag, experiment.gap_ends)
    return readings


def temperature_lag(model: Model, experiment: Experiment) -> float:
    """Return the time constant in s of the sensor of the gas temperature; 0 where there is none."""
    return model.sum_of_port("temperature_lag") if "temperature" in experiment.channels else 0.0


def run(model: Model, experiment: Experiment, inputs: Array | None = None) -> Array:
    """Run the kernel.

    Args:
        model: The model.
        experiment: The experiment.
        inputs: Inputs in place of the experiment's own, shape (n, 8).

    Returns:
        Output of the kernel, shape (n, 10), in the order of :mod:`pneucli.simulate.layout`; read-only, since the same
        model is often asked for again: by a fit's start, its end, and the costs and tests of the fitted model.

    References:
        Thesis 2.47-2.52 (state space), 3.1-3.7 (friction).
    """
    inputs = experiment.inputs if inputs is None else inputs
    return _run(model, experiment, with_inferred_pressures(model, experiment, inputs))


def with_inferred_pressures(model: Model, experiment: Experiment, inputs: Array) -> Array:
    """Return inputs in which unmeasured pressures are those of the model under the measured motion.

    They start from their values in ``inputs``, at the first sample and after each gap.

    Args:
        model: The model.
        experiment: The experiment.
        inputs: Inputs, shape (n, 8).

    Returns:
        Inputs, shape (n, 8); the same array where none is inferred.
    """
    if not experiment.inferred_pressures:
        return inputs
    inputs, simulated = inputs.copy(), _run(model, experiment.with_imposed_motion, inputs)
    for name in experiment.inferred_pressures:
        inputs[:, at.INPUTS.index(name)] = simulated[:, OUTPUT_COLUMNS[name]]
    return inputs


def _run(model: Model, experiment: Experiment, inputs: Array) -> Array:
    kernel = kernel_for(model.effects)
    arguments = kernel_arguments(kernel, model, experiment, inputs)
    if inputs is not experiment.inputs:
        return _outputs(kernel, arguments)
    key = (id(kernel), *(values.tobytes() for values in arguments[3:7]), model.valve, model.valve_2)
    return recalled(experiment.recent_runs, key, lambda: _outputs(kernel, arguments), RECENT_RUNS, RECENT_BYTES)


def recalled(
    recent: dict[tuple[object, ...], Array], key: tuple[object, ...], make: Callable[[], Array], most: int, bytes_: int
) -> Array:
    """Return what belongs to a key, made where it is not among the last ones, of which it becomes the last.

    Args:
        recent: What was made or asked for last, by key; in place.
        key: All that it depends on.
        make: Makes it.
        most: Largest number of arrays that are kept.
        bytes_: Largest number of bytes of all of them.

    Returns:
        The array.
    """
    with _LOCK:
        found = recent.pop(key, None)
    found = make() if found is None else found
    with _LOCK:
        recent[key] = found  # the last one
        while recent and (len(recent) > most or len(recent) * found.nbytes > bytes_):
            del recent[next(iter(recent))]
    return found


def run_kernel(kernel: Kernel, model: Model, experiment: Experiment, inputs: Array) -> Array:
    """Return the outputs of a kernel, compiled or plain Python, over a recording.

    Args:
        kernel: The kernel of the model's effects.
        model: The model.
        experiment: The recording.
        inputs: Its inputs in SI, shape (n, inputs).

    Returns:
        Outputs in SI, shape (n, outputs); read-only.

    """
    return _outputs(kernel, kernel_arguments(kernel, model, experiment, inputs))


def _outputs(kernel: Kernel, arguments: tuple[Any, ...]) -> Array:
    out = np.zeros((arguments[0].size, at.OUTPUTS))
    kernel.run(*arguments, np.zeros(1), np.zeros(2), out)
    out.flags.writeable = False
    return out


def kernel_arguments(kernel: Kernel, model: Model, experiment: Experiment, inputs: Array) -> tuple[Any, ...]:
    """Return the arguments with which every simulation of a recording by a kernel begins: time to longest steps.

    Args:
        kernel: The kernel of the model's effects.
        model: The model.
        experiment: The recording.
        inputs: Its inputs in SI, shape (n, inputs).

    Returns:
        The arguments, in the order of :func:`pneucli.simulate.kernel.run.run`.
    """
    return (
        read_only(experiment.time),
        with_force_in_time(model, experiment, inputs),
        experiment.restarts,
        base_vector(model, experiment),
        kernel.effect_vector(model.effect_values()),
        kernel.effect_switches(experiment.active_effects(model.effects)),
        experiment.flags,
        *map(read_only, area_tables(model, experiment)),
        experiment.max_step,
        experiment.max_given_step,
    )


def area_tables(model: Model, experiment: Experiment) -> tuple[Array, Array]:
    """Return the tables of effective area for both chambers.

    Args:
        model: The model.
        experiment: The experiment; a vessel takes the place of chamber 1.

    Returns:
        Areas in m^2 over the commands of both directions, shape (TABLE_POINTS,), for chamber 1 and chamber 2.
    """
    largest = experiment.flags[at.U_MAX]
    return model.valve_of_chamber(experiment.recording.chamber).table(largest), model.chamber_2_valve.table(largest)


def base_vector(model: Model, experiment: Experiment) -> Array:
    """Return the base parameters in the order of the kernel.

    Args:
        model: The model.
        experiment: The experiment; the vessel of a valve test takes the place of chamber 1.

    Returns:
        Base parameters, shape (19,), SI.
    """
    vessel_volume = model.values.get("rig.vessel_volume", 0.0) if experiment.vessel else None
    return base_vector_of(model, vessel_volume, experiment.recording.added_mass, experiment.stroke_limits)


def base_vector_of(
    model: Model,
    vessel_volume: float | None,
    added_mass: float = 0.0,
    stroke_limits: tuple[float, float] | None = None,
) -> Array:
    """Return the base parameters in the order of the kernel, of a bench that is not recorded yet, too.

    Args:
        model: The model.
        vessel_volume: Volume in m^3 of the vessel that takes the place of chamber 1; None: there is none.
        added_mass: Mass in kg that moves with the piston, in addition to the rig's.
        stroke_limits: Lowest and highest x in m; None: as the rig states them.

    Returns:
        Base parameters, shape (19,), SI.
    """
    base = model.base_values()
    if vessel_volume is not None:
        base |= {"rig.piston_area_1": 0.0, "rig.dead_volume_1": vessel_volume}
    if any("heat" in effect.ports for effect in model.effects):  # then heat is simulated
        base["rig.polytropic_exponent"] = base["rig.heat_capacity_ratio"]
    base["rig.moving_mass"] += added_mass
    if stroke_limits is not None:
        base |= dict(zip(("rig.lower_end", "rig.upper_end"), stroke_limits, strict=True))
    return np.array([base[name] for name in at.BASE_NAMES])


def effects_by_name(names: Iterable[str], available: Mapping[str, Effect] | None = None) -> tuple[Effect, ...]:
    """Return effects by their names.

    Args:
        names: Names of effects.
        available: Effects by name; None: the catalogue with its variants.

    Returns:
        The effects in the order of ``names``.

    Raises:
        KeyError: A name is unknown.
    """
    available = catalogue_with_sides() if available is None else available
    return tuple(available[name] for name in names)
