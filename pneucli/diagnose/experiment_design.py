"""What to record next: of the manoeuvres that the models can be run through, the one that tells two of them apart."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

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


@dataclass(frozen=True)
class Discrimination:
    """How far two models are apart in a manoeuvre: the rms of their difference in the channel that shows it best."""

    manoeuvre: str
    channel: str
    times_noise: float


def most_discriminating_experiment(one: Model, other: Model, views: Sequence[ResidualModel]) -> Discrimination | None:
    """Return the manoeuvre that separates two fitted models most; None where none does by more than its noise.

    Only manoeuvres that the benches of ``views`` can do: commands where a valve was driven, pressures where they were
    imposed on a cylinder. The models are taken as they are, not fitted again: what they agree on they were fitted to.
    """
    noise = {c: n.rms for view in views for c, n in view.experiment.noise.items() if n.rms > 0.0}
    found = [
        Discrimination(words, channel, apart / noise[channel])
        for words, experiment in candidate_experiments(one, views)
        for channel, apart in _rms_differences(one, other, experiment).items()
        if channel in noise and np.isfinite(apart)
    ]
    best = max(found, key=lambda s: s.times_noise, default=None)
    return best if best is not None and best.times_noise > MIN_SEPARATION else None


def _rms_differences(one: Model, other: Model, experiment: Experiment) -> dict[str, float]:
    a, b = simulate_outputs(one, experiment), simulate_outputs(other, experiment)
    return {channel: float(np.sqrt(np.mean((a[channel] - b[channel]) ** 2))) for channel in a}


def candidate_experiments(model: Model, views: Sequence[ResidualModel]) -> Iterator[tuple[str, Experiment]]:
    """Yield words and a ready experiment for each manoeuvre that the benches of the views allow."""
    benches = {view.experiment.recording.experiment: view.experiment for view in views}
    for seen in benches.values():
        if seen.recording.imposed or seen.recording.valve_shut or _two_commands(seen):
            continue
        if not seen.recording.kind.valve:
            for words, push in _force_profiles(FORCE_FACTOR * max(parameter_value(model, "friction.coulomb"), 1.0)):
                yield words, prepare(_imposed_force_recording(push, seen.rig), seen.rig, None)
        elif "u" in seen.raw:
            null = seen.rig.valve_null
            largest = float(np.abs(seen.inputs[:, at.IN_U] - null).max()) or 1.0
            for words, command in _commands(largest):
                yield f"{words} ({seen.recording.kind.bench})", _commanded(null + command, seen)


def _two_commands(seen: Experiment) -> bool:
    return seen.recording.chamber_2 == "valve" and seen.rig.arrangement.chamber_2 == "own"


def _steps(values: Sequence[float], dwell: float) -> Array:
    return np.repeat(np.asarray(values, dtype=np.float64), round(dwell / SAMPLING_PERIOD))


def _time(duration: float) -> Array:
    return np.arange(0.0, duration, SAMPLING_PERIOD)


def _commands(u: float) -> Iterator[tuple[str, Array]]:
    yield f"charge with {u:.3g} V for 2 s, shut the valve and hold for 30 s", _steps([u, *[0.0] * 15], 2.0)
    yield f"discharge with {-u:.3g} V for 2 s, shut the valve and hold for 30 s", _steps([u, -u, *[0.0] * 15], 2.0)
    yield f"full steps of {u:.3g} V, up and down every 0.5 s", _steps([u, -u] * 6, 0.5)
    yield (
        f"stairs of {0.1 * u:.2g} to {0.3 * u:.2g} V, up and down, 1 s each",
        _steps([step * u for step in (0.1, -0.1, 0.2, -0.2, 0.3, -0.3)] * 2, 1.0),
    )
    for frequency in (0.5, 3.0, 10.0):
        yield f"a sine of {0.5 * u:.3g} V at {frequency:g} Hz", 0.5 * u * np.sin(2 * np.pi * frequency * _time(6.0))


def _commanded(command: Array, seen: Experiment) -> Experiment:
    values: dict[str, Any] = {"experiment": seen.recording.experiment}
    if seen.recording.chamber_2 in ("open", "valve"):
        values["chamber_2"] = seen.recording.chamber_2
    if "p_supply" in seen.raw and seen.rig.supply_pressure:
        values["p_supply"] = seen.rig.supply_pressure
    return prepare(command_recording(command, values, seen.rig), seen.rig, None)


def _force_profiles(force: float) -> Iterator[tuple[str, tuple[Array, Array]]]:
    """Yield words, and the force on the piston in N with the pressure of chamber 2 in Pa, over time."""
    slow = np.abs((0.5 * _time(6.0) + 0.5) % 2.0 - 1.0) * 2.0 - 1.0  # a triangle between -1 and 1
    levels = np.repeat(CHAMBER_2_PRESSURES, slow.size)
    yield "slow triangles of the pressure difference at 2, 4 and 6 bar (absolute)", (force * np.tile(slow, 3), levels)
    for frequency in (1.0, 4.0):
        wave = force * np.sin(2 * np.pi * frequency * _time(6.0))
        yield (
            f"a sine of the pressure difference at {frequency:g} Hz and 4 bar (absolute)",
            (wave, np.full(wave.size, CHAMBER_2_PRESSURES[1])),
        )
    rests = [np.concatenate([_steps([0.0], rest), force * _time(0.4) / 0.4]) for rest in (0.1, 1.0, 10.0)]
    pushed = np.concatenate(rests)
    yield "slow pushes after rests of 0.1, 1 and 10 s", (pushed, np.full(pushed.size, CHAMBER_2_PRESSURES[1]))


def _imposed_force_recording(push: tuple[Array, Array], rig: Rig) -> Recording:
    """Return the recording in which the pressures give the force: chamber 2 as stated, chamber 1 to match."""
    (force, p2), (area_1, area_2) = push, rig.piston_areas
    p1 = rig.ambient_pressure + (area_2 * (p2 - rig.ambient_pressure) + force) / area_1
    start = {"x": np.full(force.size, 0.5 * (rig.stroke or 0.2)), "v": np.zeros(force.size)}
    return noise_free_recording("friction", {"p1": p1, "p2": p2, **start}, "closed")
