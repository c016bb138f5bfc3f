"""Logs of a running controller, a part of ``compare``: its commands as a channel, and the predicted loop."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from pneucli import paths
from pneucli.closed_loop.log_replay import (
    ControllerLog,
    Engine,
    Replay,
    find_replay,
    log_on_grid,
    log_resolution,
    logged_loop,
    predict_loop,
    replay_rounding_error,
    setup_from_recording,
)
from pneucli.closed_loop.metrics import evaluate_run
from pneucli.closed_loop.simulation import ClosedLoopSetup, Run, replay_log
from pneucli.compare import Comparison
from pneucli.compare.channel_errors import evaluate_channel
from pneucli.config import recording_sources
from pneucli.controller import layout
from pneucli.export.controller_file import ExportedController, load_controller
from pneucli.export.single_precision import replay_in_single_precision
from pneucli.pipeline.context import Context
from pneucli.recording import Recording
from pneucli.simulate.model import Model
from pneucli.stages.law_comparison import metrics_answer

UNKNOWN_CONTROLLER = "unknown"
MIN_COMMAND_ERROR = 1e-9  # V, within which any two programs of one controller agree


@dataclass(frozen=True)
class ReplayedLog:
    """A log, the controller that ran, and its replay."""

    recording: Recording
    exported: ExportedController
    log: ControllerLog
    engine: Engine
    replay: Replay


def controllers_by_recording(context: Context) -> dict[str, ExportedController]:
    """Return the controllers that ran, by recording; unnamed ones are left out. Raises InputError."""
    found = {}
    for source in recording_sources(context.config):
        name = source.table.controller
        if name is not None and name != UNKNOWN_CONTROLLER:
            where = f"{source.where}.controller"
            found[source.name] = load_controller(paths.expand_path(name, context.path.parent, where), where)
    return found


def replay_recording(model: Model, recording: Recording, exported: ExportedController) -> ReplayedLog:
    """Replay one log; raises InputError where it was not logged at every sample."""
    log, controller = log_on_grid(recording, exported.controller), exported.controller
    engine: Engine = partial(replay_log, model, controller)
    if exported.precision == "float32":
        engine = partial(replay_in_single_precision, controller)
    return ReplayedLog(recording, exported, log, engine, find_replay(engine, log))


def with_commands(found: Comparison, replayed: Mapping[str, ReplayedLog], model: Model) -> Comparison:
    """Return a comparison with the logged commands as further channels, held against those of the replay, if any."""
    recording = found.experiment.recording
    if recording.name not in replayed:
        return found
    looked = replayed[recording.name]
    replay, places = looked.replay, looked.log.grid_indices
    # a position that is counted is logged as it is
    rounded = {n: log_resolution(recording[n]) for n in ("x", "x_ref", "p1", "p2", "p_supply") if n in recording}
    steps = {n: step for n, step in rounded.items() if n == "x_ref" or _noise_rms(recording, n) > step > 0.0}
    off = replay_rounding_error(looked.engine, looked.log, replay, steps) if steps else 0.0
    names = ["u", *(["u2"] if "u2" in recording else [])]
    read = {name: recording[name] for name in names}
    commands = {name: replay.commands[places, i] for i, name in enumerate(names)}
    results = tuple(
        evaluate_channel(found.experiment, n, read[n], commands[n], _command_error_floor(recording, n, off))
        for n in names
    )
    return replace(
        found,
        results=found.results + results,
        measured={**found.measured, **read},
        modelled={**found.modelled, **commands},
    )


def _noise_rms(recording: Recording, name: str) -> float:
    return recording.noise[name].rms if name in recording.noise else 0.0


def _command_error_floor(recording: Recording, name: str, off: float) -> float:
    """Return what a right replay differs by in V: the rounding of readings, and that of the command."""
    return max(float(np.hypot(off, log_resolution(recording[name]) / np.sqrt(12.0))), MIN_COMMAND_ERROR)


def log_answer(looked: ReplayedLog, model: Model) -> dict[str, Any]:
    """Return the predicted and the measured figures of a logged closed loop."""
    controller = looked.exported.controller
    expected = predict_loop(model, controller, looked.log, setup_from_recording(looked.recording, ClosedLoopSetup()))
    came = logged_loop(model, controller, looked.log, looked.replay)
    return {
        "recording": looked.recording.name,
        "use": looked.recording.use,
        "controller": controller.law,
        "hash": looked.exported.hash,
        "precision": looked.exported.precision,
        "began": looked.replay.start_mode,
        "supply_told": "p_supply" in looked.replay.readings,
        "foretold": _loop_answer(expected, model, looked),
        "measured": _loop_answer(came, model, looked),
    }


def _loop_answer(run: Run, model: Model, looked: ReplayedLog) -> Mapping[str, Any]:
    return metrics_answer(evaluate_run(run, model, looked.exported.controller)) | mean_estimates(run)


def mean_estimates(run: Run) -> dict[str, float]:
    """Return the means of the controller's estimates: of the load in N, and of the flow past the valve in Pa/s."""
    return {
        "load_estimate_n": float(np.mean(run.log[:, layout.L_LOAD])),
        "flow_estimate_pa_s": float(np.mean(run.log[:, layout.L_FLOW1])),
    }
