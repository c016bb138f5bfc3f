"""Refits through an engine: in processes of this machine or on a cluster, where they last long enough for it to pay.

What a refit needs goes by files of a folder that client and workers share; an effect goes by its name, so that it is
the one that the worker has. A fit does the same arithmetic in the same order wherever it runs.
"""

from __future__ import annotations

import io
import pickle
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from pneucli.diagnose.data import DiagnosisData, FittedModel, Refit, RunRefits, run_locally
from pneucli.errors import InputError
from pneucli.executors import Engine, Identity, engine_from, run_jobs
from pneucli.identify.estimation.score_test import ScoreTest
from pneucli.io.artifacts import atomic_path, sha256_of
from pneucli.physics.declaration import Effect
from pneucli.physics.effects import all_effects

MIN_FIRST_SAVING, MIN_SAVING = (
    4.0,
    1.0,
)  # s that must be saved: by the first refits, whose workers must start, and by later ones
MATRIX_NDIM = 2  # axes
MAX_CACHED_FILES = 3  # files that a worker keeps in memory: the data, and the states from which a round starts


@dataclass(frozen=True)
class RefitJob:
    """One refit by the paths of what it needs; ``plugins``: SHA-256 of users' effects by path."""

    target: str
    data: str
    base: str
    kind: Any
    effect: str
    ranked: tuple[ScoreTest, ...] | None
    plugins: tuple[tuple[str, str], ...]


class ExecutorRefits:
    """Does refits through ``engine``, by files in ``folder``; where they are too short for it to pay, here.

    How long they last is measured: the first one is done here, and each says what it took.
    """

    def __init__(self, engine: Engine, folder: Path, plugins: Sequence[Path]) -> None:
        self._engine, self._folder = engine, folder
        self._plugins = tuple((str(path.absolute()), sha256_of(path)) for path in plugins)
        self._durations: list[float] = []
        self._started = False
        self._files: dict[int, tuple[object, Path]] = {}
        self._number = 0

    def __call__(self, bench: DiagnosisData, refits: Sequence[Refit]) -> list[FittedModel]:
        """Return the states that the refits end in."""
        known = [] if self._durations else [self._timed(bench, one) for one in refits[:1]]
        rest = refits[len(known) :]
        if not self._pays(len(rest)):
            return known + [self._timed(bench, one) for one in rest]
        self._started = True
        return known + self._run_remotely(bench, rest)

    def _timed(self, bench: DiagnosisData, one: Refit) -> FittedModel:
        begun = time.perf_counter()
        (state,) = run_locally(bench, [one])
        self._durations.append(time.perf_counter() - begun)
        return state

    def _pays(self, number: int) -> bool:
        """Whether so many refits are done sooner elsewhere, by what such took until now."""
        saved = number - np.ceil(number / self._engine.slots)
        return bool(saved and saved * np.mean(self._durations) > (MIN_SAVING if self._started else MIN_FIRST_SAVING))

    def _run_remotely(self, bench: DiagnosisData, refits: Sequence[Refit]) -> list[FittedModel]:
        effects = dict(bench.effects) | {e.name: e for one in refits for e in (one.effect, *one.base.model.effects)}
        data = self._file(bench, lambda: replace(bench, progress=_silent, run_refits=run_locally, free_run_errors=None))
        jobs = [self._job(str(data), one) for one in refits]
        for outcome in run_jobs(self._engine, run_refit_job, deque(jobs)):
            if outcome.error is not None:
                raise outcome.error
            self._durations.append(outcome.result)
            bench.progress(f"fitted {outcome.job.effect}")
        return [self._read_result(Path(job.target), effects) for job in jobs]

    def _job(self, data: str, one: Refit) -> RefitJob:
        state = self._file(one.base, lambda: one.base)
        return RefitJob(self._new("ended"), data, str(state), one.kind, one.effect.name, one.ranked, self._plugins)

    def _new(self, ending: str) -> str:
        self._number += 1
        return str(self._folder / f"{self._number}.{ending}")

    def _file(self, thing: object, what: Callable[[], object]) -> Path:
        """Return the file that holds a thing, which is written once."""
        if id(thing) not in self._files:
            path = Path(self._new("given"))
            _write(path, what())
            self._files[id(thing)] = thing, path  # the thing is kept, so that its id stays its own
        return self._files[id(thing)][1]

    @staticmethod
    def _read_result(path: Path, effects: Mapping[str, Effect]) -> FittedModel:
        state: FittedModel = _Reader(io.BytesIO(path.read_bytes()), effects).load()
        path.unlink()
        return state


@contextmanager
def open_refits(executor: str | None, folder: Path, plugins: Sequence[Path], identity: Identity) -> Iterator[RunRefits]:
    """Yield who does the refits: this process, or what ``executor`` names, by files in ``folder``, where that pays.

    Raises InputError where the executor cannot work.
    """
    if executor is None:
        yield run_locally
        return
    with (
        engine_from(executor, identity, preload=__name__) as engine,
        TemporaryDirectory(prefix=".refits-", dir=folder) as files,
    ):
        yield ExecutorRefits(engine, Path(files), plugins)


def run_refit_job(job: RefitJob) -> float:
    """Do one refit and write the state in which it ends; return the seconds that it took.

    Raises InputError where a user's effect is not the client's.
    """
    begun = time.perf_counter()
    effects = _effects(job.plugins)
    with threadpool_limits(1, user_api="blas"):  # as the client has it: the order of sums is the same
        bench, state = _read(job.data, job.plugins), _read(job.base, job.plugins)
        ended = bench.run_refit(Refit(job.kind, state, effects[job.effect], job.ranked))
    _write(Path(job.target), ended)
    return time.perf_counter() - begun


@lru_cache(maxsize=1)
def _effects(plugins: tuple[tuple[str, str], ...]) -> Mapping[str, Effect]:
    for path, sha in plugins:
        mine = sha256_of(path) if Path(path).is_file() else "not there"
        if mine != sha:
            raise InputError("--executor", f"the plug-in {path} is {mine[:12]} on a worker", f"{sha[:12]}, as here")
    return all_effects([Path(path) for path, _ in plugins])


@lru_cache(maxsize=MAX_CACHED_FILES)
def _read(path: str, plugins: tuple[tuple[str, str], ...]) -> Any:
    return _Reader(io.BytesIO(Path(path).read_bytes()), _effects(plugins)).load()


def _write(path: Path, thing: object) -> None:
    with atomic_path(path) as part, part.open("wb") as file:
        _Writer(file, pickle.HIGHEST_PROTOCOL).dump(thing)


class _Writer(pickle.Pickler):
    def persistent_id(self, thing: object) -> str | None:
        """Let an effect go by its name."""
        return thing.name if isinstance(thing, Effect) else None

    def reducer_override(self, thing: object) -> Any:
        """Keep columns columns where an array is but the upper rows of another: BLAS adds rows in another order."""
        if type(thing) is np.ndarray and thing.ndim == MATRIX_NDIM and thing.strides[0] == thing.itemsize:
            return np.asfortranarray(thing).__reduce_ex__(pickle.HIGHEST_PROTOCOL)
        return NotImplemented


class _Reader(pickle.Unpickler):
    def __init__(self, file: io.BytesIO, effects: Mapping[str, Effect]) -> None:
        super().__init__(file)
        self._effects = effects

    def persistent_load(self, name: str) -> Effect:
        """Return the effect that is called so here."""
        return self._effects[name]


def _silent(_: str) -> None:
    """Say nothing."""
