"""A valve on a steady bench: flow over command and pressures, its inverse, errors of rows, and nested models."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pneucli.arrays import Array, Integers, Mask
from pneucli.distributions import student_t_quantile
from pneucli.identify.valve.iso6358 import ELLIPSE_SUBSONIC_INDEX
from pneucli.identify.valve.steady_flow import fit_flow_paths
from pneucli.identify.valve.steady_rows import FlowPath, FlowRows, NoiseLaw, flow_deviation, flow_rows
from pneucli.messages.identify import Budget
from pneucli.physics.gas import PSI_MAX, flow_constant
from pneucli.physics.iso_flow import REFERENCE_DENSITY, REFERENCE_TEMPERATURE, FlowCharacteristics, iso_mass_flow
from pneucli.recording import Recording, Rig


@dataclass(frozen=True)
class FlowSurface:
    """Flow in kg/s with the half width of its 95 % interval, over commands (i,) and pressures (j,): each (i, j)."""

    u: Array
    p: Array
    flow: Array
    half: Array


@dataclass(frozen=True)
class FlowBench:
    """The flow paths of a valve, in rising order of commands, the noise of the rows, and the uncertainty budgets."""

    paths: tuple[FlowPath, ...]
    law: NoiseLaw
    rig: Rig
    budgets: Mapping[str, Budget] = field(default_factory=dict)

    @property
    def commands(self) -> Array:
        """Commands in V, rising, shape (i,); NaN where the command is not known."""
        levels = sorted({np.inf if path.rows.u is None else path.rows.u for path in self.paths})
        return np.array([np.nan if np.isinf(u) else u for u in levels])

    @property
    def supply(self) -> float:
        """Supply pressure in Pa: as the rig states it, else the median of the rows."""
        forward = [path.rows.upstream for path in self.paths if path.rows.direction == "forward"]
        every = forward or [path.rows.upstream for path in self.paths]
        return self.rig.supply_pressure or float(np.median(np.concatenate(every)))

    def surface(self, u: Array, supply: float, p: Array) -> FlowSurface:
        """Return the flow at commands (V) and downstream pressures (Pa); linear in u between tested commands.

        Args:
            u: Commands within those that were tested, shape (i,); NaN for the command that is not known.
            supply: Supply pressure in Pa.
            p: Pressures behind the valve in Pa, shape (j,).

        Returns:
            The flow, positive from the supply to p.

        """
        tested = self.commands
        at = [self._at_command(level, supply, p) for level in tested]
        flow, half = (np.array([one[i] for one in at]) for i in (0, 1))
        if np.isnan(u).any() or tested.size == 1:
            chosen = np.zeros(u.size, dtype=int) if tested.size == 1 else np.full(u.size, tested.size - 1)
            return FlowSurface(u, p, flow[chosen], half[chosen])
        known = np.isfinite(tested)
        between = [
            np.array([np.interp(u, tested[known], column) for column in table[known].T]).T for table in (flow, half)
        ]
        return FlowSurface(u, p, between[0], between[1])

    def _at_command(self, u: float, supply: float, p: Array) -> tuple[Array, Array]:
        """Return the flow at one tested command, of all its paths, and the half width of its interval, (j,) each."""
        flow, variance = np.zeros(p.size), np.zeros(p.size)
        ends = {
            "forward": (np.full(p.size, supply), p),
            "reverse": (p, np.full(p.size, supply)),
            "to ambient": (p, np.full(p.size, self.rig.ambient_pressure)),
        }
        for path in self.paths:
            same = path.rows.u == u or (path.rows.u is None and np.isnan(u))
            if same:
                upstream, downstream = ends[path.rows.direction]
                own = path.flow(upstream, downstream, self.rig.gas_temperature)
                flow += path.rows.sign * own
                variance += path.flow_error(upstream, downstream, self.rig.gas_temperature) ** 2
        return flow, np.sqrt(variance)

    def command(self, flow: Array, supply: float, p: float) -> tuple[Array, Mask]:
        """Return the command (V) for each flow (kg/s) at one pressure p (Pa), clipped, and whether it is reachable."""
        tested = self.commands[np.isfinite(self.commands)]
        at = self.surface(tested, supply, np.array([p])).flow[:, 0]
        if at.size and at[-1] < at[0]:
            at, tested = at[::-1], tested[::-1]
        rising = np.maximum.accumulate(at)
        reachable = (flow >= rising[0]) & (flow <= rising[-1])
        return np.interp(flow, rising, tested), reachable

    def predicted(self, rows: FlowRows) -> Array:
        """Return the flow in kg/s of rows, shape (n,), NaN where no path of their direction was fitted around them."""
        alike = [path for path in self.paths if path.rows.direction == rows.direction]
        own = [path for path in alike if path.rows.u == rows.u]
        if own:
            return own[0].flow(rows.upstream, rows.downstream, rows.temperature)
        known = [path for path in alike if path.rows.u is not None]
        levels = np.array([path.rows.u for path in known], dtype=np.float64)
        if rows.u is None or not levels.size or not levels.min() <= rows.u <= levels.max():
            shut = not alike and float(np.max(np.abs(rows.flow))) == 0.0
            return np.zeros(rows.flow.size) if shut else np.full(rows.flow.size, np.nan)
        flows = np.array([path.flow(rows.upstream, rows.downstream, rows.temperature) for path in known])
        return np.array([np.interp(rows.u, levels, column) for column in flows.T])

    def deviation(self, rows: FlowRows) -> Array:
        """Return the standard deviation of the noise of rows in kg/s, shape (n,)."""
        alike = [path for path in self.paths if path.rows.direction == rows.direction] or list(self.paths)
        near = min(alike, key=lambda path: abs((path.rows.u or 0.0) - (rows.u or 0.0)))
        return flow_deviation(rows, near.characteristics, self.law)


@dataclass(frozen=True)
class FlowComparison:
    """Rows of one recording: measured and predicted flow in kg/s and the noise, each (n,) in the recording's order."""

    recording: Recording
    row: Integers
    u: Array
    measured: Array
    predicted: Array
    deviation: Array

    @property
    def noise(self) -> float:
        """Rms error of a correct model in kg/s."""
        valid = np.isfinite(self.predicted)
        return float(np.sqrt(np.mean(self.deviation[valid] ** 2))) if valid.any() else float("nan")


def identify_flow_bench(recordings: Sequence[Recording], rig: Rig) -> FlowBench | None:
    """Identify the flow paths of the recordings of use ``train``; None where nothing flows in them.

    Args:
        recordings: Recordings of steady benches.
        rig: The rig.

    Returns:
        The bench, with one path for each command and direction of flow.

    """
    paths, law = fit_flow_paths(flow_rows([one for one in recordings if one.use == "train"], rig))
    return FlowBench(tuple(paths), law, rig) if paths else None


def compare_flow(bench: FlowBench, recordings: Sequence[Recording]) -> list[FlowComparison]:
    """Compare the flow of each recording with that of the fitted paths.

    Args:
        bench: The fitted paths.
        recordings: Recordings of steady benches, fitted or held out.

    Returns:
        A comparison for each recording with usable rows.

    """
    found = []
    for recording in recordings:
        groups = flow_rows([recording], bench.rig)
        if not groups:
            continue
        row = np.concatenate([rows.row for rows in groups])
        order = np.argsort(row)
        u, measured, predicted, deviation = (
            np.concatenate(parts)[order]
            for parts in (
                [np.full(rows.flow.size, np.nan if rows.u is None else rows.u) for rows in groups],
                [rows.sign * rows.flow for rows in groups],
                [rows.sign * bench.predicted(rows) for rows in groups],
                [bench.deviation(rows) for rows in groups],
            )
        )
        found.append(FlowComparison(recording, row[order], u, measured, predicted, deviation))
    return found


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
