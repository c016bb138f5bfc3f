"""The artifacts of ``ingest``: written by one stage, loaded by all later ones."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from pneucli.arrays import Array
from pneucli.errors import InputError
from pneucli.io.artifacts import Provenance, read_table, schema_from
from pneucli.noise import NoiseModel
from pneucli.quantities import SIGNALS
from pneucli.recording import Recording

SIGNALS_FILE, RECORDINGS_FILE = "signals.parquet", "recordings.parquet"
NOISE_FILE, REPAIRS_FILE = "noise.parquet", "repairs.parquet"


def signals_schema(names: set[str], provenance: Provenance) -> pa.Schema:
    """Return the schema of ``signals.parquet``: recording, time, then ``names`` in the nomenclature's order."""
    ordered = ["time", *(name for name in SIGNALS if name in names and name != "time")]
    columns = ", ".join(["recording", *ordered])
    return schema_from(columns, schema="pneucli/ingest/signals/1", provenance=provenance)


def load_recordings(folder: str | Path) -> list[Recording]:
    """Return all recordings of an ``ingest`` folder, in the pipeline file's order.

    A signal that a recording does not have is absent; NaN marks samples that were not measured. Raises InputError
    where the artifacts are missing or damaged.
    """
    folder = Path(folder)
    about = read_table(folder / RECORDINGS_FILE)
    rows = [dict(zip(about, row, strict=True)) for row in zip(*about.values(), strict=True)]
    noise = _noise(folder)
    ends = np.cumsum([int(row["samples"]) for row in rows])
    signals: list[dict[str, Array]] = [{} for _ in rows]
    try:
        file = pq.ParquetFile(folder / SIGNALS_FILE)
        for name in file.schema_arrow.names[1:]:  # one after the other, so that little is held twice
            column = np.asarray(file.read([name])[name].to_numpy(), dtype=np.float64)
            for own, values in zip(signals, np.split(column, ends[:-1]), strict=True):
                if np.isfinite(values).any():
                    own[name] = values
    except (OSError, pa.ArrowInvalid) as error:
        raise InputError(str(folder / SIGNALS_FILE), f"{error}", "", "run ingest again", code="E007") from error
    return [_recording(row, own, noise.get(str(row["name"]), {})) for row, own in zip(rows, signals, strict=True)]


def _recording(row: dict[str, Any], signals: dict[str, Array], noise: dict[str, NoiseModel]) -> Recording:
    return Recording(
        name=str(row["name"]),
        experiment=row["experiment"],
        use=row["use"],
        time=signals.pop("time"),
        signals=signals,
        noise=noise,
        chamber_2=row["chamber_2"] or None,
        imposed=row["imposed"] or None,
        valve_shut=bool(row["valve_shut"]),
        chamber=2 if row.get("chamber") == 2 else 1,
        added_mass=float(row.get("added_mass") or 0.0),
    )


def _noise(folder: Path) -> dict[str, dict[str, NoiseModel]]:
    table = read_table(folder / NOISE_FILE)
    models: dict[str, dict[str, NoiseModel]] = {}
    numbers = ("white", "coloured", "pole", "period", "step")
    for index, (recording, signal) in enumerate(zip(table["recording"], table["signal"], strict=True)):
        lines = tuple((float(f), float(a)) for f, a in json.loads(str(table["lines"][index])))
        own = {name: float(table[name][index]) for name in numbers}
        least, most = float(table["least"][index]), float(table["most"][index])
        interval = (least, most) if np.isfinite(least) else None
        models.setdefault(str(recording), {})[str(signal)] = NoiseModel(**own, lines=lines, interval=interval)
    return models
