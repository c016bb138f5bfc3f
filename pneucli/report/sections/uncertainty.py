"""The uncertainty budgets of C, b, m and cracking pressure, as tables of the valve's chapters."""

from collections.abc import Iterator, Mapping

from pneucli.figure import Figure
from pneucli.messages.flow import LITRES_PER_BAR
from pneucli.messages.formatting import (
    format_figure,
    format_number,
    format_percent,
    format_quantity,
    in_display_unit,
    unit_symbol,
)
from pneucli.messages.identify import INTERVAL_MEANING, Budget, Source, largest_conductance
from pneucli.report.page_elements import Grid

CONDUCTANCE_UNIT = "m^3/(s Pa)"
SOURCE_COLUMNS = ("source", "type", "standard uncertainty", "sensitivity", "contribution to C", "share of variance")
RESULT_COLUMNS = ("result", "value, interval", "± (k = 2)", "main source")


def budget_tables(budgets: Mapping[str, Budget], results: str) -> Iterator[Grid]:
    """Yield the budget of the largest C, and one line for each result whose name holds ``results``."""
    chosen = {name: one for name, one in budgets.items() if name.startswith(results)}
    if (largest := largest_conductance(chosen)) is None:
        return
    yield _sources(*largest)
    rows = [_result(name, one) for name, one in chosen.items()]
    yield Grid(f"Uncertainty of every result. {INTERVAL_MEANING}", RESULT_COLUMNS, rows)


def _sources(name: str, budget: Budget) -> Grid:
    """Return the budget of one C."""
    rows = [
        [
            one.source,
            one.type_,
            _uncertainty(one),
            _sensitivity(one),
            _conductance(one.contribution),
            format_percent(one.share),
        ]
        for one in budget.sources
    ]
    for title, size in (
        ("combined standard uncertainty", budget.combined),
        ("expanded uncertainty, k = 2", budget.expanded),
    ):
        rows.append([title, "", "", "", _conductance(size), ""])
    caption = f"Uncertainty budget of the largest conductance, {name} = {_conductance(budget.figure.value)}."
    if (factors := budget.thermal_factors) is not None and budget.propagated:
        least, largest = (format_number(factor, 3) for factor in factors)
        low, high = (_conductance(end) for end in budget.propagated)
        caption += (
            f" The thermal state is a bound: C is {least} to {largest} × the value for any heat between gas and wall."
            " It is in the interval, not in the combined uncertainty; drawn evenly between its bounds (JCGM 101), it"
            f" gives a 95 % interval of {low} to {high}."
        )
    if missing := budget.calibration_not_stated:
        caption += f" The pipeline file states no calibration of {', '.join(missing)}: the budget lacks them."
    return Grid(caption, SOURCE_COLUMNS, rows)


def _result(name: str, budget: Budget) -> list[str]:
    one = budget.figure
    factor, unit = (LITRES_PER_BAR, "l/(s bar)") if one.unit == CONDUCTANCE_UNIT else (1.0, one.unit)
    main = max(budget.sources, key=lambda one: one.contribution)
    return [
        name,
        format_figure(Figure(factor * one.value, factor * one.low, factor * one.high, unit)),
        format_quantity(factor * budget.expanded, unit, 2),
        f"{main.source}, {format_percent(main.share)}",
    ]


def _uncertainty(source: Source) -> str:
    """Return the standard uncertainty of a source."""
    if source.unit == CONDUCTANCE_UNIT:
        return _conductance(source.uncertainty)
    return format_quantity(source.uncertainty, source.unit, 2)


def _sensitivity(source: Source) -> str:
    """Return the derivative of C by a source in l/(s bar) for each display unit of the source."""
    if source.unit == CONDUCTANCE_UNIT:
        return f"{format_number(source.sensitivity, 3)}"
    size, unit = in_display_unit(1.0, source.unit), unit_symbol(source.unit)
    value = format_number(LITRES_PER_BAR * source.sensitivity / size, 3)
    return f"{value} l/(s bar)" + (f" per {unit}" if unit else "")


def _conductance(value: float) -> str:
    return format_quantity(LITRES_PER_BAR * value, "l/(s bar)", 3)
