"""The gate and the margins of the loop, parts of ``design``: what was asked against what the loop keeps."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from pneucli.closed_loop.acceptance import ACCEPTANCE_SCENARIOS, Violation, axis_variants, check_acceptance
from pneucli.closed_loop.margins import LoopCut, MarginAnalysis, analyse_margins
from pneucli.closed_loop.robustness import sigma_from_intervals
from pneucli.closed_loop.scenarios import read_scenarios
from pneucli.closed_loop.simulation import ClosedLoopSetup
from pneucli.controller.parameters import Controller
from pneucli.design.requirements import Requirements
from pneucli.io.artifacts import Tables, read_table
from pneucli.messages.compare import BAD_ERROR_RATIO, evaluation_error
from pneucli.messages.design import cause_text
from pneucli.messages.progress import counted
from pneucli.pipeline.context import Context
from pneucli.simulate.model import Model

UNITS = {"gain_up": "1", "gain_down": "1", "phase": "rad", "delay": "s", "modulus": "1", "crossover": "1/s"}
MAX_FREQUENCIES = 300  # frequencies of a ratio
MAX_POLES = 8  # poles of an operating point, slowest first
WORST_OF_MARGIN = {"gain_up": min, "gain_down": max, "phase": min, "delay": min, "modulus": min}


def acceptance_answer(
    context: Context, model: Model, controller: Controller, requirements: Requirements, setup: ClosedLoopSetup
) -> dict[str, Any]:
    """Run the gate; return its part of the answer of ``design``."""
    sized = parameter_intervals(context)
    axes = list(axis_variants(model, sized, sigma_from_intervals(sized, model)))
    scenarios = [s for s in read_scenarios([], controller, "") if s.name in ACCEPTANCE_SCENARIOS]

    def progress(number: int) -> None:
        context.progress(counted("the gate, axis", number, len(axes)))

    found = check_acceptance(controller, requirements, scenarios, setup, axes, progress)
    error = model_error(context.answers)
    missed = [violation_answer(one) for one in found.violations]
    return {
        "passed": not missed and not (error is not None and error > BAD_ERROR_RATIO),
        "strict": requirements.strict,
        "missed": missed,
        "asked": [{"demand": d.name, "limit": d.limit, "unit": d.unit} for d in found.criteria],
        "axes": found.axis_count,
        "model_error": error,
        "model_error_limit": BAD_ERROR_RATIO,
    }


def violation_answer(one: Violation) -> dict[str, Any]:
    """Return the entry about a violation, its cause in words."""
    entry = {n: None if isinstance(v, float) and not math.isfinite(v) else v for n, v in asdict(one).items()}
    del entry["quantities"]
    return entry | {"cause": cause_text(one.cause, one.quantities)}


def parameter_intervals(context: Context) -> dict[str, tuple[float, float]]:
    """Return the 95 % intervals of the identified parameters."""
    table = read_table(context.artifacts / "identify" / "parameters.parquet")
    rows = zip(table["name"], table["ci_low"], table["ci_high"], strict=True)
    return {str(name): (float(low), float(high)) for name, low, high in rows}


def model_error(answers: Mapping[str, Mapping[str, Any]]) -> float | None:
    """Return the model's error over the noise floor, on test recordings, or on training recordings without any."""
    return evaluation_error(answers.get("compare", {}).get("error", {}))[1]


def margins_answer(
    context: Context,
    model: Model,
    controller: Controller,
    setup: ClosedLoopSetup,
    bandwidth: float,
    tables: Tables,
) -> dict[str, Any]:
    """Return the margins as a part of the answer of ``design``; write ``margins.parquet``. ``bandwidth`` in rad/s."""
    context.progress("margins of the loop")
    found = analyse_margins(model, controller, setup, bandwidth)
    _write(tables, found.cuts)
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


def _write(tables: Tables, cuts: Sequence[LoopCut]) -> None:
    indices = [np.unique(np.linspace(0, c.frequency.size - 1, MAX_FREQUENCIES).astype(int)) for c in cuts]
    columns = {
        "x": [np.full(k.size, c.x) for c, k in zip(cuts, indices, strict=True)],
        "speed": [np.full(k.size, c.speed) for c, k in zip(cuts, indices, strict=True)],
        "frequency": [c.frequency[k] for c, k in zip(cuts, indices, strict=True)],
        "real": [c.ratio.real[k] for c, k in zip(cuts, indices, strict=True)],
        "imaginary": [c.ratio.imag[k] for c, k in zip(cuts, indices, strict=True)],
    }
    tables.write(
        "margins",
        {"loop": [c.loop for c, k in zip(cuts, indices, strict=True) for _ in k]}
        | {name: np.concatenate([*parts, np.zeros(0)]) for name, parts in columns.items()},
        {"x": "m", "speed": "m/s", "frequency": "1/s", "real": "1", "imaginary": "1"},
    )
