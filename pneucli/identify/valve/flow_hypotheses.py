"""Nested models of a steady bench: the flow function of the base model, and that with effects of the catalogue."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pneucli.distributions import student_t_quantile
from pneucli.identify.valve.flow_bench import FlowBench
from pneucli.identify.valve.flow_path import FlowPath
from pneucli.identify.valve.iso6358 import ELLIPSE_SUBSONIC_INDEX
from pneucli.physics.gas import PSI_MAX, flow_constant
from pneucli.physics.iso_flow import REFERENCE_DENSITY, REFERENCE_TEMPERATURE, FlowCharacteristics, iso_mass_flow

BASE_CRITICAL_RATIO = 0.528  # of the base model
CRITICAL_RATIO_RANGE = (0.0, 0.9)
NULL_TOLERANCE = 1e-3  # V, within which a command is the null


@dataclass(frozen=True)
class FlowHypothesis:
    """One critical ratio for all commands, m = 0.5, no cracking pressure, and a free conductance for each command.

    Attributes:
        critical_ratio: b.
        conductances: C of each path in m^3/(s Pa).
        cost: Sum of squared residuals over noise.
        free: Number of fitted parameters.
        ratio_interval: 95 % interval of b, which includes the residuals' scatter; None where b is given.
    """

    critical_ratio: float
    conductances: tuple[float, ...]
    cost: float
    free: int
    ratio_interval: tuple[float, float] | None = None

    def bench(self, bench: FlowBench) -> FlowBench:
        """Return the bench with the flow of this model."""
        paths = [
            replace(path, characteristics=FlowCharacteristics(c, self.critical_ratio, ELLIPSE_SUBSONIC_INDEX))
            for path, c in zip(bench.paths, self.conductances, strict=True)
        ]
        return replace(bench, paths=tuple(paths))


def closed_paths(bench: FlowBench) -> list[FlowPath]:
    """Return the paths whose command is the null, at which the valve is shut unless it leaks."""
    null = bench.rig.valve_null
    return [path for path in bench.paths if path.rows.u is not None and abs(path.rows.u - null) <= NULL_TOLERANCE]


def fit_hypothesis(bench: FlowBench, *, free_ratio: bool, leak: bool) -> FlowHypothesis:
    """Fit the conductances, with the base model's critical ratio or one that is fitted too.

    Args:
        bench: The fitted paths, whose noise gives the weights.
        free_ratio: Whether b is fitted (``critical-ratio``).
        leak: Whether gas may flow at the null command (``valve-leak``).

    Returns:
        The model.

    """
    from scipy.optimize import minimize_scalar  # noqa: PLC0415 - slow to import, and few pipelines have a flow bench

    if not free_ratio:
        return _at_ratio(bench, BASE_CRITICAL_RATIO, leak=leak)
    found = minimize_scalar(
        lambda b: _at_ratio(bench, float(b), leak=leak).cost, bounds=CRITICAL_RATIO_RANGE, method="bounded"
    )
    best = _at_ratio(bench, float(found.x), leak=leak)
    freedom = max(sum(path.rows.flow.size for path in bench.paths) - best.free - 1, 1)
    limit = best.cost + max(best.cost / freedom, 1.0) * float(student_t_quantile(0.975, freedom)) ** 2
    grid = np.linspace(*CRITICAL_RATIO_RANGE, 181)
    inside = [float(b) for b in grid if _at_ratio(bench, float(b), leak=leak).cost <= limit]
    ends = [best.critical_ratio, *inside]
    return replace(best, free=best.free + 1, ratio_interval=(min(ends), max(ends)))


def _at_ratio(bench: FlowBench, critical_ratio: float, *, leak: bool) -> FlowHypothesis:
    shut = set() if leak else {id(path) for path in closed_paths(bench)}
    sizes, cost = [], 0.0
    for path in bench.paths:
        rows = path.rows
        unit = iso_mass_flow(
            FlowCharacteristics(1.0, critical_ratio, ELLIPSE_SUBSONIC_INDEX),
            rows.upstream,
            rows.downstream,
            rows.temperature,
        )
        x, y = unit / path.deviation, rows.flow / path.deviation
        size = 0.0 if id(path) in shut else float(x @ y) / max(float(x @ x), 1e-300)
        sizes.append(size)
        cost += float(np.sum((y - size * x) ** 2))
    return FlowHypothesis(critical_ratio, tuple(sizes), cost, len(bench.paths) - len(shut))


def leak_area(bench: FlowBench) -> tuple[float, float, float]:
    """Return the area in m^2 through which gas flows at the null command, with its 95 % interval.

    References:
        ISO 6358-1: C of the closed path, as the area of a nozzle whose choked flow is the same.
    """
    choked = PSI_MAX * flow_constant(bench.rig.gas_constant, REFERENCE_TEMPERATURE, bench.rig.heat_capacity_ratio)
    largest = max(closed_paths(bench), key=lambda path: path.C.value).C
    unit = REFERENCE_DENSITY / choked
    return unit * largest.value, unit * largest.low, unit * largest.high
