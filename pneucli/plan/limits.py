"""The limits of a rig, and whether a manoeuvre keeps them in every model that may be true."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pneucli.identify.estimation.fit import Fit
from pneucli.messages.plan import ExceededLimit
from pneucli.plan.bench import SPEED_FACTOR, USUAL_SPEED, Bench, Manoeuvre, Outcome
from pneucli.plan.simulation import simulate_manoeuvre
from pneucli.recording import Rig
from pneucli.simulate.model import Model, has_parameter, parameter_value, with_parameters
from pneucli.simulate.valve_forms import ValveArea

SHIFTED_BEST = 4  # draws of the best model's parameters
SHIFTED_RIVAL = 1  # draws of each rival's
SEED = 49
BEST_MODEL = "best model"


@dataclass(frozen=True)
class Refused:
    """A manoeuvre that could exceed a limit: the model with which it does, and the limits."""

    manoeuvre: Manoeuvre
    model: str
    violations: tuple[ExceededLimit, ...]


@dataclass
class Safety:
    """The models in which every manoeuvre of a plan is simulated, and the manoeuvres that were refused.

    Attributes:
        rig: The rig.
        limits: Its limits.
        models: Models by name: the best one, its rivals, and each with parameters off by their intervals.
        refused: The refused manoeuvres.
    """

    rig: Rig
    limits: Limits
    models: Mapping[str, Model]
    refused: list[Refused] = field(default_factory=list)

    def __call__(self, manoeuvre: Manoeuvre) -> bool:
        """Return whether a manoeuvre keeps all limits, with a reserve, in every model; a refusal is noted."""
        limits = self.limits.with_reserve()
        for name, model in self.models.items():
            if found := violations(simulate_manoeuvre(manoeuvre, model), limits, self.rig):
                self.refused.append(Refused(manoeuvre, name, tuple(found)))
                return False
        return True


END_MARGIN_SHARE = 0.05  # of the stroke, at each end
PRESSURE_FACTOR = 1.15  # times the supply pressure: a moving piston compresses gas beyond it
FORCE_FACTOR = 1.1  # times the force of the supply pressure on the larger area
MAX_FREQUENCY = 5.0  # Hz, of a motion
SOFT_START = 0.7  # s, from rest to the first position
POSITION_RESERVE = 0.03  # of the allowed stroke, at each end, that a simulated manoeuvre leaves
SPEED_RESERVE = 0.1  # of the highest speed
FORCE_RESERVE = 0.05  # of the largest force
PRESSURE_RESERVE = 0.02  # of the highest pressure
DENSITY_ANR = 1.185  # kg/m^3, of air at 100 kPa and 20 degC (ISO 8778)


@dataclass(frozen=True)
class Limits:
    """The limits of a rig, SI.

    Attributes:
        position: Lowest and highest position that a manoeuvre may reach.
        max_speed: Highest speed.
        max_pressure: Highest absolute pressure of a chamber.
        max_force: Largest net force of the pressures on the piston.
        max_command: Largest command in V from the null command; None: as recorded.
        max_frequency: Highest frequency of a motion in Hz.
        soft_start: Time in s from rest to the first position.
        max_air: Most air in kg of one manoeuvre; infinite: not limited.
    """

    position: tuple[float, float] = (-np.inf, np.inf)
    max_speed: float = np.inf
    max_pressure: float = np.inf
    max_force: float = np.inf
    max_command: float | None = None
    max_frequency: float = MAX_FREQUENCY
    soft_start: float = SOFT_START
    max_air: float = np.inf

    def with_reserve(self) -> Limits:
        """Return limits that a simulation must keep so that the rig keeps these: the models are not the rig.

        >>> Limits(position=(0.0, 1.0), max_speed=1.0).with_reserve().position
        (0.03, 0.97)
        """
        low, high = self.position
        inset = POSITION_RESERVE * (high - low) if np.isfinite(high - low) else 0.0
        return replace(
            self,
            position=(low + inset, high - inset),
            max_speed=(1.0 - SPEED_RESERVE) * self.max_speed,
            max_force=(1.0 - FORCE_RESERVE) * self.max_force,
            max_pressure=(1.0 - PRESSURE_RESERVE) * self.max_pressure,
        )

    def command_range(self, bench: Bench) -> float:
        """Return the largest command in V from the null command that a bench may get."""
        return bench.command_range if self.max_command is None else min(self.max_command, bench.command_range)


def limits_of(rig: Rig, benches: Iterable[Bench], stated: Mapping[str, Any] | None = None) -> Limits:
    """Return the limits of a rig: as stated in ``[plan]``, else from the rig and its recordings.

    Args:
        rig: The rig.
        benches: Its benches.
        stated: Values by key of ``[plan]``, SI; None or absent: default.

    Returns:
        The limits.
    """
    given = {key: value for key, value in (stated or {}).items() if value is not None}
    stroke = rig.stroke or np.inf
    margin = given.get("end_margin", END_MARGIN_SHARE * stroke if np.isfinite(stroke) else 0.0)
    recorded = max((bench.speed for bench in benches), default=0.0)
    supply = rig.supply_pressure or np.inf
    force = (supply - rig.ambient_pressure) * max(rig.piston_areas)
    return Limits(
        position=(margin, stroke - margin) if rig.has_cylinder and np.isfinite(stroke) else (-np.inf, np.inf),
        max_speed=given.get("max_speed", SPEED_FACTOR * recorded or USUAL_SPEED),
        max_pressure=given.get("max_pressure", PRESSURE_FACTOR * supply),
        max_force=given.get("max_force", FORCE_FACTOR * force if force > 0.0 else np.inf),
        max_command=given.get("max_command"),
        max_frequency=given.get("max_frequency", MAX_FREQUENCY),
        soft_start=given.get("soft_start", SOFT_START),
        max_air=DENSITY_ANR * given["max_air"] if "max_air" in given else np.inf,
    )


def violations(outcome: Outcome, limits: Limits, rig: Rig) -> list[ExceededLimit]:
    """Return the limits that a simulated manoeuvre exceeds.

    Args:
        outcome: The simulated manoeuvre.
        limits: The limits.
        rig: The rig.

    Returns:
        The violations; a state that is not finite violates every limit.
    """
    found = []
    checked = [("p1", outcome.p1)] + ([] if outcome.p2 is None else [("p2", outcome.p2)])
    for name, pressure in checked:
        found += _above(name, pressure, limits.max_pressure, "Pa")
        found += _below(name, pressure, outcome.lowest_pressure, "Pa")
    if outcome.x is not None:  # it may stand where it starts: a spring holds a piston on its end
        first = float(outcome.x[0])
        found += _below("x", outcome.x, min(limits.position[0], first), "m")
        found += _above("x", outcome.x, max(limits.position[1], first), "m")
    if outcome.v is not None:
        found += _above("v", np.abs(outcome.v), limits.max_speed, "m/s")
    if outcome.p2 is not None and rig.has_cylinder:
        area_1, area_2 = rig.piston_areas
        ambient = rig.ambient_pressure
        net = area_1 * (outcome.p1 - ambient) - area_2 * (outcome.p2 - ambient)
        found += _above("force", np.abs(net), limits.max_force, "N")
    found += _above("air", np.array([outcome.air]), limits.max_air, "kg")
    return found


def _above(quantity: str, values: np.ndarray, limit: float, unit: str) -> list[ExceededLimit]:
    largest = float(np.max(values))
    return [] if largest <= limit else [ExceededLimit(quantity, largest, limit, unit)]  # NaN violates


def _below(quantity: str, values: np.ndarray, limit: float, unit: str) -> list[ExceededLimit]:
    least = float(np.min(values))
    return [] if least >= limit else [ExceededLimit(quantity, least, limit, unit)]


def models_to_check(best: Fit, rivals: Mapping[str, Model]) -> dict[str, Model]:
    """Return the models in which a manoeuvre must keep the limits.

    Args:
        best: The fit of the best model, whose covariance says how far parameters may be off.
        rivals: The models of its rivals by name.

    Returns:
        Models by name.
    """
    models: dict[str, Model] = {}
    for number, (rival, model) in enumerate({BEST_MODEL: best.model, **rivals}.items()):
        models[rival] = model
        count = SHIFTED_RIVAL if number else SHIFTED_BEST
        for k, shifted in enumerate(shifted_models(best, model, count, SEED + number), 1):
            models[f"{rival}, parameters off by their intervals ({k})"] = shifted
    return models


def shifted_models(fitted: Fit, model: Model, count: int, seed: int, sigma: float = 2.0) -> list[Model]:
    """Draw models whose parameters are off by their intervals.

    Args:
        fitted: The fit whose covariance says how far.
        model: The model to shift; parameters that it lacks are ignored.
        count: Number of models.
        seed: Seed of the draws.
        sigma: Standard errors at which each draw lies, along a random direction.

    Returns:
        The models.
    """
    rng, k = np.random.default_rng(seed), len(fitted.free)
    if k == 0:
        return [model] * count
    values, vectors = np.linalg.eigh(fitted.covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    models = []
    for _ in range(count):
        direction = rng.standard_normal(k)
        direction *= sigma / max(np.abs(direction).max(), 1e-9)
        change = root @ direction
        shifted = {}
        for f, dz in zip(fitted.free, change, strict=True):
            z = f.to_coordinate(parameter_value(model, f.name)) if has_parameter(model, f.name) else np.nan
            value = f.from_coordinate(z + float(dz)) if np.isfinite(z) else np.nan
            if np.isfinite(value):
                shifted[f.name] = float(np.clip(value, f.lower, f.upper))
        models.append(with_monotone_valves(with_parameters(model, shifted)))
    return models


def with_monotone_valves(model: Model) -> Model:
    """Return a model whose valve maps pass no more at a command than at one farther from the null on the same side.

    The area within the dead zone is known to orders of magnitude only: a draw of it alone is an open valve at rest.
    """
    first, second = model.valve, model.valve_2
    if isinstance(first, ValveArea):
        model = replace(model, valve=_monotone(first))
    return replace(model, valve_2=_monotone(second)) if isinstance(second, ValveArea) else model


def _monotone(valve: ValveArea) -> ValveArea:
    commands, areas = np.array(valve.commands), np.array(valve.areas)
    vents = commands < 0.0
    inward = np.concatenate([np.minimum.accumulate(areas[vents]), np.minimum.accumulate(areas[~vents][::-1])[::-1]])
    return replace(valve, areas=tuple(float(a) for a in inward))
