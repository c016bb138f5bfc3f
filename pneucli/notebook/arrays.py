"""``pneucli.diagnose``: diagnose recordings that are arrays, with the same pipeline as files."""

from __future__ import annotations

import shutil
import tempfile
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import tomlkit

from pneucli.errors import InputError
from pneucli.messages.formatting import format_percent
from pneucli.notebook.run import Run, as_html, as_text, open_run
from pneucli.quantities import SIGNALS

if TYPE_CHECKING:
    import pandas as pd

PIPELINE_NAME = "arrays"  # of the generated pipeline
REQUIRED_KEYS = ("name", "experiment", "use")  # of every recording


@dataclass(frozen=True, repr=False)
class Diagnosis:
    """The answer of ``pneucli diagnose --json``: verdict, missing effects, candidates and errors."""

    run: Run
    answer: Mapping[str, Any]

    def __repr__(self) -> str:
        return as_text(f"Diagnosis of {self.run.artifacts.name}", self._overview())

    def _repr_html_(self) -> str:
        return as_html(f"Diagnosis of {self.run.artifacts.name}", self._overview())

    def _overview(self) -> list[tuple[str, str]]:
        stated = [f"{name} {format_percent(share)}" for name, share in self.confidence.items() if share is not None]
        rows = [("verdict", self.verdict), ("found", self.sentence)]
        return [*rows, ("probability", ", ".join(stated))] if stated else rows

    @property
    def verdict(self) -> str:
        """``adequate``, ``missing-effect``, ``unexplained`` or ``inconclusive``."""
        return str(self.answer["verdict"])

    @property
    def missing(self) -> list[str]:
        """The effects that the model lacks, in the order to add them."""
        return list(self.answer["missing"])

    @property
    def sentence(self) -> str:
        """The verdict in one sentence."""
        return str(self.answer["sentence"])

    @property
    def confidence(self) -> dict[str, float]:
        """The probability of each named effect (0 to 1)."""
        return {c["effect"]: c["confidence"] for c in self.answer["candidates"] if c["effect"] in self.missing}

    @property
    def ladder(self) -> pd.DataFrame:
        """The error after each added effect."""
        return self.run.ladder

    @property
    def candidates(self) -> pd.DataFrame:
        """Every tested effect, and why it is named or rejected."""
        return self.run.candidates


def diagnose(
    recordings: Run | str | Path | Sequence[Mapping[str, Any]],
    rig: Mapping[str, Any] | None = None,
    *,
    effects: Sequence[str] = (),
    exclude: Sequence[str] = (),
    force: bool = False,
    tables: Mapping[str, Any] | None = None,
    folder: str | Path | None = None,
    quiet: bool = False,
) -> Diagnosis:
    """Diagnose which physical effect the model lacks.

    Args:
        recordings: Arrays (see :func:`from_arrays`), a run, or the path of a pipeline file.
        rig: The table ``[rig]`` for arrays.
        effects: The model's effects for arrays.
        exclude: Effects that are certainly absent.
        force: Look for effects even in recordings that cannot be true.
        tables: Further tables of the pipeline file for arrays.
        folder: The folder that keeps the files of arrays.
        quiet: Print no progress on standard error.

    Raises:
        InputError: As ``pneucli diagnose``.

    """
    if isinstance(recordings, Run | str | Path):
        run = recordings if isinstance(recordings, Run) else open_run(recordings, quiet=quiet)
    else:
        run = from_arrays(recordings, rig or {}, effects=effects, tables=tables, folder=folder, quiet=quiet)
    options = ({"exclude": sorted(set(exclude))} if exclude else {}) | ({"force": True} if force else {})
    run.bring_up("diagnose", options={"diagnose": options})
    return Diagnosis(run, run.answer("diagnose"))


def from_arrays(
    recordings: Sequence[Mapping[str, Any]],
    rig: Mapping[str, Any],
    *,
    effects: Sequence[str] = (),
    tables: Mapping[str, Any] | None = None,
    folder: str | Path | None = None,
    quiet: bool = False,
) -> Run:
    """Write arrays as a pipeline file with Parquet files, and return its run.

    Args:
        recordings: A dictionary for each recording with the keys of ``[[recordings]]`` (``name``, ``experiment``,
            ``use``, ``chamber_2``, ...) and its signals as arrays of shape (n,): ``time`` in s, ``u`` in V, ``p1`` in
            Pa absolute, all SI. A DataFrame with such columns may be given as ``data``.
        rig: The table ``[rig]``.
        effects: The model's effects.
        tables: Further tables of the pipeline file.
        folder: The folder that keeps the files; by default they are removed with the run.
        quiet: Print no progress on standard error.

    Raises:
        InputError: A key is missing, or the shapes differ.

    """
    place = Path(tempfile.mkdtemp(prefix="pneucli-") if folder is None else folder)
    place.mkdir(parents=True, exist_ok=True)
    entries = [_write_recording(one, number, place) for number, one in enumerate(recordings, 1)]
    document: dict[str, Any] = {
        "pipeline": {"name": PIPELINE_NAME},
        "rig": rig,
        "signals": {name: {"column": name} for name in SIGNALS},
        "recordings": entries,
        "model": {"effects": list(effects)},
    }
    for name, table in (tables or {}).items():
        document[name] = {**document.get(name, {}), **table} if isinstance(table, Mapping) else table
    file = place / "pipeline.toml"
    file.write_text(tomlkit.dumps(document), encoding="utf-8")
    opened = open_run(file, quiet=quiet)
    if folder is None:
        weakref.finalize(opened, shutil.rmtree, place, ignore_errors=True)
    return opened


def _write_recording(one: Mapping[str, Any], number: int, place: Path) -> dict[str, Any]:
    """Write the signals of one recording; return its entry of ``[[recordings]]``."""
    where = f"recordings, number {number}"
    if missing := [key for key in REQUIRED_KEYS if key not in one]:
        raise InputError(
            where, f"{missing[0]} is missing", ", ".join(REQUIRED_KEYS), f'add "{missing[0]}"', code="E090"
        )
    given = {**dict(one.get("data", {})), **one}
    signals = {name: np.asarray(given[name], dtype=np.float64) for name in SIGNALS if np.ndim(given.get(name, 0)) > 0}
    if "time" not in signals:
        raise InputError(f"{where}, {one['name']}", "no time", "an array of stamps in s", code="E090")
    for name, values in signals.items():
        if values.shape != signals["time"].shape:
            wanted = f"shape {signals['time'].shape}, as time has it"
            raise InputError(f"{where}, {one['name']}, {name}", f"shape {values.shape}", wanted, code="E090")
    file = f"recording_{number}.parquet"
    pq.write_table(pa.table(dict[str, Any](signals)), place / file)
    rest = {key: value for key, value in one.items() if key not in signals and key != "data"}
    return {**rest, "file": file, "take": list(signals)}
