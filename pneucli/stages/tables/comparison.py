"""The tables of simulations of several control laws."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from pneucli.closed_loop.simulation import Run
from pneucli.controller import layout
from pneucli.io.artifacts import Provenance, write_table
from pneucli.simulate import layout as at
from pneucli.stages.law_comparison import LawComparison, RunsByLaw

MAX_PLOT_SAMPLES = 2000  # samples of a run that are kept for pictures
MODEL_SIGNALS = {"x": (at.X, "m"), "v": (at.V, "m/s"), "p1": (at.P1, "Pa"), "p2": (at.P2, "Pa")}
CONTROLLER_SIGNALS = {
    "u": (layout.L_U1, "V"),
    "u2": (layout.L_U2, "V"),
    "p1_ref": (layout.L_P1_REF, "Pa"),
    "x_shaped": (layout.L_X_SHAPED, "m"),
    "load_estimate": (layout.L_LOAD, "N"),
    "flow_estimate": (layout.L_FLOW1, "Pa/s"),
}


def write_comparison(found: LawComparison, out: Any, provenance: Provenance) -> None:
    """Write the figures of all cases, and the signals of the laws, thinned out for pictures."""
    rows = [
        {"group": group, "controller": name, "scenario": s} | asdict(m)
        for group, cases in (
            ("law", found.laws),
            ("without map", found.without_inverse_map),
            ("without", found.ablation),
            ("variant", found.variants),
        )
        for name, by in cases.items()
        for s, (_, m) in by.items()
    ]
    if not rows:
        return
    numbers = [n for n, v in rows[0].items() if isinstance(v, float)]
    texts = {n: [str(r[n]) for r in rows] for n in ("group", "controller", "scenario")}
    write_table(
        out / "comparison.parquet",
        texts | {n: np.array([r[n] for r in rows]) for n in numbers},
        units={n: unit_from_name(n) for n in numbers},
        schema="pneucli/design/comparison/1",
        provenance=provenance,
    )
    write_runs(
        out / "comparison_signals.parquet",
        {
            (name, s): r
            for name, by in {
                **found.laws,
                **_pressure_control_runs(found.without_inverse_map),
                **found.variants,
            }.items()
            for s, (r, _) in by.items()
        },
        provenance,
        "pneucli/design/comparison_signals/1",
        MAX_PLOT_SAMPLES,
    )


def _pressure_control_runs(found: RunsByLaw) -> RunsByLaw:
    """Return the runs in which a pressure is asked for: those that the map's pictures show."""
    return {name: {s: one for s, one in by.items() if one[0].scenario.controls_pressure} for name, by in found.items()}


def write_runs(
    path: Any, runs: Mapping[tuple[str, str], Run], provenance: Provenance, schema: str, max_samples: int | None = None
) -> None:
    """Write signals of runs by (controller, scenario), of each at most ``max_samples`` samples."""
    texts: dict[str, list[str]] = {"scenario": [], "controller": []}
    numbers: dict[str, list[Any]] = {}
    for (name, scenario), one in runs.items():
        s, step = one.scenario, 1 if max_samples is None else -(-one.time.size // max_samples)
        parts = {"time": one.time, "x_ref": s.reference, "load": s.force, "p_supply": s.supply}
        if s.controls_pressure:
            parts["x_ref"] = np.full(one.time.size, np.nan)
        parts |= {signal: one.model[:, place] for signal, (place, _) in MODEL_SIGNALS.items()}
        parts |= {signal: one.log[:, place] for signal, (place, _) in CONTROLLER_SIGNALS.items()}
        for signal, part in parts.items():
            numbers.setdefault(signal, []).append(part[::step])
        count = parts["time"][::step].size
        texts["scenario"] += [scenario] * count
        texts["controller"] += [name] * count
    write_table(
        path,
        {**texts, **{n: np.concatenate(parts) for n, parts in numbers.items()}},
        units={n: u for n, (_, u) in (MODEL_SIGNALS | CONTROLLER_SIGNALS).items()} | {"load": "N"},
        schema=schema,
        provenance=provenance,
    )


def unit_from_name(figure: str) -> str:
    """Return the unit that a figure's name ends in."""
    return {"um": "um", "s": "s", "hz": "Hz", "v": "V", "kg": "kg", "pa": "Pa"}.get(figure.rsplit("_", 1)[-1], "1")
