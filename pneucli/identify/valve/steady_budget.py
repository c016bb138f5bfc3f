"""The uncertainty of C, b, m and the cracking pressure of a steady bench."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from pneucli.arrays import Array
from pneucli.figure import Figure
from pneucli.identify.valve.flow_bench import FlowBench
from pneucli.identify.valve.steady_flow import refit
from pneucli.identify.valve.steady_rows import FlowPath, FlowRows, coordinates_of
from pneucli.identify.valve.uncertainty import (
    COVERAGE_FACTOR,
    Measurement,
    budget_from,
    contribution,
    positive_interval,
)
from pneucli.messages.identify import Budget, Source

Move = Callable[[FlowRows, float], FlowRows]
FIGURES = (
    ("sonic_conductance", "C", "m^3/(s Pa)"),
    ("critical_ratio", "b", "1"),
    ("subsonic_index", "m", "1"),
    ("cracking_pressure", "cracking", "Pa"),
)
SIGNALS = ("p_supply", "p1", "flow", "temperature")
ENDS = {"forward": ("p_supply", "p1"), "reverse": ("p1", "p_supply"), "to ambient": ("p1", None)}  # up, down


def with_flow_budgets(
    bench: FlowBench, label: Callable[[FlowPath], str], measurement: Measurement, recorded: Sequence[str]
) -> FlowBench:
    """Return the bench with a budget for each characteristic, and the intervals that follow.

    Args:
        bench: The fitted bench; its intervals are those of the scatter.
        label: The end of a path's names.
        measurement: What is known of the instruments.
        recorded: Signals that were recorded.

    Returns:
        The bench.
    """
    paths, budgets = [], dict[str, Budget]()
    for path in bench.paths:
        own = _path_budgets(path, bench, measurement, recorded)
        budgets |= {f"valve.{name}{label(path)}": own[letter] for name, letter, _ in FIGURES if letter in own}
        changed = {
            letter: replace(getattr(path, letter), low=b.figure.low, high=b.figure.high) for letter, b in own.items()
        }
        paths.append(replace(path, **changed))
    return replace(bench, paths=tuple(paths), budgets=budgets)


def _path_budgets(
    path: FlowPath, bench: FlowBench, measurement: Measurement, recorded: Sequence[str]
) -> dict[str, Budget]:
    """Return the budget of each characteristic by its letter."""
    moved = [
        (source, uncertainty, unit, _change(path, bench, move, uncertainty))
        for source, uncertainty, unit, move in _inputs(path, bench, measurement, recorded)
    ]
    missing = tuple(s for s in SIGNALS if s in recorded and s not in measurement.calibrations)
    found = {}
    for i, (_, letter, unit) in enumerate(FIGURES):
        figure: Figure | None = getattr(path, letter)
        if figure is None:
            continue
        sources = [_scatter(path, i, figure, unit)]
        if figure.determined:  # what the rows do not determine no gauge changes
            sources += [contribution(s, "B", u, own, change[i] / u) for s, u, own, change in moved if change[i]]
        known = Figure(figure.value, *_interval(i, figure, sources), unit)
        found[letter] = budget_from(known, sources, missing)
    return found


def _scatter(path: FlowPath, i: int, figure: Figure, unit: str) -> Source:
    """Return the contribution of the rows' scatter: k times it has 95 % of Student's t."""
    scale = path.C.value if i == 0 else 1.0
    uncertainty = path.quantile / COVERAGE_FACTOR * math.sqrt(max(path.covariance[i, i], 0.0)) * scale
    if figure.determined and (i < 3 or uncertainty > 0.0):
        return contribution("scatter of the rows", "A", uncertainty, unit, 1.0)
    if not figure.determined:
        return contribution("typical values of valves", "B", uncertainty, unit, 1.0)
    between = (figure.high - figure.low) / math.sqrt(12.0)
    return contribution("between shut and open rows", "B", between, unit, 1.0)


def _interval(i: int, figure: Figure, sources: Sequence[Source]) -> tuple[float, float]:
    """Return the value with its expanded uncertainty; what the fit found one-sided stays so, and grows."""
    own, rest = sources[0], math.hypot(*(one.contribution for one in sources[1:]), 0.0)
    if i == 0:
        return positive_interval(figure.value, math.hypot(own.contribution, rest) / figure.value)
    below, above = (math.hypot(abs(end - figure.value), COVERAGE_FACTOR * rest) for end in (figure.low, figure.high))
    return max(figure.value - below, 0.0), min(figure.value + above, 1.0 if i == 1 else math.inf)


def _inputs(
    path: FlowPath, bench: FlowBench, measurement: Measurement, recorded: Sequence[str]
) -> Iterator[tuple[str, float, str, Move]]:
    """Yield source, standard uncertainty, its unit, and how it moves the rows."""
    for signal in SIGNALS:
        calibration = measurement.calibrations.get(signal)
        if calibration is None or signal not in recorded:
            continue
        origin = bench.rig.ambient_pressure if signal in measurement.gauge else 0.0
        unit = {"flow": "kg/s", "temperature": "K"}.get(signal, "Pa")
        if calibration.zero:
            yield f"calibration of {signal}, zero", calibration.zero, unit, _mover(path, signal, _shifted)
        if calibration.gain:
            move = _mover(path, signal, partial(_scaled, origin=origin))
            yield f"calibration of {signal}, gain", calibration.gain, "1", move
    if "temperature" not in recorded:
        yield "gas temperature", measurement.temperature_sigma, "K", _mover(path, "temperature", _shifted)


def _shifted(reading: Array, by: float) -> Array:
    return reading + by


def _scaled(reading: Array, by: float, origin: float) -> Array:
    """Return a reading with another gain, which acts on what the sensor reads above its origin."""
    return reading + by * (reading - origin)


def _mover(path: FlowPath, signal: str, change: Callable[[Array, float], Array]) -> Move:
    """Return what changes one signal of the rows of a path."""
    up, down = ENDS[path.rows.direction]

    def moved(rows: FlowRows, by: float) -> FlowRows:
        changed = {name: change(getattr(rows, name), by) for name in ("upstream", "downstream", "flow", "temperature")}
        return replace(
            rows,
            upstream=changed["upstream"] if up == signal else rows.upstream,
            downstream=changed["downstream"] if down == signal else rows.downstream,
            flow=changed["flow"] if signal == "flow" else rows.flow,
            temperature=changed["temperature"] if signal == "temperature" else rows.temperature,
        )

    return moved


def _change(path: FlowPath, bench: FlowBench, move: Move, by: float) -> Array:
    """Return half of the change of (C, b, m, cracking pressure) from one side of an input to the other."""
    ends = []
    for side in (by, -by):
        at = coordinates_of(refit(path, move(path.rows, side), bench.law))
        at[0] = math.exp(at[0])
        ends.append(at)
    return np.asarray(0.5 * (ends[0] - ends[1]))
