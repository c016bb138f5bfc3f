"""Acceptance test: the controller against its requirements, on the model, at the ends of intervals, and on draws.

Two criteria always hold: rest within the tolerance, and no limit cycle there. ``[design]`` may state settling time,
overshoot, tracking error and stiffness. A violation on the model, at an end of an interval, or on more than one draw in
twenty is reported, with its cause if a limit of the plant causes it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from pneucli.closed_loop.metrics import Metrics, evaluate_run
from pneucli.closed_loop.plant_limits import limiting_cause, min_air_stiffness
from pneucli.closed_loop.robustness import TOLERANCES, AxisDistribution
from pneucli.closed_loop.simulation import ClosedLoopSetup, Scenario, simulate
from pneucli.controller.parameters import Controller, nominal_load
from pneucli.design.air_spring import unmet_requirements
from pneucli.design.requirements import Requirements
from pneucli.simulate.model import Model

DRAW_COUNT, SEED = 50, 0
ALLOWED_FAILURE_RATE = 0.05  # share of the draws that may miss
ACCEPTANCE_SCENARIOS = ("steps", "sine", "load")
NOMINAL_AXIS, DRAWN_AXIS = "the model", "draws"
MICROMETRES_PER_METRE = 1e6


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
class Violation:
    """A violated criterion: worst figure, axis and scenario of it, and the cause ("": unknown).

    ``share``: share of the draws that violate it. The cause is a code with its quantities in SI units;
    :mod:`pneucli.messages.acceptance` words it.
    """

    demand: str
    limit: float
    found: float
    unit: str
    axis: str
    scenario: str
    share: float
    cause: str
    quantities: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class AcceptanceResult:
    """Result of the acceptance test: violations, all criteria, and the number of axes."""

    violations: tuple[Violation, ...]
    criteria: tuple[Criterion, ...]
    axis_count: int


def acceptance_criteria(requirements: Requirements, controller: Controller) -> list[Criterion]:
    """Return the criteria of the loop: rest and limit cycle always, others as stated."""
    tolerance, push = 2.0 * controller.values["C_HOLDING_BAND"], nominal_load(controller.values)
    found = [
        Criterion("tolerance", tolerance, "m", lambda m: m.steady_um / MICROMETRES_PER_METRE),
        Criterion("no limit cycle", tolerance, "m", lambda m: m.cycle_um / MICROMETRES_PER_METRE),
    ]
    if requirements.settling_time is not None:
        found.append(Criterion("settling_time", requirements.settling_time, "s", lambda m: m.settling_s))
    if requirements.overshoot is not None:
        found.append(
            Criterion("overshoot", requirements.overshoot, "m", lambda m: m.overshoot_um / MICROMETRES_PER_METRE)
        )
    if requirements.tracking_error is not None:
        found.append(
            Criterion(
                "tracking_error", requirements.tracking_error, "m", lambda m: m.tracking_rms_um / MICROMETRES_PER_METRE
            )
        )
    if requirements.stiffness is not None:
        found.append(
            Criterion(
                "stiffness",
                requirements.stiffness,
                "N/m",
                lambda m: push / (m.peak_um / MICROMETRES_PER_METRE),
                at_least=True,
            )
        )
    return found


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
    progress: Callable[[float], None] = lambda share: None,
) -> AcceptanceResult:
    """Run the controller on every axis and return its violations.

    Args:
        controller: The controller to test.
        requirements: Limits of the criteria.
        scenarios: Scenarios of each axis.
        setup: Noise, quanta and delay of the sensors.
        axes: Axes by name, see :func:`axis_variants`.
        progress: Called with the share of the axes that are done, 0 to 1.

    """
    asked = acceptance_criteria(requirements, controller)
    rows: list[tuple[str, str, dict[str, float]]] = []
    for i, (name, model) in enumerate(axes):
        progress(i / len(axes))
        for scenario in scenarios:
            figures = evaluate_run(simulate(model, controller, scenario, setup, seed=SEED + i), model, controller)
            rows.append((name, scenario.name, {d.name: d.figure(figures) for d in asked}))
    missed = [_violation(demand, rows, controller, requirements, scenarios) for demand in asked]
    spring = unmet_requirements(requirements, controller.values, min_air_stiffness(controller.values))
    missed += [
        Violation(u.name, u.limit, u.found, u.unit, NOMINAL_AXIS, "the enclosed gas", 0.0, u.cause) for u in spring
    ]
    return AcceptanceResult(
        tuple(one for one in missed if one is not None), (*asked, *gas_spring_criteria(requirements)), len(axes)
    )


def _violation(
    demand: Criterion,
    rows: Sequence[tuple[str, str, Mapping[str, float]]],
    controller: Controller,
    wanted: Requirements,
    scenarios: Sequence[Scenario],
) -> Violation | None:
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
    cause, quantities = limiting_cause(demand.name, demand.limit, controller, wanted, scenarios)
    found = figures[demand.name]
    return Violation(demand.name, demand.limit, found, demand.unit, axis, scenario, share, cause, quantities)
