"""Logs of a running controller: replay of its commands from its readings, and prediction of the loop by the model."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pneucli.arrays import Array, Integers
from pneucli.closed_loop.simulation import ClosedLoopSetup, Run, Scenario, simulate
from pneucli.controller import layout
from pneucli.controller.parameters import Controller
from pneucli.errors import InputError
from pneucli.messages.formatting import format_plain
from pneucli.recording import Recording
from pneucli.simulate import layout as at
from pneucli.simulate.model import Model

Engine = Callable[[Mapping[str, Array], str], Array]  # signals of a log and how it began -> rows (n, L_ROW)

START_MODES = ("with", "before", "commission")
SMALL_ROUNDING = 0.01  # of what a log rounds away
NOISE_DRAWS = 8
PERIOD_TOLERANCE = 0.01  # share by which the periods of log and controller may differ
SEED = 0


@dataclass(frozen=True)
class ControllerLog:
    """A log on the sample grid of the controller, NaN at gaps.

    Attributes:
        signals: Signals (n,) by name, in SI.
        grid_indices: Index on the grid of each sample of the recording.

    """

    signals: dict[str, Array]
    grid_indices: Integers

    def __getitem__(self, name: str) -> Array:
        return self.signals[name]


@dataclass(frozen=True)
class Replay:
    """Commands of the controller at the readings of a log.

    Attributes:
        log: Rows of the log of :mod:`pneucli.controller.layout` (n, L_ROW).
        start_mode: How the controller began.
        readings: The signals that it is assumed to have read, a logged supply pressure included if it received it.

    """

    log: Array
    start_mode: str
    readings: Mapping[str, Array]

    @property
    def commands(self) -> Array:
        """The commands in V, shape (n, 2)."""
        return self.log[:, [layout.L_U1, layout.L_U2]]


def log_on_grid(recording: Recording, controller: Controller) -> ControllerLog:
    """Return a recording on the sample grid of the controller; raises InputError if samples are missing."""
    if abs(recording.period - controller.period) > PERIOD_TOLERANCE * controller.period:
        own, wanted = format_plain(recording.period), format_plain(controller.period)
        found = f"a sample every {own} s, and the controller has a period of {wanted} s"
        mend = 'log every sample of the controller, or write controller = "unknown"'
        raise InputError(f"recording {recording.name}", found, "one sample a period", mend, code="E045")
    places = np.rint((recording.time - recording.time[0]) / recording.period).astype(np.int64)
    signals = {}
    for name, values in recording.signals.items():
        signals[name] = np.full(places[-1] + 1, np.nan)
        signals[name][places] = values
    return ControllerLog(signals, places)


def find_replay(engine: Engine, log: ControllerLog) -> Replay:
    """Return the replay of a log that explains the logged commands best.

    Alternatives: the controller began with the log, began a commissioning with it, or had run before (then a reset from
    the first readings and commands); it received a logged supply pressure, or not.
    """
    alternatives = [log.signals]
    if "p_supply" in log.signals:
        alternatives.append({name: values for name, values in log.signals.items() if name != "p_supply"})
    found = [Replay(engine(read, began), began, read) for read in alternatives for began in START_MODES]
    return min(found, key=lambda one: float(np.nanmean((one.commands[:, 0] - log["u"]) ** 2)))


def replay_rounding_error(engine: Engine, log: ControllerLog, replay: Replay, steps: Mapping[str, float]) -> float:
    """Return the error of a replay in V (rms) that the rounding of the log causes; ``steps`` in SI by signal.

    Draws of the rounding give it. Most commands follow the rounding linearly; a few decisions, such as a hold, fall a
    sample earlier or later and dominate the rms. The linear part follows from a hundredth of the rounding and is the
    lower bound.
    """
    rng, squares = np.random.default_rng(SEED), []
    for size in (SMALL_ROUNDING, *NOISE_DRAWS * (1.0,)):
        shaken = dict(replay.readings)
        for name in sorted(steps.keys() & shaken.keys()):
            moves = _is_moving(log[name]) if name == "x_ref" else 1.0  # a reference that rests is none that is rounded
            noise = size * steps[name] / np.sqrt(12.0) * rng.standard_normal(log[name].size)
            shaken[name] = log[name] + moves * noise
        off = np.abs(engine(shaken, replay.start_mode)[:, layout.L_U1] - replay.commands[:, 0])
        kept = off[off <= np.percentile(off, 99.0)] if size == SMALL_ROUNDING else off
        squares.append(float(np.mean(kept**2)) / size**2)
    return math.sqrt(max(squares[0], math.fsum(squares[1:]) / NOISE_DRAWS))


def _is_moving(values: Array) -> Array:
    """Return 1 where a signal differs from its neighbours before and after, else 0."""
    changes = np.concatenate([[False], np.diff(values) != 0.0, [False]])
    return np.asarray(changes[:-1] & changes[1:], dtype=np.float64)


def log_resolution(values: Array) -> float:
    """Return the decimal step to which a log rounds a signal, in its unit; 0 for none."""
    steps = np.abs(np.diff(values[np.isfinite(values)]))
    steps = steps[steps > 0.0]
    if not steps.size:
        return 0.0
    digits = int(np.floor(np.log10(steps.max())))
    least = np.log10(max(1e3 * np.spacing(np.nanmax(np.abs(values))), 1e-300))
    for power in range(digits, int(np.ceil(least)) - 1, -1):
        counts = steps / 10.0**power
        if np.all((np.abs(counts - np.rint(counts)) < 1e-2) & (counts > 0.5)):
            return float(10.0**power)
    return 0.0


def predict_loop(model: Model, controller: Controller, log: ControllerLog, setup: ClosedLoopSetup) -> Run:
    """Return the closed loop by the model under the references of a log, from its start on.

    Noise decides where the piston sticks at each reversal: of ``NOISE_DRAWS`` draws, the one with the median error.
    """
    scenario = _scenario(model, controller, log)
    runs = [simulate(model, controller, scenario, setup, SEED + k) for k in range(NOISE_DRAWS)]
    return sorted(runs, key=lambda one: float(np.mean((one.model[:, at.X] - scenario.reference) ** 2)))[
        NOISE_DRAWS // 2
    ]


def logged_loop(model: Model, controller: Controller, log: ControllerLog, replay: Replay) -> Run:
    """Return the logged loop in the form of a simulated one; its estimates are those of the replay."""
    scenario = _scenario(model, controller, log)
    out, rows = np.zeros((scenario.reference.size, at.OUTPUTS)), replay.log.copy()
    for place, name in ((at.X, "x"), (at.P1, "p1"), (at.P2, "p2")):
        out[:, place] = _interpolate_gaps(log[name]) if name in log.signals else np.nan
    rows[:, layout.L_U1] = _interpolate_gaps(log["u"])
    if "u2" in log.signals:
        rows[:, layout.L_U2] = _interpolate_gaps(log["u2"])
    time: Array = controller.period * np.arange(scenario.reference.size, dtype=np.float64)
    return Run(scenario, time, out, rows)


def _scenario(model: Model, controller: Controller, log: ControllerLog) -> Scenario:
    reference, n = _interpolate_gaps(log["x_ref"]), log["x_ref"].size
    base = model.base_values()
    p1 = _interpolate_gaps(log["p1"])[0]
    p2 = _interpolate_gaps(log["p2"])[0] if "p2" in log.signals else controller.values["C_P_MEAN"]
    supply = (
        _interpolate_gaps(log["p_supply"]) if "p_supply" in log.signals else np.full(n, base["rig.supply_pressure"])
    )
    force = _interpolate_gaps(log["force"]) if "force" in log.signals else np.zeros(n)
    start = float(_interpolate_gaps(log["x"])[0]), float(p1), float(p2)
    return Scenario("log", reference, force, supply, start)


def _interpolate_gaps(values: Array) -> Array:
    """Return a signal with its gaps interpolated linearly."""
    known = np.flatnonzero(np.isfinite(values))
    return np.interp(np.arange(values.size), known, values[known]) if known.size else np.zeros(values.size)


def setup_from_recording(recording: Recording, designed_setup: ClosedLoopSetup) -> ClosedLoopSetup:
    """Return sensors with the noise of a recording; other values are those of the design."""
    noise = recording.noise
    x, p = noise.get("x"), noise.get("p1")
    coarse = x is not None and x.rms <= x.step
    return replace(
        designed_setup,
        noise_x=designed_setup.noise_x if x is None else 0.0 if coarse else x.rms,
        quantum_x=designed_setup.quantum_x if x is None else x.step,
        noise_p=designed_setup.noise_p if p is None else p.rms,
    )
