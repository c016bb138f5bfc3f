"""Logs of a running controller, a part of ``compare``: its commands as a channel, and what was foretold of the loop."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from pneucli import paths
from pneucli.closed_loop.log_replay import (
    Engine,
    Log,
    Replayed,
    bench_from,
    foretold,
    log_of,
    measured,
    replayed,
    resolution,
    rounding,
)
from pneucli.closed_loop.metrics import measure
from pneucli.closed_loop.simulation import Bench, Run, replay_rows
from pneucli.compare import Comparison
from pneucli.compare.channel_errors import channel_result
from pneucli.config import sources
from pneucli.controller import layout
from pneucli.export.controller_file import Exported, load
from pneucli.export.single_precision import rows_in_single
from pneucli.pipeline.context import Context
from pneucli.recording import Recording
from pneucli.simulate.model import Model
from pneucli.stages.law_comparison import figures

UNKNOWN = "unknown"
LEAST = 1e-9  # V, within which any two programs of one controller agree


@dataclass(frozen=True)
class Looked:
    """A log, the controller that ran, and its replay."""

    recording: Recording
    exported: Exported
    log: Log
    engine: Engine
    replay: Replayed


def controllers_of(context: Context) -> dict[str, Exported]:
    """Return the controllers that ran, by recording; those that are not known are left out. Raises InputError."""
    found = {}
    for source in sources(context.config):
        name = source.table.controller
        if name is not None and name != UNKNOWN:
            where = f"{source.where}.controller"
            found[source.name] = load(paths.expand(name, context.path.parent, where), where)
    return found


def look(model: Model, recording: Recording, exported: Exported) -> Looked:
    """Replay one log; raises InputError where it was not logged at every sample."""
    log, controller = log_of(recording, exported.controller), exported.controller
    engine: Engine = partial(replay_rows, model, controller)
    if exported.precision == "float32":
        engine = partial(rows_in_single, controller)
    return Looked(recording, exported, log, engine, replayed(engine, log))


def with_commands(found: Comparison, logs: Mapping[str, Looked], model: Model) -> Comparison:
    """Return a comparison with the logged commands as further channels, held against those of the replay, if any."""
    recording = found.experiment.recording
    if recording.name not in logs:
        return found
    looked = logs[recording.name]
    replay, places = looked.replay, looked.log.places
    # a position that is counted is logged as it is
    rounded = {n: resolution(recording[n]) for n in ("x", "x_ref", "p1", "p2", "p_supply") if n in recording}
    steps = {n: step for n, step in rounded.items() if n == "x_ref" or _rms(recording, n) > step > 0.0}
    off = rounding(looked.engine, looked.log, replay, steps) if steps else 0.0
    names = ["u", *(["u2"] if "u2" in recording else [])]
    read = {name: recording[name] for name in names}
    said = {name: replay.commands[places, i] for i, name in enumerate(names)}
    results = tuple(channel_result(found.experiment, n, read[n], said[n], _floor(recording, n, off)) for n in names)
    return replace(
        found,
        results=found.results + results,
        measured={**found.measured, **read},
        modelled={**found.modelled, **said},
    )


def _rms(recording: Recording, name: str) -> float:
    return recording.noise[name].rms if name in recording.noise else 0.0


def _floor(recording: Recording, name: str, off: float) -> float:
    """Return what a right replay differs by in V: the rounding of readings, and that of the command."""
    return max(float(np.hypot(off, resolution(recording[name]) / np.sqrt(12.0))), LEAST)


def answer_of(looked: Looked, model: Model) -> dict[str, Any]:
    """Return what was foretold of a log and what came, in the figures of a closed loop."""
    controller = looked.exported.controller
    expected = foretold(model, controller, looked.log, bench_from(looked.recording, Bench()))
    came = measured(model, controller, looked.log, looked.replay)
    return {
        "recording": looked.recording.name,
        "use": looked.recording.use,
        "controller": controller.law,
        "hash": looked.exported.hash,
        "precision": looked.exported.precision,
        "began": looked.replay.began,
        "supply_told": "p_supply" in looked.replay.read,
        "foretold": _told(expected, model, looked),
        "measured": _told(came, model, looked),
    }


def _told(run: Run, model: Model, looked: Looked) -> Mapping[str, Any]:
    return figures(measure(run, model, looked.exported.controller)) | estimates(run)


def estimates(run: Run) -> dict[str, float]:
    """Return the means of the controller's estimates: of the load in N, and of the flow beside the valve's in Pa/s."""
    return {
        "load_estimate_n": float(np.mean(run.log[:, layout.L_LOAD])),
        "flow_estimate_pa_s": float(np.mean(run.log[:, layout.L_FLOW1])),
    }
