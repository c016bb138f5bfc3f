"""Experiment design: the manoeuvre in which two fitted models differ most."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.residuals import ResidualModel
from pneucli.recording import Recording, Rig
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model, parameter_value
from pneucli.simulate.open_loop import SAMPLING_PERIOD, command_recording, noise_free_recording
from pneucli.simulate.outputs import simulate_outputs
from pneucli.simulate.preparation import prepare

Array = NDArray[np.float64]

MIN_SEPARATION = 3.0  # times the noise
CHAMBER_2_PRESSURES = (2e5, 4e5, 6e5)  # Pa, of chamber 2
FORCE_FACTOR = 2.5  # times the dry friction


ManoeuvreKind = Literal[
    "charge-and-hold",
    "discharge-and-hold",
    "full-steps",
    "stairs",
    "command-sine",
    "pressure-triangles",
    "pressure-sine",
    "pushes-after-rests",
]


@dataclass(frozen=True)
class Manoeuvre:
    """A recording to make: its kind, the command's level in V and frequency in Hz where it has such, and the bench."""

    kind: ManoeuvreKind
    level: float | None = None
    frequency: float | None = None
    bench: str | None = None


@dataclass(frozen=True)
class Discrimination:
    """The separation of two models in a manoeuvre: the rms of their difference in the channel with the largest one."""

    manoeuvre: Manoeuvre
    channel: str
    times_noise: float


def most_discriminating_experiment(
    one: Model, other: Model, residual_models: Sequence[ResidualModel]
) -> Discrimination | None:
    """Return the manoeuvre that separates two fitted models most; None where none exceeds MIN_SEPARATION.

    It considers only manoeuvres that the benches of the recordings can do: commands where a valve was driven, pressures
    where they were imposed on a cylinder. The models are not fitted again, because both were fitted to all they share.
    """
    noise = {c: n.rms for m in residual_models for c, n in m.experiment.noise.items() if n.rms > 0.0}
    found = [
        Discrimination(manoeuvre, channel, difference / noise[channel])
        for manoeuvre, experiment in candidate_experiments(one, residual_models)
        for channel, difference in _rms_differences(one, other, experiment).items()
        if channel in noise and np.isfinite(difference)
    ]
    best = max(found, key=lambda one: one.times_noise, default=None)
    return best if best is not None and best.times_noise > MIN_SEPARATION else None


def _rms_differences(one: Model, other: Model, experiment: Experiment) -> dict[str, float]:
    a, b = simulate_outputs(one, experiment), simulate_outputs(other, experiment)
    return {channel: float(np.sqrt(np.mean((a[channel] - b[channel]) ** 2))) for channel in a}


def candidate_experiments(
    model: Model, residual_models: Sequence[ResidualModel]
) -> Iterator[tuple[Manoeuvre, Experiment]]:
    """Yield each manoeuvre that the benches of the recordings can do, with a prepared experiment."""
    benches = {m.experiment.recording.experiment: m.experiment for m in residual_models}
    for recorded in benches.values():
        if recorded.recording.imposed or recorded.recording.valve_shut or _has_two_commands(recorded):
            continue
        if not recorded.recording.kind.valve:
            force = FORCE_FACTOR * max(parameter_value(model, "friction.coulomb"), 1.0)
            for manoeuvre, profile in _force_profiles(force):
                yield manoeuvre, prepare(_imposed_force_recording(profile, recorded.rig), recorded.rig, None)
        elif "u" in recorded.raw:
            null = recorded.rig.valve_null
            largest = float(np.abs(recorded.inputs[:, at.IN_U] - null).max()) or 1.0
            for manoeuvre, command in _commands(largest):
                bench = recorded.recording.kind.bench
                yield replace(manoeuvre, bench=bench), _commanded(null + command, recorded)


def _has_two_commands(recorded: Experiment) -> bool:
    return recorded.recording.chamber_2 == "valve" and recorded.rig.arrangement.chamber_2 == "own"


def _steps(values: Sequence[float], dwell: float) -> Array:
    return np.repeat(np.asarray(values, dtype=np.float64), round(dwell / SAMPLING_PERIOD))


def _time(duration: float) -> Array:
    return np.arange(0.0, duration, SAMPLING_PERIOD)


def _commands(u: float) -> Iterator[tuple[Manoeuvre, Array]]:
    """Yield manoeuvres with their commands in V, relative to the null command."""
    yield Manoeuvre("charge-and-hold", u), _steps([u, *[0.0] * 15], 2.0)
    yield Manoeuvre("discharge-and-hold", -u), _steps([u, -u, *[0.0] * 15], 2.0)
    yield Manoeuvre("full-steps", u), _steps([u, -u] * 6, 0.5)
    stairs = [step * u for step in (0.1, -0.1, 0.2, -0.2, 0.3, -0.3)] * 2
    yield Manoeuvre("stairs", u), _steps(stairs, 1.0)
    for frequency in (0.5, 3.0, 10.0):
        yield Manoeuvre("command-sine", 0.5 * u, frequency), 0.5 * u * np.sin(2 * np.pi * frequency * _time(6.0))


def _commanded(command: Array, recorded: Experiment) -> Experiment:
    values: dict[str, Any] = {"experiment": recorded.recording.experiment}
    if recorded.recording.chamber_2 in ("open", "valve"):
        values["chamber_2"] = recorded.recording.chamber_2
    if "p_supply" in recorded.raw and recorded.rig.supply_pressure:
        values["p_supply"] = recorded.rig.supply_pressure
    return prepare(command_recording(command, values, recorded.rig), recorded.rig, None)


def _force_profiles(force: float) -> Iterator[tuple[Manoeuvre, tuple[Array, Array]]]:
    """Yield manoeuvres with the force on the piston in N and the pressure of chamber 2 in Pa over time."""
    triangle = np.abs((0.5 * _time(6.0) + 0.5) % 2.0 - 1.0) * 2.0 - 1.0  # between -1 and 1
    levels = np.repeat(CHAMBER_2_PRESSURES, triangle.size)
    yield Manoeuvre("pressure-triangles"), (force * np.tile(triangle, 3), levels)
    for frequency in (1.0, 4.0):
        wave = force * np.sin(2 * np.pi * frequency * _time(6.0))
        yield Manoeuvre("pressure-sine", None, frequency), (wave, np.full(wave.size, CHAMBER_2_PRESSURES[1]))
    rests = [np.concatenate([_steps([0.0], rest), force * _time(0.4) / 0.4]) for rest in (0.1, 1.0, 10.0)]
    pushes = np.concatenate(rests)
    yield Manoeuvre("pushes-after-rests"), (pushes, np.full(pushes.size, CHAMBER_2_PRESSURES[1]))


def _imposed_force_recording(profile: tuple[Array, Array], rig: Rig) -> Recording:
    """Return the recording in which the pressures make the force: chamber 2 as given, chamber 1 to match."""
    (force, p2), (area_1, area_2) = profile, rig.piston_areas
    p1 = rig.ambient_pressure + (area_2 * (p2 - rig.ambient_pressure) + force) / area_1
    start = {"x": np.full(force.size, 0.5 * (rig.stroke or 0.2)), "v": np.zeros(force.size)}
    return noise_free_recording("friction", {"p1": p1, "p2": p2, **start}, "closed")
