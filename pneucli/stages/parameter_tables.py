"""Tables of parameters that ``identify`` writes: values with intervals, correlation, sensitivity, and iterations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pneucli.identify.estimation.correlation import parameter_correlation, sensitivities
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.progress import Iteration
from pneucli.identify.residuals import ResidualModel
from pneucli.identify.valve.uncertainty import COVERAGE_FACTOR, Budget
from pneucli.io.artifacts import Tables

ParameterRow = tuple[str, float, str, float, float]  # name, value, unit, and the ends of the interval


def write_parameters(rows: Sequence[ParameterRow], tables: Tables) -> None:
    """Write ``parameters``, a row for each parameter or characteristic."""
    name, value, unit, low, high = zip(*rows, strict=True) if rows else ((),) * 5
    tables.write(
        "parameters",
        {"name": list(name), "value": value, "unit": list(unit), "ci_low": low, "ci_high": high},
        dict.fromkeys(("value", "ci_low", "ci_high"), "see column unit"),
    )


def write_parameter_relations(
    found: Fit, views: Sequence[ResidualModel], rounds: Sequence[Iteration], tables: Tables
) -> None:
    """Write ``correlation`` (a row a pair), ``sensitivity`` (a row a parameter and channel) and ``iterations``."""
    names = [e.name for e in found.estimates]
    tables.write(
        "correlation",
        {
            "name": [a for a in names for _ in names],
            "other": [b for _ in names for b in names],
            "correlation": parameter_correlation(found).ravel(),
        },
        {"correlation": "1"},
    )
    influences = sensitivities(found, views)
    tables.write(
        "sensitivity",
        {
            "name": [s.name for s in influences],
            "channel": [s.channel for s in influences],
            "times_noise": np.array([s.times_noise for s in influences], dtype=np.float64),
        },
        {"times_noise": "1"},
    )
    tables.write(
        "iterations",
        {
            "effects": [", ".join(r.effects) for r in rounds],
            "search": np.array([r.search for r in rounds], dtype=np.int64),
            "round": np.array([r.round for r in rounds], dtype=np.int64),
            "residual": np.array([r.residual for r in rounds], dtype=np.float64),
        },
        {"search": "1", "round": "1", "residual": "1"},
    )


def write_budgets(budgets: Sequence[Budget], tables: Tables) -> None:
    """Write ``uncertainty_budget``: a row for each source of each result."""
    rows = [(budget, one) for budget in budgets for one in budget.contributions]
    if not rows:
        return
    numbers: dict[str, Any] = {
        "uncertainty": [one.uncertainty for _, one in rows],
        "sensitivity": [one.sensitivity for _, one in rows],
        "contribution": [one.contribution for _, one in rows],
        "share": [budget.share(one) for budget, one in rows],
        "value": [budget.value for budget, _ in rows],
        "combined": [budget.combined for budget, _ in rows],
        "expanded": [budget.expanded for budget, _ in rows],
        "ci_low": [budget.interval[0] for budget, _ in rows],
        "ci_high": [budget.interval[1] for budget, _ in rows],
    }
    texts: dict[str, Any] = {
        "name": [budget.name for budget, _ in rows],
        "unit": [budget.unit for budget, _ in rows],
        "source": [one.source for _, one in rows],
        "type": [one.kind for _, one in rows],
        "uncertainty_unit": [one.unit for _, one in rows],
        "bound": np.array([one.bound for _, one in rows]),
    }
    units = dict.fromkeys(("contribution", "value", "combined", "expanded", "ci_low", "ci_high"), "see column unit")
    tables.write(
        "uncertainty_budget",
        texts | {name: np.array(values, dtype=np.float64) for name, values in numbers.items()},
        units
        | {
            "uncertainty": "see column uncertainty_unit",
            "sensitivity": "unit / uncertainty_unit",
            "share": "1",
            "bound": "1",
        },
    )


def budgets_answer(budgets: Sequence[Budget]) -> dict[str, Any]:
    """Return what ``identify --json`` says of the uncertainty, by the name of the result."""
    return {"coverage_factor": COVERAGE_FACTOR, "budgets": {one.name: _budget(one) for one in budgets}}


def _budget(budget: Budget) -> dict[str, Any]:
    return {
        "value": budget.value,
        "unit": budget.unit,
        "combined": budget.combined,
        "expanded": budget.expanded,
        "interval": list(budget.interval),
        "propagated": budget.propagated and list(budget.propagated),
        "calibration_not_stated": list(budget.not_stated),
        "sources": [
            {
                "source": one.source,
                "type": one.kind,
                "uncertainty": one.uncertainty,
                "unit": one.unit,
                "sensitivity": one.sensitivity,
                "contribution": one.contribution,
                "share": budget.share(one),
                "bound": one.bound,
                "factors": one.factors and list(one.factors),
            }
            for one in budget.contributions
        ],
    }
