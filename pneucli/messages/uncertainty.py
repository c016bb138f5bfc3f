"""The uncertainty budgets of ISO 6358 characteristics."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from pneucli.messages.formatting import format_number, format_percent

INTERVAL_MEANING = (
    "Intervals are the value ± the expanded uncertainty (k = 2, GUM) of all sources of the budget; where the thermal "
    "state of the gas is open, they reach up to the value of a gas that the wall warms or cools as much as it can."
)
CONDUCTANCE = "sonic_conductance("


def largest_conductance(uncertainty: Mapping[str, Any]) -> tuple[str, Mapping[str, Any]] | None:
    """Return name and budget of the largest C; None without one."""
    named = [(name, one) for name, one in uncertainty.get("budgets", {}).items() if "sonic_conductance" in name]
    return max(named, key=lambda item: item[1]["value"], default=None)


def uncertainty_lines(uncertainty: Mapping[str, Any]) -> Iterator[str]:
    """Yield how well the largest C is known, and from where its uncertainty comes."""
    if (found := largest_conductance(uncertainty)) is None:
        return
    name, budget = found
    at = f" at {name.partition('(')[2].rstrip(')')}" if "(" in name else ""
    text = f"C{at} is known to ± {format_number(100.0 * budget['expanded'] / budget['value'], 2)} % (k = 2)"
    certain = [one for one in budget["sources"] if not one["bound"]]
    variance = sum(one["contribution"] ** 2 for one in certain)
    if variance > 0.0:
        main = max(certain, key=lambda one: one["contribution"])
        share = format_percent(main["contribution"] ** 2 / variance)
        text += f"; main source: {main['source']} (type {main['type']}, {share} of the variance)"
    if any(one["bound"] for one in budget["sources"]):
        text += (
            f"; it is up to {format_number(thermal_factor(budget), 3)} × as large if the wall warms or cools the gas"
        )
    if missing := budget["calibration_not_stated"]:
        text += f"; no calibration is stated for {', '.join(missing)}"
    yield text


def thermal_factor(budget: Mapping[str, Any]) -> float:
    """Return by what C is multiplied if the gas exchanges heat as fast as it can."""
    return 1.0 + sum(float(one["uncertainty"]) * math.sqrt(12.0) for one in budget["sources"] if one["bound"])
