"""The gate, a part of ``design``: what was asked against what the loop keeps, and the model against its data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from pneucli.closed_loop.acceptance import SCENARIOS, axes_of, gate
from pneucli.closed_loop.robustness import sigma_of
from pneucli.closed_loop.scenarios import scenarios_from
from pneucli.closed_loop.simulation import Bench
from pneucli.controller.parameters import Controller
from pneucli.design.requirements import Requirements
from pneucli.io.artifacts import read_table
from pneucli.messages.compare import FAR, judged
from pneucli.pipeline.context import Context
from pneucli.simulate.model import Model


def gate_answer(
    context: Context, model: Model, controller: Controller, wanted: Requirements, bench: Bench
) -> dict[str, Any]:
    """Run the gate; return its part of the answer of ``design``."""
    sized = intervals(context)
    axes = list(axes_of(model, sized, sigma_of(sized, model)))
    scenarios = [s for s in scenarios_from([], controller, "") if s.name in SCENARIOS]
    found = gate(
        controller, wanted, scenarios, bench, axes, lambda share: context.progress("the gate", 0.8 + 0.2 * share)
    )
    error = model_error(context.answers)
    missed = [
        {n: v if not isinstance(v, float) or math.isfinite(v) else None for n, v in asdict(m).items()}
        for m in found.missed
    ]
    return {
        "passed": not missed and not (error is not None and error > FAR),
        "strict": wanted.strict,
        "missed": missed,
        "asked": [{"demand": d.name, "limit": d.limit, "unit": d.unit} for d in found.asked],
        "axes": found.axes,
        "model_error": error,
        "model_error_limit": FAR,
    }


def intervals(context: Context) -> dict[str, tuple[float, float]]:
    """Return the 95 % intervals of the identified parameters."""
    table = read_table(context.artifacts / "identify" / "parameters.parquet")
    rows = zip(table["name"], table["ci_low"], table["ci_high"], strict=True)
    return {str(name): (float(low), float(high)) for name, low, high in rows}


def model_error(answers: Mapping[str, Mapping[str, Any]]) -> float | None:
    """Return the model's error over the noise floor, of the recordings that it is judged by."""
    return judged(answers.get("compare", {}).get("error", {}))[1]
