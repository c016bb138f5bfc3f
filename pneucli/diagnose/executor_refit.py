"""Refits by an executor, in processes of this machine or on a cluster, where the saved time pays for the transfer.

Client and workers share a folder for the data of a refit. Effects are sent by name, so that a worker uses its own
definition. A fit does the same arithmetic in the same order everywhere.
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

from pneucli.diagnose.data import DiagnosisData, Refit, RunRefits, run_locally
from pneucli.diagnose.score import FittedModel
from pneucli.errors import InputError
from pneucli.executors import Engine, Identity, engine_from, run_jobs
from pneucli.identify.estimation.score_test import ScoreTest
from pneucli.io.artifacts import atomic_path, sha256_of
from pneucli.messages.progress import fitted_progress
from pneucli.physics.declaration import Effect
from pneucli.physics.effects import all_effects

MIN_FIRST_SAVING = 4.0  # s that the first remote refits must save, because their workers have to start
MIN_SAVING = 1.0  # s that later ones must save
MATRIX_NDIM = 2  # axes
MAX_CACHED_FILES = 3  # files in the memory of a worker: the data, and the fitted models at which a round starts


@dataclass(frozen=True)
class RefitJob:
    """One refit by the paths of its data; ``plugins``: SHA-256 of user-defined effects by path."""

    target: str
    data: str
    base: str
    kind: Any
    effect: str
    ranked: tuple[ScoreTest, ...] | None
    plugins: tuple[tuple[str, str], ...]


class ExecutorRefits:
    """Does refits by ``engine`` with files in ``folder``, or locally where they are too short.

    The first refit runs locally to measure the duration; later ones report theirs.
    """

    def __init__(self, engine: Engine, folder: Path, plugins: Sequence[Path]) -> None:
        self._engine, self._folder = engine, folder
        self._plugins = tuple((str(path.absolute()), sha256_of(path)) for path in plugins)
        self._durations: list[float] = []
        self._started = False
        self._files: dict[int, tuple[object, Path]] = {}
        self._number = 0

    def __call__(self, data: DiagnosisData, refits: Sequence[Refit]) -> list[FittedModel]:
        """Return the fitted models of the refits."""
        finished = [] if self._durations else [self._timed(data, refit) for refit in refits[:1]]
        remaining = refits[len(finished) :]
        if not self._pays(len(remaining)):
            return finished + [self._timed(data, refit) for refit in remaining]
        self._started = True
        return finished + self._run_remotely(data, remaining)

    def _timed(self, data: DiagnosisData, refit: Refit) -> FittedModel:
        started = time.perf_counter()
        (fitted,) = run_locally(data, [refit])
        self._durations.append(time.perf_counter() - started)
        return fitted

    def _pays(self, number: int) -> bool:
        """Whether an executor finishes so many refits sooner, by the mean duration until now."""
        saved_refits = number - np.ceil(number / self._engine.slots)
        return bool(
            saved_refits
            and saved_refits * np.mean(self._durations) > (MIN_SAVING if self._started else MIN_FIRST_SAVING)
        )

    def _run_remotely(self, data: DiagnosisData, refits: Sequence[Refit]) -> list[FittedModel]:
        effects = dict(data.effects) | {
            e.name: e for refit in refits for e in (refit.effect, *refit.base.model.effects)
        }
        data_file = self._file(
            data, lambda: replace(data, progress=_silent, run_refits=run_locally, free_run_errors=None)
        )
        jobs = [self._job(str(data_file), refit) for refit in refits]
        for outcome in run_jobs(self._engine, run_refit_job, deque(jobs)):
            if outcome.error is not None:
                raise outcome.error
            self._durations.append(outcome.result)
            data.progress(fitted_progress(outcome.job.effect))
        return [self._read_result(Path(job.target), effects) for job in jobs]

    def _job(self, data_file: str, refit: Refit) -> RefitJob:
        fitted = self._file(refit.base, lambda: refit.base)
        return RefitJob(
            self._new("ended"), data_file, str(fitted), refit.kind, refit.effect.name, refit.ranked, self._plugins
        )

    def _new(self, ending: str) -> str:
        self._number += 1
        return str(self._folder / f"{self._number}.{ending}")

    def _file(self, content: object, make: Callable[[], object]) -> Path:
        """Return the file of an object, which is written once."""
        if id(content) not in self._files:
            path = Path(self._new("given"))
            _write(path, make())
            self._files[id(content)] = content, path  # the thing is kept, so that its id stays its own
        return self._files[id(content)][1]

    @staticmethod
    def _read_result(path: Path, effects: Mapping[str, Effect]) -> FittedModel:
        fitted: FittedModel = _Reader(io.BytesIO(path.read_bytes()), effects).load()
        path.unlink()
        return fitted


@contextmanager
def open_refits(executor: str | None, folder: Path, plugins: Sequence[Path], identity: Identity) -> Iterator[RunRefits]:
    """Yield the function that does refits: locally, or by ``executor`` with files in ``folder`` where that pays.

    Raises:
        InputError: The executor cannot work.

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
    """Do one refit and write its fitted model; return the seconds that it took.

    Raises:
        InputError: A user-defined effect differs from that of the client.

    """
    started = time.perf_counter()
    effects = _effects(job.plugins)
    with threadpool_limits(1, user_api="blas"):  # as the client has it: the order of sums is the same
        data, fitted = _read(job.data, job.plugins), _read(job.base, job.plugins)
        fitted = data.run_refit(Refit(job.kind, fitted, effects[job.effect], job.ranked))
    _write(Path(job.target), fitted)
    return time.perf_counter() - started


@lru_cache(maxsize=1)
def _effects(plugins: tuple[tuple[str, str], ...]) -> Mapping[str, Effect]:
    for path, sha in plugins:
        local_sha = sha256_of(path) if Path(path).is_file() else "missing"
        if local_sha != sha:
            raise InputError(
                "--executor",
                f"the plug-in {path} has SHA-256 {local_sha[:12]} on a worker",
                f"{sha[:12]}, as here",
                code="E080",
            )
    return all_effects([Path(path) for path, _ in plugins])


@lru_cache(maxsize=MAX_CACHED_FILES)
def _read(path: str, plugins: tuple[tuple[str, str], ...]) -> Any:
    return _Reader(io.BytesIO(Path(path).read_bytes()), _effects(plugins)).load()


def _write(path: Path, content: object) -> None:
    with atomic_path(path) as part, part.open("wb") as file:
        _Writer(file, pickle.HIGHEST_PROTOCOL).dump(content)


class _Writer(pickle.Pickler):
    def persistent_id(self, content: object) -> str | None:
        """Let an effect go by its name."""
        return content.name if isinstance(content, Effect) else None

    def reducer_override(self, content: object) -> Any:
        """Keep columns columns where an array is but the upper rows of another: BLAS adds rows in another order."""
        if type(content) is np.ndarray and content.ndim == MATRIX_NDIM and content.strides[0] == content.itemsize:
            return np.asfortranarray(content).__reduce_ex__(pickle.HIGHEST_PROTOCOL)
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
