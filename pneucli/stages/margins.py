"""Margins of the loop, a part of ``design``: along the stroke, and the ratios from which they are read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from pneucli.closed_loop.margins import LoopCut, MarginAnalysis, analyse_margins
from pneucli.closed_loop.simulation import ClosedLoopSetup
from pneucli.controller.parameters import Controller
from pneucli.io.artifacts import Provenance, write_table
from pneucli.pipeline.context import Context
from pneucli.simulate.model import Model

UNITS = {"gain_up": "1", "gain_down": "1", "phase": "rad", "delay": "s", "modulus": "1", "crossover": "1/s"}
MAX_FREQUENCIES = 300  # frequencies of a ratio
MAX_POLES = 8  # poles of an operating point, slowest first
WORST_OF_MARGIN = {"gain_up": min, "gain_down": max, "phase": min, "delay": min, "modulus": min}


def margins_answer(
    context: Context,
    model: Model,
    controller: Controller,
    setup: ClosedLoopSetup,
    bandwidth: float,
    provenance: Provenance,
) -> dict[str, Any]:
    """Return the margins as a part of the answer of ``design``; write ``margins.parquet``. ``bandwidth`` in rad/s."""
    context.progress("margins of the loop")
    found = analyse_margins(model, controller, setup, bandwidth)
    _write(context, found.cuts, provenance)
    points = [_point(cut, found) for cut in found.cuts]
    width = controller.fill[0] - controller.vent[0]
    return {
        "points": points,
        "worst": {
            loop: _worst([p for p in points if p["loop"] == loop]) for loop in dict.fromkeys(c.loop for c in found.cuts)
        },
        "poles": [
            {"x": x, "speed": speed, "unit": "1/s", "poles": [[p.real, p.imag] for p in poles[:MAX_POLES].tolist()]}
            for (x, speed), poles in found.poles.items()
        ],
        "stable": bool(found.poles) and not any(found.is_unstable(point) for point in found.poles),
        "stuck": [{"x": x, "direction": way} for x, way in found.sticking_points],
        "left_out": list(found.excluded_effects),
        "overlap": {"value": width, "unit": "V"},
        "units": UNITS,
    }


def _point(cut: LoopCut, found: MarginAnalysis) -> dict[str, Any]:
    numbers = {n: v if math.isfinite(v) else None for n, v in asdict(cut.margins).items()}
    return {
        "loop": cut.loop,
        "x": cut.x,
        "speed": cut.speed,
        "stable": not found.is_unstable((cut.x, cut.speed)),
        **numbers,
    }


def _worst(points: Sequence[dict[str, Any]]) -> dict[str, float | None]:
    """Return of each margin the smallest one; null where there is no limit."""
    finite = {n: [p[n] for p in points if p[n] is not None] for n in WORST_OF_MARGIN}
    return {n: worst(finite[n]) if finite[n] else None for n, worst in WORST_OF_MARGIN.items()}


def _write(context: Context, cuts: Sequence[LoopCut], provenance: Provenance) -> None:
    indices = [np.unique(np.linspace(0, c.frequency.size - 1, MAX_FREQUENCIES).astype(int)) for c in cuts]
    columns = {
        "x": [np.full(k.size, c.x) for c, k in zip(cuts, indices, strict=True)],
        "speed": [np.full(k.size, c.speed) for c, k in zip(cuts, indices, strict=True)],
        "frequency": [c.frequency[k] for c, k in zip(cuts, indices, strict=True)],
        "real": [c.ratio.real[k] for c, k in zip(cuts, indices, strict=True)],
        "imaginary": [c.ratio.imag[k] for c, k in zip(cuts, indices, strict=True)],
    }
    write_table(
        context.out / "margins.parquet",
        {"loop": [c.loop for c, k in zip(cuts, indices, strict=True) for _ in k]}
        | {name: np.concatenate([*parts, np.zeros(0)]) for name, parts in columns.items()},
        units={"x": "m", "speed": "m/s", "frequency": "1/s", "real": "1", "imaginary": "1"},
        schema="pneucli/design/margins/1",
        provenance=provenance,
    )
