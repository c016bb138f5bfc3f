"""The uncertainty budgets of ISO 6358 characteristics."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pneucli.messages.formatting import format_number, format_percent

INTERVAL_MEANING = (
    "Intervals are the value ± the expanded uncertainty (k = 2, GUM) of all sources of the budget; where the thermal "
    "state of the gas is open, they hold for every state between no heat and the most that the wall can give or take."
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
    if (factors := thermal_factors(budget)) is not None:
        least, largest = (format_number(factor, 3) for factor in factors)
        text += f"; the heat of the wall may make it {least} to {largest} × as large"
    if missing := budget["calibration_not_stated"]:
        text += f"; no calibration is stated for {', '.join(missing)}"
    yield text


def thermal_factors(budget: Mapping[str, Any]) -> tuple[float, float] | None:
    """Return the least and the largest factor on C for the heat of the wall; None where the model knows that heat."""
    return next((tuple(one["factors"]) for one in budget["sources"] if one["factors"]), None)
