"""Simulate a manoeuvre with a model: its readings, and the motion and pressures that limits are checked against."""

from dataclasses import replace

import numpy as np

from pneucli.arrays import Array, read_only
from pneucli.figure import named
from pneucli.plan.bench import Bench, Manoeuvre, Outcome, State, sample
from pneucli.recording import Recording
from pneucli.simulate import layout as at
from pneucli.simulate.kernel_settings import max_motion_step
from pneucli.simulate.model import Model
from pneucli.simulate.run import base_vector_of, kernel_for

DRIVE_BANDWIDTH = 12.0  # Hz, of a bench's own drive that follows a position reference
MAX_RESPONSE_PERIODS = 4.0  # of that frequency: its impulse response has decayed to 2e-8
STANDSTILL_SPEED = 2e-4  # m/s, below which the direction of dry friction is uncertain
FRICTION_PASSES = 2  # evaluations of the force, since friction may depend on the pressure that it needs
STEPS_PER_PERIOD = 4.0  # of a sampling period, while a vessel fills
MAX_FILLING_STEP = 2.5e-4  # s
FOLLOWED = 0.1  # of the range of a position reference


def simulate_manoeuvre(manoeuvre: Manoeuvre, model: Model) -> Outcome:
    """Simulate a manoeuvre from rest.

    Args:
        manoeuvre: The manoeuvre.
        model: The model.

    Returns:
        The prediction, at the sampling period of the bench.
    """
    if manoeuvre.bench.drive in ("motion", "machine"):
        return _follow_motion(manoeuvre, model)
    return _run_kernel(manoeuvre, model)


def is_followed(manoeuvre: Manoeuvre, model: Model) -> bool:
    """Whether a position loop moves the piston: within a dead zone a weak one does not. Small reversals need not."""
    if manoeuvre.bench.drive != "position" or manoeuvre.kind == "small-reversals":
        return True
    outcome, asked = simulate_manoeuvre(manoeuvre, model), np.ptp(sample(manoeuvre.profile, manoeuvre.bench.period))
    return outcome.x is None or bool(np.ptp(outcome.x) >= FOLLOWED * asked)


def start_of(manoeuvre: Manoeuvre, model: Model) -> State:
    """Return the state at rest from which a manoeuvre starts; a valve balances springs and weights."""
    bench = manoeuvre.bench
    if bench.template.kind.vessel:
        return bench.start
    first = bench.start.x if bench.drive == "valve" else manoeuvre.profile[0].start
    if bench.drive in ("valve", "position"):
        return bench.balanced_start(first, _load_at_rest(model, bench, bench.balanced_start(first)) - manoeuvre.force)
    if bench.drive == "motion" and manoeuvre.pressure is not None:
        bench = replace(bench, start=replace(bench.start, x=first, p2=manoeuvre.pressure))
    return bench.balanced_start(first)


def _run_kernel(manoeuvre: Manoeuvre, model: Model) -> Outcome:
    """Run the model under a command at the valve, or under a proportional position loop."""
    bench, template = manoeuvre.bench, manoeuvre.bench.template
    command = sample(manoeuvre.profile, bench.period)
    time = np.asarray(bench.period * np.arange(command.size), dtype=np.float64)
    gain = bench.gain if bench.drive == "position" else 0.0
    kernel, out = kernel_for(model.effects), np.zeros((command.size, at.OUTPUTS))
    valves = model.valve_of_chamber(template.chamber), model.chamber_2_valve
    parts = template.kind.parts(
        vessel_is_chamber=bench.rig.vessel_is_chamber,
        supply_recorded="p_supply" in bench.signals,
        chamber_2=template.chamber_2,
    )
    kernel.run(
        read_only(time),
        _kernel_inputs(manoeuvre, model, command, gain),
        np.zeros(1, dtype=np.int64),
        _base_vector(manoeuvre, model),
        kernel.effect_vector(model.effect_values()),
        kernel.effect_switches([e.name for e in model.effects if e.part in parts]),
        _flags(manoeuvre),
        *(read_only(valve.table(bench.command_range)) for valve in valves),
        *2 * (_max_step(bench),),
        np.zeros(1),
        np.array([gain, abs(bench.rig.valve_null) + bench.command_range]),
        out,
    )
    readings = _kernel_readings(manoeuvre, model, command, out)
    into_1 = np.maximum(out[:, at.FLOW], 0.0) if template.chamber_2 != "valve" else np.abs(out[:, at.FLOW])
    air = float(np.sum(into_1) * bench.period)
    if template.kind.vessel:
        return Outcome(time, readings, out[:, at.P1], air=air)
    return Outcome(time, readings, out[:, at.P1], out[:, at.P2], out[:, at.X], out[:, at.V], air)


def _kernel_inputs(manoeuvre: Manoeuvre, model: Model, command: Array, gain: float) -> Array:
    """Return the inputs (n, 8): commands or reference, supply, force, and the start in every row.

    The loop of the kernel has its zero at 0 V: the null command is a shift of the reference.
    """
    bench, start = manoeuvre.bench, start_of(manoeuvre, model)
    null, inputs = bench.rig.valve_null, np.zeros((command.size, len(at.INPUTS)))
    inputs[:, at.IN_SUPPLY], inputs[:, at.IN_FORCE] = start.p_supply, manoeuvre.force
    inputs[:, [at.IN_X, at.IN_P1, at.IN_P2]] = start.x, start.p1, start.p2
    inputs[:, at.IN_U] = command + null / gain if gain > 0.0 else command
    inputs[:, at.IN_U2] = 2.0 * null - command
    if bench.template.kind.vessel and bench.rig.command_sign(bench.template.chamber) < 0.0:
        inputs[:, at.IN_U] = 2.0 * null - inputs[:, at.IN_U]
    return inputs


def _base_vector(manoeuvre: Manoeuvre, model: Model) -> Array:
    bench = manoeuvre.bench
    volume = model.values.get("rig.vessel_volume", bench.rig.vessel_volume or 0.0)
    return base_vector_of(model, volume if bench.template.kind.vessel else None, manoeuvre.added_mass)


def _kernel_readings(manoeuvre: Manoeuvre, model: Model, command: Array, out: Array) -> dict[str, Array]:
    """Return what sensors and logger read, each (n,)."""
    bench = manoeuvre.bench
    null, span = bench.rig.valve_null, bench.command_range
    commanded = np.clip(out[:, at.U], null - span, null + span) if bench.drive == "position" else command
    columns = {"p1": at.R1, "p2": at.R2, "x": at.X, "v": at.V, "a": at.A, "temperature": at.GAS_T, "flow": at.FLOW}
    return {name: out[:, column] for name, column in columns.items()} | {
        "u": commanded,
        "u2": 2.0 * null - commanded,
        "x_ref": command,
        "p_supply": np.full(command.size, start_of(manoeuvre, model).p_supply),
        "force": np.full(command.size, manoeuvre.force),
    }


def _flags(manoeuvre: Manoeuvre) -> Array:
    bench, template = manoeuvre.bench, manoeuvre.bench.template
    flags = np.zeros(at.FLAGS)
    flags[at.MECHANICS], flags[at.PNEUMATICS] = template.kind.cylinder, template.kind.valve
    flags[at.LOOP] = bench.drive == "position"
    flags[at.U_MAX] = bench.command_range
    flags[at.VALVE_SHUT] = manoeuvre.kind == "shut-valve"
    flags[at.STATED_SUPPLY] = "p_supply" not in bench.signals and bench.rig.supply_pressure is not None
    flags[at.CHAMBER_2] = at.CLOSED
    if template.kind.vessel or template.chamber_2 == "open":
        flags[at.CHAMBER_2] = at.OPEN
    elif template.chamber_2 == "valve":  # the second of two valves gets the negated command: as one spool
        flags[at.CHAMBER_2] = at.MIRRORED
    return flags


def _max_step(bench: Bench) -> float:
    if bench.template.kind.vessel:
        return min(MAX_FILLING_STEP, bench.period / STEPS_PER_PERIOD)
    return max_motion_step(bench.rig, bench.period)


def _follow_motion(manoeuvre: Manoeuvre, model: Model) -> Outcome:
    """Return the pressures, or the machine's force, that a model needs for the motion of a bench's own drive."""
    bench, template, rig = manoeuvre.bench, manoeuvre.bench.template, manoeuvre.bench.rig
    reference = sample(manoeuvre.profile, bench.period)
    x = _followed(reference, bench.period)
    v = np.gradient(x, bench.period)
    a = np.gradient(v, bench.period)
    start = start_of(manoeuvre, model)
    p2 = _chamber_2_pressure(bench, model, x, start.p2)
    base = model.base_values()
    area_1, area_2, ambient = base["rig.piston_area_1"], base["rig.piston_area_2"], rig.ambient_pressure
    if bench.drive == "machine":
        p1 = np.full(x.size, manoeuvre.pressure or start.p1)
        force = needed_force(model, bench, (x, v, a), (p1, p2))
        net = area_1 * (p1 - ambient) - area_2 * (p2 - ambient)
        force = force - net if "force" in bench.signals else force
    else:
        p1 = np.full(x.size, start.p1)
        for _ in range(FRICTION_PASSES):
            needed = needed_force(model, bench, (x, v, a), (p1, p2)) + manoeuvre.added_mass * a
            force = needed - manoeuvre.force
            if template.chamber_2 == "valve" and area_2 > 0.0:  # both chambers share the force about their mean
                mean = start.p1
                p1, p2 = mean + 0.5 * force / area_1, mean - 0.5 * force / area_2
            else:
                p1 = ambient + (force + area_2 * (p2 - ambient)) / area_1
        force = np.full(x.size, manoeuvre.force)
    read_1, read_2 = (_static_reading(model, f"read_{name}", p) for name, p in (("p1", p1), ("p2", p2)))
    readings = {"x": x, "v": v, "a": a, "p1": read_1, "p2": read_2, "force": force, "x_ref": reference}
    readings |= {"p_supply": np.full(x.size, start.p_supply), "u": np.zeros(x.size), "u2": np.zeros(x.size)}
    time = np.asarray(bench.period * np.arange(x.size), dtype=np.float64)
    swept = area_1 * float(np.sum(np.maximum(np.diff(x), 0.0)))
    air = float(np.mean(p1)) * swept / (rig.gas_constant * rig.gas_temperature)
    return Outcome(time, readings, p1, p2, x, v, air, lowest_pressure=0.97 * ambient)


def _followed(reference: Array, period: float) -> Array:
    """Return the motion (n,) of a drive of second order (Butterworth) that follows a reference."""
    if 0.5 / period <= DRIVE_BANDWIDTH:
        return reference
    phase = (
        np.sqrt(0.5)
        * 2.0
        * np.pi
        * DRIVE_BANDWIDTH
        * period
        * np.arange(MAX_RESPONSE_PERIODS / (DRIVE_BANDWIDTH * period))
    )
    response = np.exp(-phase) * np.sin(phase)
    before = np.full(response.size - 1, reference[0])
    return np.convolve(np.concatenate([before, reference]), response / response.sum(), "valid")


def _chamber_2_pressure(bench: Bench, model: Model, x: Array, start: float) -> Array:
    """Return the pressure of chamber 2 (n,): ambient, or that of enclosed gas, isentropic about its start."""
    base = model.base_values()
    if bench.template.chamber_2 == "open" or bench.drive == "machine":
        return np.full(x.size, bench.rig.ambient_pressure)
    if bench.template.chamber_2 != "closed" or not bench.rig.stroke:
        return np.full(x.size, start)
    dead = base["rig.dead_volume_2"] or 0.1 * base["rig.piston_area_2"] * bench.rig.stroke
    volume = dead + base["rig.piston_area_2"] * (bench.rig.stroke - x)
    return np.asarray(start * (volume[0] / np.maximum(volume, 1e-9)) ** base["rig.heat_capacity_ratio"])


def needed_force(
    model: Model, bench: Bench, motion: tuple[Array, Array, Array], pressures: tuple[Array, Array]
) -> Array:
    """Return the net force that a model needs for a motion.

    Args:
        model: The model.
        bench: The bench.
        motion: Position in m, velocity in m/s and acceleration in m/s^2, each (n,).
        pressures: Pressures of both chambers in Pa, each (n,), on which friction may depend.

    Returns:
        Force in N toward +x, shape (n,).
    """
    kernel, (x, v, a) = kernel_for(model.effects), motion
    inputs, out = np.zeros((x.size, len(at.INPUTS))), np.zeros(x.size)
    inputs[:, at.IN_X], inputs[:, at.IN_V] = x, v
    inputs[:, at.IN_P1], inputs[:, at.IN_P2] = pressures
    parts = bench.template.kind.parts(
        vessel_is_chamber=False, supply_recorded=True, chamber_2=bench.template.chamber_2
    ) - {"sensor"}
    base = model.base_values()
    kernel.functions.run_imposed(
        read_only(bench.period * np.arange(x.size, dtype=np.float64)),
        inputs,
        a,
        STANDSTILL_SPEED,
        False,
        np.array([base[name] for name in at.BASE_NAMES]),
        kernel.effect_vector(model.effect_values()),
        kernel.effect_switches([e.name for e in model.effects if e.part in parts]),
        out,
    )
    return out


def _load_at_rest(model: Model, bench: Bench, start: State) -> float:
    """Return the force in N against +x that springs and weights exert on the resting piston."""
    still, x = np.zeros(1), np.full(1, start.x)
    return float(needed_force(model, bench, (x, still, still), (np.full(1, start.p1), np.full(1, start.p2)))[0])


def _static_reading(model: Model, port: str, pressure: Array) -> Array:
    """Return the reading (n,) of a pressure sensor, whose static characteristic is a line."""
    ambient = model.rig.ambient_pressure
    low, high = (model.chain_of_port(port, p, ambient) for p in (ambient, 2.0 * ambient))
    return np.asarray(low + (high - low) * (pressure - ambient) / ambient)


def synthetic_recording(manoeuvre: Manoeuvre, outcome: Outcome, name: str, seed: int) -> Recording:
    """Return the recording that the bench would make of a manoeuvre, with the noise of its sensors.

    Args:
        manoeuvre: The manoeuvre.
        outcome: Its prediction.
        name: Name of the recording.
        seed: Seed of the noise.

    Returns:
        The recording.
    """
    bench, template = manoeuvre.bench, manoeuvre.bench.template
    rng = np.random.default_rng(seed)
    signals = {}
    for signal in bench.signals:
        if signal in outcome.readings:
            sensor = bench.noise.get(signal)
            drawn = sensor.draw(outcome.time, rng) if sensor is not None and signal not in ("u", "u2", "x_ref") else 0.0
            signals[signal] = outcome.readings[signal] + drawn
    if manoeuvre.force and "force" not in signals:
        signals["force"] = np.full(outcome.time.size, manoeuvre.force)
    noise = {n: model for n, model in bench.noise.items() if n in signals}
    return replace(
        template,
        **named(manoeuvre, "use added_mass"),
        name=name,
        time=outcome.time,
        signals=signals,
        noise=noise,
        valve_shut=manoeuvre.kind == "shut-valve",
    )
