"""Acceptance test: the controller against its requirements, on the model, at the ends of intervals, and on draws.

Two criteria always hold: rest within the tolerance, and no limit cycle there. ``[design]`` may state settling time,
overshoot, tracking error and stiffness. A violation on the model, at an end of an interval, or on more than one draw in
twenty is reported, with its cause if a limit of the plant causes it.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pneucli.closed_loop.metrics import Metrics, evaluate_run
from pneucli.closed_loop.robustness import TOLERANCES, AxisDistribution
from pneucli.closed_loop.simulation import ClosedLoopSetup, Scenario, simulate
from pneucli.controller.parameters import Controller, nominal_load
from pneucli.design.air_spring import stiffness_per_pressure, unmet_requirements
from pneucli.design.bandwidths import chamber_2_pressure, reachable_speed_and_gradient
from pneucli.design.requirements import Requirements
from pneucli.messages.design import MissedRequirement, cause_text
from pneucli.physics.gas import PSI_MAX
from pneucli.simulate.model import Model

DRAW_COUNT, SEED = 50, 0
ALLOWED_FAILURE_RATE = 0.05  # share of the draws that may miss
ACCEPTANCE_SCENARIOS = ("steps", "sine", "load")
NOMINAL_AXIS, DRAWN_AXIS = "the model", "draws"
MICROMETRES_PER_METRE = 1e6


def limiting_cause(
    demand: str, limit: float, controller: Controller, requirements: Requirements, scenarios: Sequence[Scenario]
) -> tuple[str, dict[str, float]]:
    """Return the limit of the plant that causes a violation.

    Args:
        demand: Name of the violated criterion.
        limit: Its limit in SI units.
        controller: The controller with the parameters of the axis.
        requirements: Resolution and noise of the position sensor in m.
        scenarios: The scenarios that were run.

    Returns:
        Code and quantities (SI) of the limit; ("", {}) where no limit of the plant explains the violation.
    """
    c = controller.values
    if demand == "settling_time":
        distance = max(float(np.max(np.abs(np.diff(s.reference)), initial=0.0)) for s in scenarios)
        shortest = distance / reachable_speed_and_gradient(c)[0]  # the least time, at the largest speed of the valve
        if limit < shortest:
            return "travel-time", {"distance": distance, "time": shortest}
    if demand == "tracking_error":
        asked, speed = max(_fastest(s, c["C_PERIOD"]) for s in scenarios), reachable_speed_and_gradient(c)[0]
        if asked > speed:
            return "speed", {"asked": asked, "reachable": speed}
    if demand == "stiffness" and limit > (most := max_load_stiffness(c)):
        return "stiffness", {"reachable": most}
    if demand in ("tolerance", "no limit cycle"):
        resolvable = max(requirements.quantum_x, 2.0 * requirements.noise_x)
        if limit < resolvable:
            return "resolution", {"resolvable": resolvable}
    return "", {}


def max_load_stiffness(c: Mapping[str, float]) -> float:
    """Return the largest load stiffness in N/m that any controller reaches under a step of the nominal load.

    The load F above friction acts against a force that the valve builds at its full rate R from the first instant:
    ``m dv/dt = F - R t`` comes to rest after ``2 F^3 / (3 m R^2)``. The stiffness of the enclosed gas adds to it.
    """
    push, rate = nominal_load(c), max_force_rate(c)
    left = push - c["C_STATIC"]
    if left <= 0.0:
        return math.inf
    return 1.5 * push / left * c["C_MASS"] * (rate / left) ** 2 + min_air_stiffness(c)


def max_force_rate(c: Mapping[str, float]) -> float:
    """Return the largest rate of force in N/s of the open valve at mid-stroke, choked both ways."""
    choked, half = c["C_GAMMA_R_T"] * c["C_K_GAS"] * c["C_SUPPLY"] * PSI_MAX, 0.5 * c["C_STROKE"]
    one = c["C_AREA_1"] / (c["C_DEAD_VOLUME_1"] + c["C_AREA_1"] * half) * max(c["C_AREA_FILL"], c["C_AREA_VENT"])
    two = c["C_AREA_2"] / (c["C_DEAD_VOLUME_2"] + c["C_AREA_2"] * half) * max(c["C_AREA_FILL_2"], c["C_AREA_VENT_2"])
    driven = c["C_TWO_VALVES"] > 0.5 or c["C_MIRRORED"] > 0.5
    return choked * (one + two * driven)


def min_air_stiffness(c: Mapping[str, float]) -> float:
    """Return the least stiffness in N/m of the enclosed gas over the middle 60 % of the stroke (isentropic)."""
    x = np.linspace(0.2, 0.8, 25) * c["C_STROKE"]
    p2 = chamber_2_pressure(c, x)
    p1 = (c["C_AREA_2"] * p2 + (c["C_AREA_1"] - c["C_AREA_2"]) * c["C_AMBIENT"]) / c["C_AREA_1"]
    one, two = stiffness_per_pressure(c, x)
    return float(np.min(p1 * one + p2 * two))


def _fastest(scenario: Scenario, period: float) -> float:
    """Return the largest speed in m/s of a reference without jumps; 0 for one with jumps."""
    rate = np.abs(np.diff(scenario.reference)) / period
    smooth = np.max(np.abs(np.diff(rate)), initial=0.0) < 0.5 * np.max(rate, initial=0.0)
    return float(np.max(rate, initial=0.0)) if smooth else 0.0


@dataclass(frozen=True)
class Criterion:
    """A criterion: name, limit in ``unit``, and the figure of a run (NaN: the run does not show it).

    ``at_least``: the figure must not be below the limit, else not above.
    """

    name: str
    limit: float
    unit: str
    figure: Callable[[Metrics], float]
    at_least: bool = False

    def is_violated(self, value: float) -> bool:
        """Whether a figure violates the limit; NaN does not."""
        return not math.isnan(value) and (value < self.limit if self.at_least else value > self.limit)


@dataclass(frozen=True)
class AcceptanceResult:
    """Result of the acceptance test: violations, all criteria, and the number of axes."""

    violations: tuple[MissedRequirement, ...]
    criteria: tuple[Criterion, ...]
    axis_count: int


def acceptance_criteria(requirements: Requirements, controller: Controller) -> list[Criterion]:
    """Return the criteria of the loop: rest and limit cycle always, others as stated."""
    tolerance, push = 2.0 * controller.values["C_HOLDING_BAND"], nominal_load(controller.values)
    asked: tuple[tuple[str, float | None, str, Callable[[Metrics], float]], ...] = (
        ("tolerance", tolerance, "m", lambda m: m.steady_um / MICROMETRES_PER_METRE),
        ("no limit cycle", tolerance, "m", lambda m: m.cycle_um / MICROMETRES_PER_METRE),
        ("settling_time", requirements.settling_time, "s", lambda m: m.settling_s),
        ("overshoot", requirements.overshoot, "m", lambda m: m.overshoot_um / MICROMETRES_PER_METRE),
        ("tracking_error", requirements.tracking_error, "m", lambda m: m.tracking_rms_um / MICROMETRES_PER_METRE),
        ("stiffness", requirements.stiffness, "N/m", lambda m: push / (m.peak_um / MICROMETRES_PER_METRE)),
    )
    return [
        Criterion(name, limit, unit, figure, at_least=name == "stiffness")
        for name, limit, unit, figure in asked
        if limit is not None
    ]


def gas_spring_criteria(requirements: Requirements) -> list[Criterion]:
    """Return the criteria of the enclosed gas, which arrangement and supply decide, not a run."""
    asked = (
        ("pressure_level", requirements.pressure_level, "Pa"),
        ("air_stiffness", requirements.air_stiffness, "N/m"),
    )
    return [
        Criterion(n, limit, unit, lambda m: math.nan, at_least=True) for n, limit, unit in asked if limit is not None
    ]


def axis_variants(
    model: Model, intervals: Mapping[str, tuple[float, float]], sigma: Mapping[str, float], draws: int = DRAW_COUNT
) -> Iterator[tuple[str, Model]]:
    """Yield axes by name: the model, one parameter at a time at an end of its interval, and draws of all."""
    yield NOMINAL_AXIS, model
    known = model.base_values() | dict(model.values)
    for name, ends in sorted(intervals.items()):
        if name in known and all(map(math.isfinite, ends)):
            for word, end in zip(("low", "high"), ends, strict=True):
                yield f"{name} {word}", model.with_values({name: end})
    drawn = AxisDistribution(model, sigma, TOLERANCES, ())
    for k in range(draws):
        yield DRAWN_AXIS, drawn.draw(SEED, k)[0]


def check_acceptance(
    controller: Controller,
    requirements: Requirements,
    scenarios: Sequence[Scenario],
    setup: ClosedLoopSetup,
    axes: Sequence[tuple[str, Model]],
    progress: Callable[[int], None] = lambda number: None,
) -> AcceptanceResult:
    """Run the controller on every axis and return its violations.

    Args:
        controller: The controller to test.
        requirements: Limits of the criteria.
        scenarios: Scenarios of each axis.
        setup: Noise, quanta and delay of the sensors.
        axes: Axes by name, see :func:`axis_variants`.
        progress: Called with the number of each axis, from 0 on.

    """
    asked = acceptance_criteria(requirements, controller)
    rows: list[tuple[str, str, dict[str, float]]] = []
    for i, (name, model) in enumerate(axes):
        progress(i)
        for scenario in scenarios:
            run = simulate(model, controller, scenario.supplied_by(model, controller), setup, seed=SEED + i)
            figures = evaluate_run(run, model, controller)
            rows.append((name, scenario.name, {d.name: d.figure(figures) for d in asked}))
    missed = [_violation(demand, rows, controller, requirements, scenarios) for demand in asked]
    spring = unmet_requirements(requirements, controller.values, min_air_stiffness(controller.values))
    return AcceptanceResult(
        (*(one for one in missed if one is not None), *spring), (*asked, *gas_spring_criteria(requirements)), len(axes)
    )


def _violation(
    demand: Criterion,
    rows: Sequence[tuple[str, str, Mapping[str, float]]],
    controller: Controller,
    wanted: Requirements,
    scenarios: Sequence[Scenario],
) -> MissedRequirement | None:
    """Return the violation of a criterion, or None."""
    drawn = [demand.is_violated(figures[demand.name]) for axis, _, figures in rows if axis == DRAWN_AXIS]
    per_draw = np.reshape(drawn, (-1, len(scenarios))).any(axis=1) if drawn else np.zeros(1, dtype=bool)
    share = float(np.mean(per_draw))
    counted = [
        r
        for r in rows
        if demand.is_violated(r[2][demand.name]) and (r[0] != DRAWN_AXIS or share > ALLOWED_FAILURE_RATE)
    ]
    if not counted:
        return None
    sign = -1.0 if demand.at_least else 1.0
    axis, scenario, figures = max(counted, key=lambda r: (r[0] == NOMINAL_AXIS, sign * r[2][demand.name]))
    cause = cause_text(*limiting_cause(demand.name, demand.limit, controller, wanted, scenarios))
    return MissedRequirement(demand.name, demand.limit, figures[demand.name], demand.unit, axis, scenario, share, cause)
