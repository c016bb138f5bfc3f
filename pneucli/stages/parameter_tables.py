"""Tables of parameters that ``identify`` writes: values with intervals, correlation, sensitivity, and iterations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pneucli.figure import INTERVAL_UNITS, Figure, named
from pneucli.identify.estimation.correlation import parameter_correlation, sensitivities
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.progress import Iteration
from pneucli.identify.residuals import ResidualModel
from pneucli.identify.valve.uncertainty import COVERAGE_FACTOR, Budget
from pneucli.io.artifacts import Tables
from pneucli.messages.identify import BudgetAnswer, Source, Uncertainty

SOURCE_KEYS = "uncertainty unit sensitivity contribution bound factors"


def write_parameters(found: Mapping[str, Figure], tables: Tables) -> None:
    """Write ``parameters``, a row for each parameter or characteristic."""
    rows = [{"name": name} | one.columns for name, one in found.items()]
    tables.write(
        "parameters",
        {key: [row[key] for row in rows] for key in ("name", "value", "unit", "ci_low", "ci_high")},
        INTERVAL_UNITS,
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
    tables.write_rows(
        "uncertainty_budget",
        [
            {"name": budget.name, "unit": budget.figure.unit}
            | named(one, "source")
            | {"type": one.kind, "uncertainty_unit": one.unit, "bound": one.bound}
            | named(one, "uncertainty sensitivity contribution")
            | {"share": budget.share(one)}
            | {"value": budget.figure.value}
            | named(budget, "combined expanded")
            | {"ci_low": budget.figure.low, "ci_high": budget.figure.high}
            for budget, one in rows
        ],
        {
            **INTERVAL_UNITS,
            **dict.fromkeys(("contribution", "combined", "expanded"), "see column unit"),
            **{"uncertainty": "see column uncertainty_unit", "sensitivity": "unit / uncertainty_unit"},
            **{"share": "1", "bound": "1"},
        },
    )


def budgets_answer(budgets: Sequence[Budget]) -> Uncertainty:
    """Return what ``identify`` says of the uncertainty, by the name of the result."""
    return Uncertainty(COVERAGE_FACTOR, {one.name: _budget(one) for one in budgets})


def _budget(budget: Budget) -> BudgetAnswer:
    return BudgetAnswer(
        **named(budget, "figure combined expanded propagated"),
        calibration_not_stated=budget.not_stated,
        sources=[
            Source(one.source, one.kind, share=budget.share(one), **named(one, SOURCE_KEYS))
            for one in budget.contributions
        ],
    )
