"""The tables that ``design`` writes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from pneucli.design.lpv import WeightStudy
from pneucli.design.sliding_sector import SlidingSector
from pneucli.io.artifacts import Provenance, write_table


def write_sectors(out: Path, rows: Mapping[str, SlidingSector], provenance: Provenance) -> None:
    """Write the sliding sectors."""
    units = {"a_1": "1/s", "a_2": "1/s", "lambda_1": "1/s", "lambda_2": "1/s", "speed_floor": "m/s"}
    write_table(
        out / "sector.parquet",
        {"name": list(rows)}
        | {
            n: np.array([getattr(s, n) for s in rows.values()], dtype=np.float64)
            for n in [*units, "middle", "steepness"]
        }
        | {"warning": [s.warning for s in rows.values()]},
        units=units | {"middle": "1/s", "steepness": "1"},
        schema="pneucli/design/sector/1",
        provenance=provenance,
    )


def write_weight_studies(out: Path, weights: Sequence[WeightStudy], provenance: Provenance) -> None:
    """Write the parallel distributed compensation of each weight type."""
    numbers = ("rate", "worst_pole", "worst_lmi")
    write_table(
        out / "lmi.parquet",
        {
            "weight_type": [str(w.weight_type) for w in weights],
            "vertices": np.array([w.vertices for w in weights]),
            **{n: np.array([getattr(w.pdc, n) if w.pdc else np.nan for w in weights]) for n in numbers},
            "status": [w.pdc.status if w.pdc else w.failure for w in weights],
            "verified": np.array([bool(w.pdc and w.pdc.verified) for w in weights]),
            "peak": np.array([w.peak_input_ratio for w in weights]),
            "decayed": np.array([w.lyapunov_ratio for w in weights]),
        },
        units={"vertices": "1", "rate": "1/s", "worst_pole": "1/s"}
        | dict.fromkeys(("worst_lmi", "peak", "decayed", "verified"), "1"),
        schema="pneucli/design/lmi/1",
        provenance=provenance,
    )
