"""Refits elsewhere: the same states as here, and only where it pays."""

import os
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks.fleet import TEMPLATE_FILE, write_fleet
from pneucli.diagnose import executor_refit
from pneucli.diagnose.data import Refit, run_locally
from pneucli.diagnose.diagnosis import diagnose
from pneucli.diagnose.executor_refit import ExecutorRefits
from pneucli.errors import InputError
from pneucli.executors import ProcessEngine, ThreadEngine
from pneucli.physics.declaration import Effect
from pneucli.physics.effects import catalogue
from pneucli.pipeline.runner import open_pipeline
from pneucli.stages import diagnose as stage
from pneucli.stages.pipeline_file import load_pipeline_file

NAMES = ("extra-mass", "stribeck", "line-delay", "pressure-lag")


@dataclass
class Ended:
    """A state: what was done to which, where, and with which effect."""

    done: str
    worker: int
    effect: Effect
    model: Any = field(default_factory=lambda: SimpleNamespace(effects=()))


@dataclass(frozen=True)
class Slow:
    """A bench on which every refit takes its time."""

    seconds: float
    effects: Any = field(default_factory=dict)
    progress: Callable[[str], None] = print
    run_refits: Any = run_locally
    free_run_errors: Any = None

    def run_refit(self, one: Refit) -> Ended:
        time.sleep(self.seconds)
        model_fit: Any = one.base
        return Ended(f"{model_fit.done}, {one.kind} {one.effect.name}", os.getpid(), one.effect)


def asked(names: Sequence[str] = NAMES) -> list[Refit]:
    before: Any = Ended("as it is", 0, catalogue()["stribeck"])
    return [Refit("add", before, catalogue()[n]) for n in names]


def done(seconds: float, folder: Path, rounds: int = 1) -> list[list[Any]]:
    engine = ProcessEngine(2)
    try:
        refits = ExecutorRefits(engine, folder, [])
        diagnosis_data: Any = Slow(seconds)
        return [refits(diagnosis_data, asked()) for _ in range(rounds)]
    finally:
        engine.close()


def test_long_ones_are_done_by_workers_and_come_back_in_their_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(executor_refit, "MIN_FIRST_SAVING", 0.02)
    monkeypatch.setattr(executor_refit, "MIN_SAVING", 0.02)
    first, second = done(0.05, tmp_path, rounds=2)
    assert [e.done for e in second] == [f"as it is, add {n}" for n in NAMES]
    assert all(e.effect is catalogue()[n] for e, n in zip(second, NAMES, strict=True))
    assert [e.worker == os.getpid() for e in first] == [True, False, False, False]  # the first one is measured here
    assert os.getpid() not in {e.worker for e in second}


def test_short_ones_stay_here(tmp_path: Path) -> None:
    (ended,) = done(0.0, tmp_path)
    assert {e.worker for e in ended} == {os.getpid()}
    assert not list(tmp_path.iterdir())


def test_an_effect_of_the_users_that_differs_on_a_worker_is_refused(tmp_path: Path) -> None:
    plugin = tmp_path / "own.py"
    plugin.write_text("EFFECT = None\n", encoding="utf-8")
    job = executor_refit.RefitJob("", "", "", "add", "own", None, ((str(plugin), "0" * 64),))
    with pytest.raises(InputError, match="on a worker"):
        executor_refit.run_refit_job(job)


def test_a_diagnosis_through_workers_is_that_of_this_process_bit_by_bit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_fleet(tmp_path, rigs=1, dates=2, changed=1.0, seed=8)
    (raw,) = (tmp_path / "raw").glob("*/2026-01-02")
    pipeline = tmp_path / "pipeline.toml"
    text = (tmp_path / TEMPLATE_FILE).read_text(encoding="utf-8")
    pipeline.write_text(text.replace('file = "raw/', f'file = "{raw.as_posix()}/'), encoding="utf-8")
    for name in ("MIN_FIRST_SAVING", "MIN_SAVING"):
        monkeypatch.setattr(executor_refit, name, 0.0)
    found = []
    monkeypatch.setattr(executor_refit, "engine_from", lambda *_, **__: closing(ThreadEngine(2)))
    monkeypatch.setattr(stage, "diagnose", lambda *given: found.append(diagnose(*given)) or found[-1])
    for name, options in {"here": {}, "there": {"executor": "local"}}.items():
        open_pipeline(pipeline, load_pipeline_file, tmp_path / name).update(["diagnose"], {"diagnose": options})
    one, other = ([d.candidate for d in each.decisions if d.candidate is not None] for each in found)
    assert len(one) > 2
    for a, b in zip(one, other, strict=True):
        assert a.effect is b.effect
        assert a.full.model.values == b.full.model.values
        assert np.array_equal(a.full.costs, b.full.costs)
