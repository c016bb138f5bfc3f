"""True recordings of every world, as loggers of other rates would have written them, and what the guards say of them.

Nothing in these worlds is stated falsely: what a guard contradicts in them is a false alarm.
"""

import os
import tempfile
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.arrays import Array
from pneucli.config import load, recording_sources
from pneucli.io.cleaning import Cleaner
from pneucli.io.raw_file import Channel
from pneucli.io.recordings import load_recordings
from pneucli.io.signal_repairs import COMMANDS, SignalRepairs
from pneucli.noise import NoiseModel, detect_jumps, estimate_noise
from pneucli.pipeline.graph import Context
from pneucli.plausibility import findings
from pneucli.recording import Recording, Rig
from pneucli.stages import ingest

ROOT = Path(__file__).parents[2]
SHARED = Path(os.environ.get("PNEUCLI_SHARED", ROOT.parent / "shared"))
FIXTURES = sorted((ROOT / "fixtures").glob("*/pipeline.toml"))
RATES = (100.0, 300.0, 1e3, 3e3, 1e4)  # Hz
MAX_SAMPLES = 20_000  # of a recording at another rate: its start
GUARDS_OF_IO = ("saturated", "spike", "mark", "held", "roll-over", "frozen", "plateau", "jumps")


@dataclass(frozen=True)
class Bench:
    """The recordings of a pipeline, its rig, the signals that it states as held, and what ingest repaired."""

    recordings: list[Recording]
    rig: Rig
    stated: Mapping[str, Any]
    repairs: list[tuple[str, str]]

    def alarms(self) -> Counter[tuple[str, str]]:
        """Return how often each guard speaks, by its name and weight; what ``io`` repairs is a doubt."""
        found = Counter((one.check, one.weight) for one in findings(self.recordings, self.rig, self.stated))
        return found + Counter((kind, "doubt") for kind, _ in self.repairs if kind in GUARDS_OF_IO)


def world_pipelines() -> dict[str, list[Path]]:
    """Return the pipeline files by world; of ``../shared`` (PNEUCLI_SHARED) what is there."""
    worlds = {
        "fixtures": FIXTURES,
        "cases": sorted((SHARED / "cases").glob("*/pipeline.toml")),
        **{
            name: sorted((SHARED / "rigs" / name).glob("*/pipeline.toml"))
            for name in ("bench", "plc", "process", "seal")
        },
        "thesis": sorted((SHARED / "thesis-cases").glob("*/pipeline.toml")),
    }
    if (SHARED / "real").is_dir():
        os.environ.setdefault("PNEUCLI_DATA", str(SHARED / "real"))
        pipelines = sorted((ROOT / "pipelines").glob("*.toml"))
        worlds["real"] = [path for path in pipelines if "PNEUCLI_DATA" in path.read_text(encoding="utf-8")]
    return {name: paths for name, paths in worlds.items() if paths}


def read(path: Path) -> Bench:
    """Return the recordings of a pipeline as ``ingest`` reads them."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        config = load(path)
        answer = ingest.run(Context(path, config, out / "ingest", out))
        stated = {one.name: one.table.held_constant.keys() for one in recording_sources(config)}
        repairs = [(one["kind"], one["signal"]) for one in answer["repairs"]]
        return Bench(load_recordings(out / "ingest"), config.to_rig(), stated, repairs)


def at_rate(bench: Bench, rate: float) -> Bench:
    """Return a bench as a logger of ``rate`` (Hz) would have recorded it, through the guards of ``io``."""
    repairs: list[tuple[str, str]] = []
    made = []
    for seed, one in enumerate(bench.recordings):
        if one.kind.steady:
            continue
        made.append(_guarded(_resampled(one, rate, np.random.default_rng(seed)), repairs))
    return replace(bench, recordings=made, repairs=repairs)


def _resampled(one: Recording, rate: float, rng: np.random.Generator) -> Recording:
    """Return a recording at other stamps: samples that are left out, or noise and resolution of the sensor added."""
    if rate * one.period <= 1.0:
        kept = slice(None, None, round(1.0 / (rate * one.period)))
        signals = {name: values[kept] for name, values in one.signals.items()}
        return replace(one, time=one.time[kept], signals=signals, noise={})
    time = np.arange(one.time[0], one.time[-1], 1.0 / rate)[:MAX_SAMPLES]
    before = np.searchsorted(one.time, time, side="right") - 1
    signals = {}
    for name, values in one.signals.items():
        if name in COMMANDS:
            signals[name] = values[before]
            continue
        known = np.isfinite(values)
        smooth = np.interp(time, one.time[known], values[known])
        signals[name] = _read_by_sensor(smooth, values, one.noise.get(name), rng)
    return replace(one, time=time, signals=signals, noise={})


def _read_by_sensor(smooth: Array, values: Array, noise: NoiseModel | None, rng: np.random.Generator) -> Array:
    steps = np.abs(np.diff(np.unique(values[np.isfinite(values)])))
    step = float(np.min(steps[steps > 1e-9 * np.nanmax(np.abs(values))], initial=np.inf))
    if noise is not None and noise.rms > step:
        smooth = smooth + noise.rms * rng.standard_normal(smooth.size)
    return np.asarray(np.round(smooth / step) * step if np.isfinite(step) else smooth)


def _guarded(one: Recording, repairs: list[tuple[str, str]]) -> Recording:
    """Send a recording through the guards of ``io`` and estimate its noise, as ``ingest`` does."""
    batch = {"time": one.time}
    for name, values in one.signals.items():
        guard = SignalRepairs(name, Channel(name))
        batch[name] = guard.repair(values)
        repairs += [(r.kind, r.signal) for r in guard.repairs()]
    cleaner = Cleaner(str)
    parts = [cleaner.push(batch), cleaner.finish()]
    repairs += [(r.kind, r.signal) for r in cleaner.repairs()]
    signals = {name: np.concatenate([part[name] for part in parts]) for name in batch}
    time = signals.pop("time")
    jumps = detect_jumps([signals[name] for name in ("u", "u2") if name in signals], time.size)
    noise = {
        name: estimate_noise(time, values, jumps, is_motion=name == "x" and "a" not in signals)
        for name, values in signals.items()
        if np.isfinite(values).sum() >= 8
    }
    return replace(one, time=time, signals=signals, noise=noise)
