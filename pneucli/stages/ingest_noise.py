"""The noise of each sensor: stated, or estimated from the recordings."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from pneucli.config import RecordingSource
from pneucli.experiments import EXPERIMENT_KINDS
from pneucli.noise import NoiseModel, detect_jumps, estimate_noise, jump_free_segments, pool_noise
from pneucli.stages.tables.ingest import IngestedRecording

Array = NDArray[np.float64]

MAX_NOISE_SAMPLES = 200_000  # of a long recording, its start stands for the whole
MIN_NOISE_SAMPLES = 8  # samples that noise is estimated from


def stated_noise(source: RecordingSource) -> dict[str, float]:
    """Return the noise of signals that the pipeline file states."""
    return {name: float(signal.noise) for name, signal in source.signals.items() if signal.noise is not None}


def noise_of(
    one: IngestedRecording, heads: list[dict[str, Array]], threads: ThreadPoolExecutor
) -> dict[str, NoiseModel]:
    """Return the noise of each signal: 0 for constants, as stated, else estimated, side by side in ``threads``."""
    stated = stated_noise(one.source)
    if EXPERIMENT_KINDS[one.source.table.experiment].steady:  # neighbouring rows are different settings of the bench
        known = dict.fromkeys(one.source.table.held_constant, 0.0) | {
            n: s for n, s in stated.items() if n in one.signals
        }
        return {name: NoiseModel(white=rms, period=one.period) for name, rms in known.items()}
    time = np.concatenate([head["time"] for head in heads])
    commands = [np.concatenate([head[u] for head in heads]) for u in ("u", "u2") if u in heads[0]]
    jumps = detect_jumps(commands, time.size)
    one.command_always_jumps = jump_free_segments(jumps, one.period) is None and bool(jumps.any())
    models = {name: NoiseModel(white=0.0, period=one.period) for name in one.source.table.held_constant}
    estimates: dict[str, Future[NoiseModel]] = {}
    for name in one.signals:
        if name == "time" or name in models:
            continue
        values = np.concatenate([head[name] for head in heads])
        if name in stated:
            models[name] = NoiseModel(white=stated[name], period=one.period)
        elif np.isfinite(values).sum() >= MIN_NOISE_SAMPLES:
            measured = _sample_mask(values)
            own = detect_jumps([values], time.size)[measured] if _has_friction_jumps(name, one.source) else None
            is_lone_position = name == "x" and "a" not in one.signals
            estimates[name] = threads.submit(
                estimate_noise, time[measured], values[measured], jumps[measured], own, is_motion=is_lone_position
            )
    models |= {name: estimate.result() for name, estimate in estimates.items()}
    return {name: models[name] for name in (*one.source.table.held_constant, *one.signals) if name in models}


def _has_friction_jumps(name: str, source: RecordingSource) -> bool:
    """Whether dry friction makes a signal jump: the force of a motion that is imposed and turns, and the acceleration
    of a piston that breaks away or stops. Over such jumps its spectrum would be that of slow noise.
    """
    return name == "a" or (name == "force" and source.table.imposed is not None)


def _sample_mask(values: Array) -> NDArray[np.bool_]:
    """Return which samples count: all but those that were not measured, where a signal has a clock of its own."""
    finite = np.isfinite(values)
    return np.asarray(finite if finite.mean() <= 0.8 else np.ones_like(finite))


def pool_noise_by_sensor(done: list[IngestedRecording]) -> None:
    """Share the noise model of a sensor at one rate; recordings with jumping commands count only if all have them."""
    groups: dict[tuple[str, str, int], list[IngestedRecording]] = {}
    for one in done:
        for name in one.noise.keys() & one.source.signals.keys():
            rate = round(float(np.log(one.period)) / 0.1)
            groups.setdefault((name, repr(one.source.signals[name]), rate), []).append(one)
    for (name, _, _), members in groups.items():
        shared = pool_noise(
            [one.noise[name] for one in members if not one.command_always_jumps] or [one.noise[name] for one in members]
        )
        for one in members:
            one.noise[name] = shared
