"""Tables of parameters that ``identify`` writes: values with intervals, correlation, sensitivity, and iterations."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pneucli.identify.estimation.correlation import parameter_correlation, sensitivities
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.progress import Iteration
from pneucli.identify.residuals import ResidualModel
from pneucli.io.artifacts import Provenance, write_table

ParameterRow = tuple[str, float, str, float, float]  # name, value, unit, and the ends of the interval


def write_parameters(rows: Sequence[ParameterRow], out: Path, provenance: Provenance) -> None:
    """Write ``parameters``, a row for each parameter or characteristic."""
    name, value, unit, low, high = zip(*rows, strict=True) if rows else ((),) * 5
    write_table(
        out / "parameters.parquet",
        {"name": list(name), "value": value, "unit": list(unit), "ci_low": low, "ci_high": high},
        units=dict.fromkeys(("value", "ci_low", "ci_high"), "see column unit"),
        schema="pneucli/identify/parameters/1",
        provenance=provenance,
    )


def write_parameter_relations(
    found: Fit, views: Sequence[ResidualModel], rounds: Sequence[Iteration], out: Path, provenance: Provenance
) -> None:
    """Write ``correlation`` (a row a pair), ``sensitivity`` (a row a parameter and channel) and ``iterations``."""
    names = [e.name for e in found.estimates]
    write_table(
        out / "correlation.parquet",
        {
            "name": [a for a in names for _ in names],
            "other": [b for _ in names for b in names],
            "correlation": parameter_correlation(found).ravel(),
        },
        units={"correlation": "1"},
        schema="pneucli/identify/correlation/1",
        provenance=provenance,
    )
    influences = sensitivities(found, views)
    write_table(
        out / "sensitivity.parquet",
        {
            "name": [s.name for s in influences],
            "channel": [s.channel for s in influences],
            "times_noise": np.array([s.times_noise for s in influences], dtype=np.float64),
        },
        units={"times_noise": "1"},
        schema="pneucli/identify/sensitivity/1",
        provenance=provenance,
    )
    write_table(
        out / "iterations.parquet",
        {
            "effects": [", ".join(r.effects) for r in rounds],
            "search": np.array([r.search for r in rounds], dtype=np.int64),
            "round": np.array([r.round for r in rounds], dtype=np.int64),
            "residual": np.array([r.residual for r in rounds], dtype=np.float64),
        },
        units={"search": "1", "round": "1", "residual": "1"},
        schema="pneucli/identify/iterations/1",
        provenance=provenance,
    )
