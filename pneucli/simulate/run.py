"""Run a model over an experiment; readings of slow sensors of temperature, and of a force on a clock of its own."""

from collections.abc import Callable
from functools import cache
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array, read_only
from pneucli.caches import compiled, part
from pneucli.physics.declaration import Effect
from pneucli.physics.effects import with_catalogue
from pneucli.simulate import layout as at
from pneucli.simulate.build import Kernel, build
from pneucli.simulate.experiment import OUTPUT_COLUMNS, Experiment
from pneucli.simulate.kernel.sensors import first_order_lag
from pneucli.simulate.model import Model

MIN_SPEED = 1e-9  # m/s, below which nothing moves
SLOPE_SAMPLES = 4  # on each side, over which the slope between two samples is taken


def shifted(time: Array, values: Array, delay: float) -> Array:
    """Return a signal as it is a time later; beyond its ends the first and the last value are held.

    The nearest sample is extended along the slope over samples around it: the mean of two neighbours would have less
    noise than either, and a delay could gain by it.

    Args:
        time: Time stamps in s, shape (n,).
        values: The signal, shape (n,).
        delay: Time in s; may be negative.

    Returns:
        The signal at ``time + delay``, shape (n,).

    >>> time = np.arange(10.0)
    >>> shifted(time, 3.0 * time, 2.5)[:3].tolist()
    [7.5, 10.5, 13.5]
    >>> shifted(time, 3.0 * time, -2.0)[:4].tolist()
    [0.0, 0.0, 0.0, 3.0]
    """
    wanted, last = np.clip(time + delay, time[0], time[-1]), time.size - 1
    nearest = np.searchsorted(0.5 * (time[1:] + time[:-1]), wanted)
    before, after = np.maximum(nearest - SLOPE_SAMPLES, 0), np.minimum(nearest + SLOPE_SAMPLES, last)
    slope = (values[after] - values[before]) / (time[after] - time[before])
    return np.asarray(values[nearest] + (wanted - time[nearest]) * slope)


def recorded_late(experiment: Experiment, force: Array, v: Array, delay: float) -> Array:
    """Return the force that an imposed motion needs as its sensor records it.

    Dry friction jumps where the motion turns, which may be a sampling period early or late. Closer to the turn than
    that, the reading itself replaces a share of the force, all of it at the turn: what is compared is a continuous
    function of the delay. It replaces all of it where the motion of that time was not recorded.

    Args:
        experiment: An experiment with an imposed motion and a recorded force.
        force: The force in N at the time at which it acts, shape (n,).
        v: Velocity in m/s, shape (n,).
        delay: Delay in s; may be negative.

    Returns:
        Force in N, shape (n,).
    """
    e, out = experiment, np.empty(experiment.time.size)
    signals = read_only(e.time), read_only(force), read_only(v), read_only(e.raw["force"])
    _write_recorded_late(*signals, e.recording.period, delay, out)
    return out


@compiled(nogil=True, error_model="numpy")
def _write_recorded_late(
    time: Array, force: Array, v: Array, recorded: Array, period: float, delay: float, out: Array
) -> None:
    """Write the force at each sample, in one pass."""
    place = before = behind = 1
    for i in range(time.size):
        earlier = min(max(time[i] - delay, time[0]), time[-1])
        place, before = _next_sample(time, earlier, place), _next_sample(time, earlier - period, before)
        behind = _next_sample(time, earlier + period, behind)
        way, speed = _share_of_way(time, earlier, place), _interpolated(time, v, earlier, place)
        if np.sign(v[place - 1]) * np.sign(speed) < 0.0:  # along the samples of the same direction
            way = 1.0
        elif np.sign(v[place]) * np.sign(speed) < 0.0:
            way = 0.0
        later = _interpolated(time, v, earlier + period, behind)
        change = abs(later - _interpolated(time, v, earlier - period, before)) / 2.0
        share = min(abs(speed) / max(change, MIN_SPEED), 1.0) if earlier == time[i] - delay else 0.0
        acting = (1.0 - way) * force[place - 1] + way * force[place]
        out[i] = share * acting + (1.0 - share) * recorded[i]


@part()
def _next_sample(time: Array, wanted: float, place: int) -> int:
    """Return the first sample from ``place`` on, if not the last one, that is not before a time."""
    while place < time.size - 1 and time[place] < wanted:
        place += 1
    return place


@part()
def _share_of_way(time: Array, wanted: float, place: int) -> float:
    """Return how far a time is on the way to a sample from the one before, from 0 to 1."""
    return float(min(max((wanted - time[place - 1]) / (time[place] - time[place - 1]), 0.0), 1.0))


@part()
def _interpolated(time: Array, values: Array, wanted: float, place: int) -> float:
    """Return a signal between a sample and the one before."""
    way = _share_of_way(time, wanted, place)
    return float((1.0 - way) * values[place - 1] + way * values[place])


def force_delay(model: Model, experiment: Experiment) -> float:
    """Return the time in s by which the model has the force recorded later than the motion; 0 where none was."""
    return model.sum_of_port("force_delay") if "force" in experiment.raw else 0.0


def with_force_in_time(model: Model, experiment: Experiment, inputs: Array) -> Array:
    """Return inputs in which the recorded force stands at the time at which it acted.

    Args:
        model: The model.
        experiment: The experiment.
        inputs: Inputs in the kernel's layout, shape (n, 8).

    Returns:
        Inputs, shape (n, 8); the same array where the model has no such delay.
    """
    delay = force_delay(model, experiment)
    if delay == 0.0:
        return inputs
    moved = inputs.copy()
    moved[:, at.IN_FORCE] = shifted(experiment.time, inputs[:, at.IN_FORCE], delay)
    return moved


SAME_STEP = 1e-9  # of a step: the rounding of stamps


def temperature_reading(time: Array, temperature: Array, time_constant: float, starts: NDArray[np.int64]) -> Array:
    """Return the reading of a first-order sensor, which starts at the gas temperature, after each gap anew.

    The reading is linear in the temperature: of a derivative of the temperature it is that derivative of the reading.

    Args:
        time: Time stamps in s, shape (n,).
        temperature: Gas temperature in K, or derivatives of it by m parameters; shape (n,) or (n, m).
        time_constant: Time constant in s, above 0.
        starts: Samples at which it starts: the first one, and those after gaps.

    Returns:
        Reading in K, of the shape of ``temperature``.

    >>> time = np.arange(0.0, 5.0, 0.01)
    >>> ramp = 293.0 + 10.0 * time
    >>> late = ramp - temperature_reading(time, ramp, 0.3, np.array([0]))
    >>> round(float(late[-1]), 3)  # of a ramp of 10 K/s, once the start is forgotten
    3.0
    """
    columns = np.ascontiguousarray(temperature, dtype=np.float64).reshape(time.size, -1)
    reading = columns.copy()
    _follow(time, columns, starts, time_constant, reading)
    return reading.reshape(temperature.shape)


_lag: Callable[..., float] = compiled(nogil=True)(first_order_lag)


@compiled(nogil=True)
def _follow(time: Array, columns: Array, starts: NDArray[np.int64], time_constant: float, reading: Array) -> None:
    """Follow the columns; an exponential costs more than a step, and most steps of a recording are alike."""
    known, kept, earlier, now = 0.0, 0.0, 0.0, 0.0
    for s in range(starts.size):
        end = starts[s + 1] if s + 1 < starts.size else time.size
        for i in range(starts[s] + 1, end):
            step = time[i] - time[i - 1]
            if not abs(step - known) <= SAME_STEP * step:
                known, kept = step, _lag(step, 0.0, time_constant, 1.0, 0.0)
                earlier, now = _lag(step, 0.0, time_constant, 0.0, 1.0), _lag(step, 1.0, time_constant, 0.0, 0.0)
            for j in range(columns.shape[1]):
                reading[i, j] = kept * reading[i - 1, j] + earlier * columns[i - 1, j] + now * columns[i, j]


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
