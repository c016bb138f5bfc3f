"""Open-loop scenarios: the model alone, on recorded inputs or on a command, without restarts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from pneucli.arrays import Array
from pneucli.errors import InputError, require_known
from pneucli.experiments import EXPERIMENT_KINDS, ExperimentName
from pneucli.messages.formatting import format_plain
from pneucli.messages.simulate import SimulatedChannel
from pneucli.noise import NoiseModel
from pneucli.quantities import SIGNALS
from pneucli.recording import Recording, Rig
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.outputs import simulate_outputs
from pneucli.simulate.preparation import prepare
from pneucli.units import read_quantity

SAMPLING_PERIOD = 1e-3  # s, between the samples of a command
MAX_DURATION = 1e4  # s of a command
COMMANDS = ("steps", "sine", "ramp", "recorded")
VALVE_EXPERIMENTS = tuple(name for name, kind in EXPERIMENT_KINDS.items() if kind.simulated)
CHOICES = {
    "experiment": VALVE_EXPERIMENTS,
    "chamber_2": ("closed", "open", "valve"),
    "command": COMMANDS,
}
UNITS = {
    "amplitude": "V",
    "offset": "V",
    "frequency": "Hz",
    "dwell": "s",
    "duration": "s",
    "x": "m",
    "p1": "Pa",
    "p2": "Pa",
    "p_supply": "Pa",
}
KEYS = ("kind", "name", "recording", "values", *CHOICES, *UNITS)


@dataclass(frozen=True)
class OpenLoopRun:
    """One scenario: time in s, commands, simulated and measured channels; each (n,), SI."""

    scenario: str
    time: Array
    commands: Mapping[str, Array]
    modelled: Mapping[str, Array]
    measured: Mapping[str, Array]

    def metrics(self) -> list[SimulatedChannel]:
        """Return lowest, highest and last value of each channel, and RMSD and fit where it was measured."""
        return [self._metrics(channel) for channel in self.modelled]

    def _metrics(self, channel: str) -> SimulatedChannel:
        values = self.modelled[channel]
        least, most, end = float(values.min()), float(values.max()), float(values[-1])
        return SimulatedChannel(channel, SIGNALS[channel].unit, least, most, end, *self._error(channel))

    def _error(self, channel: str) -> tuple[float | None, float | None]:
        """Return RMSD and fit in per cent."""
        if channel not in self.measured:
            return None, None
        error = self.measured[channel] - self.modelled[channel]
        valid = np.isfinite(error)
        y = self.measured[channel][valid]
        spread = float(np.linalg.norm(y - y.mean()))
        fit = 100 * (1 - float(np.linalg.norm(error[valid])) / spread) if spread else None
        return float(np.sqrt(np.mean(error[valid] ** 2))), fit


def default_free_runs(model: Model, experiments: Sequence[Experiment]) -> list[OpenLoopRun]:
    """Return the free runs of the test recordings of each experiment, of its first recording where none is for testing.

    Recordings with imposed motion are left out: they have nothing that runs freely.

    Args:
        model: The model.
        experiments: Experiments.

    Returns:
        The runs.
    """
    free = [e for e in experiments if e.recording.imposed is None]
    chosen: list[Experiment] = []
    for kind in dict.fromkeys(e.recording.experiment for e in free):
        of_kind = [e for e in free if e.recording.experiment == kind]
        chosen += [e for e in of_kind if e.recording.use == "test"] or of_kind[:1]
    return [free_run(model, experiment, experiment.recording.name) for experiment in chosen]


def free_run(model: Model, experiment: Experiment, name: str) -> OpenLoopRun:
    """Simulate an experiment from its measured start, with restarts after gaps only.

    Args:
        model: The model.
        experiment: The experiment.
        name: Name of the run.

    Returns:
        The run with the measured channels.
    """
    once = experiment.with_restarts(None)
    measured = {channel: once.measured(channel) for channel in once.channels}
    return OpenLoopRun(name, once.time, _commands(once), simulate_outputs(model, once), measured)


def _commands(experiment: Experiment) -> dict[str, Array]:
    return {name: experiment.raw[name] for name in ("u", "u2") if name in experiment.raw}


def run_scenario(
    model: Model, table: Mapping[str, Any], experiments: Mapping[str, Experiment], where: str
) -> OpenLoopRun:
    """Simulate one table of ``[[scenarios]]``.

    ``command = "recorded"`` replays ``recording``. ``steps`` holds each of ``values`` for ``dwell``, ``sine`` is
    offset + amplitude sin(2 pi frequency t), ``ramp`` goes from offset - amplitude to offset + amplitude. A command
    lasts ``duration`` and starts at rest at ``x`` (default: half the stroke), ``p1`` and ``p2`` (default: ambient).

    Args:
        model: The model.
        table: The table.
        experiments: Experiments by name of their recording.
        where: The place of the table, for messages.

    Returns:
        The run.

    Raises:
        InputError: A key or value cannot be read.
    """
    values = parse_scenario(table, where)
    if values["command"] == "recorded":
        name = str(table.get("recording", ""))
        require_known([name], experiments, f"{where}.recording", wanted="a recording's name", code="E091")
        return free_run(model, experiments[name], str(table.get("name", name)))
    experiment = prepare(command_recording(_command(values), values, model.rig), model.rig, None)
    name = str(table.get("name", values["command"]))
    return OpenLoopRun(name, experiment.time, _commands(experiment), simulate_outputs(model, experiment), {})


def parse_scenario(table: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Parse one table of ``[[scenarios]]``.

    Args:
        table: The table.
        where: The place of the table, for messages.

    Returns:
        Values by key, quantities in SI.

    Raises:
        InputError: A key is unknown, or a value cannot be read.

    >>> parse_scenario({"command": "sine", "amplitude": "500 mV"}, "scenarios[0]")["amplitude"]
    0.5
    """
    values: dict[str, Any] = {"command": "recorded" if "recording" in table else "steps"}
    for key, value in table.items():
        require_known([key], KEYS, f"{where}.{key}", "unknown key", code="E021")
        if key in CHOICES:
            require_known([str(value)], CHOICES[key], f"{where}.{key}", code="E023")
        values[key] = _in_si(key, value, f"{where}.{key}")
    if values["command"] == "steps" and not values.get("values"):
        raise InputError(f"{where}.values", "no steps", 'a list such as ["2 V", "-1 V"]', code="E023")
    for key in ("duration", "dwell", "frequency"):
        if not 0.0 < values.get(key, 1.0) <= MAX_DURATION:
            wanted = f"above 0, at most {format_plain(MAX_DURATION)}"
            raise InputError(f"{where}.{key}", format_plain(values[key]), wanted, code="E023")
    return values


def _in_si(key: str, value: Any, where: str) -> Any:
    if key == "values":
        if not isinstance(value, list):
            raise InputError(where, f"{value!r} is no list", 'a quantity such as "1 V"', code="E024")
        return [read_quantity(one, "V", where) for one in value]
    return read_quantity(value, UNITS[key], where) if key in UNITS else value


def command_recording(command: Array, values: Mapping[str, Any], rig: Rig) -> Recording:
    """Return the recording of a command from a stated state, or from rest.

    Args:
        command: Command in V at ``SAMPLING_PERIOD``, shape (n,).
        values: Kind of experiment and initial state, SI.
        rig: The rig.

    Returns:
        The recording.
    """
    kind = values.get("experiment", "axis" if rig.has_cylinder else "valve")
    start = {"p1": values.get("p1", rig.ambient_pressure)}
    if EXPERIMENT_KINDS[kind].cylinder:
        start |= {
            "p2": values.get("p2", rig.ambient_pressure),
            "x": values.get("x", 0.5 * (rig.stroke or 0.0)),
            "v": 0.0,
        }
    if "p_supply" in values:
        start["p_supply"] = values["p_supply"]
    signals = {"u": command, **{name: np.full(command.size, value) for name, value in start.items()}}
    return noise_free_recording(kind, signals, values.get("chamber_2", "closed"))


def noise_free_recording(
    kind: ExperimentName, signals: Mapping[str, Array], chamber_2: Literal["closed", "open", "valve"]
) -> Recording:
    """Return signals as a recording without noise, on which a model runs.

    Args:
        kind: Kind of experiment.
        signals: Signals at ``SAMPLING_PERIOD``, SI, each (n,).
        chamber_2: What closes chamber 2.

    Returns:
        The recording.
    """
    samples = next(iter(signals.values())).size
    return Recording(
        name="command",
        experiment=kind,
        use="test",
        time=np.arange(samples, dtype=np.float64) * SAMPLING_PERIOD,
        signals=signals,
        noise=dict.fromkeys(signals, NoiseModel(0.0)),
        chamber_2=None if EXPERIMENT_KINDS[kind].vessel else chamber_2,
    )


def _command(values: Mapping[str, Any]) -> Array:
    """Return the command in V, sampled at ``SAMPLING_PERIOD``."""
    amplitude, offset = values.get("amplitude", 1.0), values.get("offset", 0.0)
    if values["command"] == "steps":
        held = round(values.get("dwell", 1.0) / SAMPLING_PERIOD)
        return np.repeat(np.array(values["values"], dtype=np.float64), held)
    time = np.arange(0.0, values.get("duration", 5.0), SAMPLING_PERIOD)
    if values["command"] == "sine":
        return np.asarray(offset + amplitude * np.sin(2 * np.pi * values.get("frequency", 0.5) * time))
    return np.asarray(offset + amplitude * np.linspace(-1.0, 1.0, time.size))
