"""The gate, a part of ``design``: what was asked against what the loop keeps, and the model against its data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from pneucli.closed_loop.acceptance import ACCEPTANCE_SCENARIOS, Violation, axis_variants, check_acceptance
from pneucli.closed_loop.robustness import sigma_from_intervals
from pneucli.closed_loop.scenarios import read_scenarios
from pneucli.closed_loop.simulation import ClosedLoopSetup
from pneucli.controller.parameters import Controller
from pneucli.design.requirements import Requirements
from pneucli.io.artifacts import read_table
from pneucli.messages.acceptance import cause_text
from pneucli.messages.compare import BAD_ERROR_RATIO, evaluation_error
from pneucli.messages.progress import counted
from pneucli.pipeline.context import Context
from pneucli.simulate.model import Model


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
