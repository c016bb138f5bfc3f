"""Monte Carlo study: the controller on axes that differ from the model of its design.

Each run draws an axis: identified parameters from their intervals, values of the rig from stated tolerances, and in
turn one effect of the catalogue at a plausible size (one run in as many as there are effects has none). Run k depends
on the seed and k alone. Chunks of runs go to any engine (:mod:`pneucli.executors`); finished chunks stay on disk, so
that an interrupted study continues.
"""

import hashlib
import json
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.closed_loop.metrics import Metrics, evaluate_run
from pneucli.closed_loop.simulation import ClosedLoopSetup, Scenario, simulate
from pneucli.controller.codegen import controller_source
from pneucli.controller.parameters import Controller
from pneucli.errors import InputError, require_known
from pneucli.executors import Engine, run_jobs
from pneucli.io.artifacts import write_text
from pneucli.messages.simulate import SuccessRate
from pneucli.physics.declaration import Effect
from pneucli.physics.effects import catalogue_with_sides
from pneucli.quantities import Z95
from pneucli.simulate.build import source
from pneucli.simulate.layout import BASE_NAMES
from pneucli.simulate.model import Model
from pneucli.simulate.rig_quantities import rig_quantities

CHUNK_SIZE = 16  # runs
TOLERANCES = {  # 1 sigma, relative: weighing, measuring drawings, a regulator's setting
    "rig.moving_mass": 0.02,
    "rig.dead_volume_1": 0.03,
    "rig.dead_volume_2": 0.03,
    "rig.supply_pressure": 0.01,
    "valve.areas": 0.02,
}
DEFAULT_LIMITS = {"steady_um": 10.0, "cycle_um": 10.0, "recovery_s": 0.5, "load_error": 0.1}


SETTING_KEYS = ("kind", "name", "runs", "seed", "tolerances", "checks")
MAX_RUNS = 1_000_000  # runs


@dataclass(frozen=True)
class MonteCarloSettings:
    """Settings of a study in a pipeline file; ``tolerances`` are relative 1 sigma, ``checks`` limits of figures."""

    runs: int = 112  # each effect of the catalogue four times
    seed: int = 0
    tolerances: Mapping[str, float] = field(default_factory=lambda: TOLERANCES)
    checks: Mapping[str, float] = field(default_factory=lambda: DEFAULT_LIMITS)


def read_settings(table: Mapping[str, Any], where: str) -> MonteCarloSettings:
    """Return the settings of a ``[[scenarios]]`` table; raises InputError for a key or value that cannot be read."""
    for key in table:
        require_known([key], SETTING_KEYS, f"{where}.{key}", "unknown key", code="E021")
    usual = MonteCarloSettings()
    return MonteCarloSettings(
        _count(table.get("runs", usual.runs), f"{where}.runs", 1),
        _count(table.get("seed", usual.seed), f"{where}.seed", 0),
        TOLERANCES | _numbers(table.get("tolerances", {}), f"{where}.tolerances", [*BASE_NAMES, "valve.areas"]),
        DEFAULT_LIMITS | _numbers(table.get("checks", {}), f"{where}.checks", [f.name for f in fields(Metrics)]),
    )


def _count(value: Any, where: str, least: int) -> int:
    if not isinstance(value, int) or not least <= value <= MAX_RUNS:
        raise InputError(where, f"{value}", f"a whole number from {least} to {MAX_RUNS}", code="E023")
    return value


def _numbers(values: Any, where: str, known: Sequence[str]) -> dict[str, float]:
    if not isinstance(values, Mapping):
        raise InputError(where, f"{values}", "a table of numbers", code="E023")
    for name, value in values.items():
        require_known([name], known, f"{where}.{name}", "unknown key", code="E021")
        if not isinstance(value, int | float) or value < 0:
            raise InputError(f"{where}.{name}", f"{value}", "a number, not below 0", code="E023")
    return {name: float(value) for name, value in values.items()}


@dataclass(frozen=True)
class AxisDistribution:
    """Distribution of axes: 1 sigma of identified parameters by name, relative tolerances, and effects."""

    model: Model
    sigma: Mapping[str, float]
    tolerances: Mapping[str, float]
    effects: tuple[Effect, ...]

    def draw(self, seed: int, k: int) -> tuple[Model, str, dict[str, float]]:
        """Return the axis of run k, the name of its effect ("" for none) and the sizes of that effect's parameters."""
        rng = np.random.default_rng([seed, k])
        model = drawn_model(self.model, self.sigma, self.tolerances, rng)
        place = k % (len(self.effects) + 1)
        if place == 0:
            return model, "", {}
        effect = self.effects[place - 1]
        sizes = draw_effect_size(effect, model, rng)
        return replace(model, effects=(*model.effects, effect)).with_values(sizes), effect.name, sizes


def drawn_model(
    model: Model, sigma: Mapping[str, float], tolerances: Mapping[str, float], rng: np.random.Generator
) -> Model:
    """Return a model with parameters from their 1 sigma and the rig's values from their relative tolerances."""
    base = model.base_values() | dict(model.values)
    values = {n: base[n] + s * rng.standard_normal() for n, s in sorted(sigma.items()) if n in base}
    for name, share in sorted(tolerances.items()):
        if name in BASE_NAMES:
            values[name] = values.get(name, base[name]) * (1.0 + share * rng.standard_normal())
    factor = 1.0 + tolerances.get("valve.areas", 0.0) * rng.standard_normal()
    return replace(model.with_values(values), valve=model.valve.scaled(factor))


def draw_effect_size(effect: Effect, model: Model, rng: np.random.Generator) -> dict[str, float]:
    """Return a size for each main parameter, between its least and its largest typical value (log-uniform, same sign).

    Raises InputError where the rig does not tell it.
    """
    facts, sizes = rig_quantities(model), {}
    for p in effect.main_parameters:
        size = p.range_on(facts)
        if not size.typical:
            raise effect.missing_scale_error(facts)
        low, high = min(size.typical), max(size.typical)
        share = rng.random()
        sizes[f"{effect.name}.{p.name}"] = (
            low * (high / low) ** share if low * high > 0.0 else low + share * (high - low)
        )
    return sizes


@dataclass(frozen=True)
class MonteCarloStudy:
    """A Monte Carlo study: axes, controller, scenarios, sensors, number of runs, seed, and the checks' limits."""

    distribution: AxisDistribution
    controller: Controller
    scenarios: tuple[Scenario, ...]
    setup: ClosedLoopSetup
    runs: int
    seed: int
    checks: Mapping[str, float]

    def key(self) -> str:
        """Return a hash of all inputs of the study, so that finished chunks of another study are not used."""
        model = self.distribution.model
        about = {
            "program": source(tuple(catalogue_with_sides().values()), control=controller_source()),
            "controller": self.controller.to_json(),
            "scenarios": [
                [s.name, s.reference.tobytes().hex(), s.force.tobytes().hex(), str(s)] for s in self.scenarios
            ],
            "bench": asdict(self.setup),
            "model": [sorted(model.values.items()), [e.name for e in model.effects], str(model.valve), str(model.rig)],
            "axes": [sorted(self.distribution.sigma.items()), sorted(self.distribution.tolerances.items())],
            "effects": [e.name for e in self.distribution.effects],
            "seed": self.seed,
        }
        return hashlib.sha256(json.dumps(about, sort_keys=True).encode()).hexdigest()


def run_draw(study: MonteCarloStudy, k: int) -> list[dict[str, Any]]:
    """Return a row a scenario of run k: draw, figures, and passed checks (None if not shown)."""
    model, effect, sizes = study.distribution.draw(study.seed, k)
    rows = []
    for scenario in study.scenarios:
        supplied = scenario.supplied_by(model, study.controller)
        result = simulate(model, study.controller, supplied, study.setup, seed=study.seed + k)
        figures = asdict(evaluate_run(result, model, study.controller))
        held = {n: bool(figures[n] <= limit) for n, limit in study.checks.items() if not np.isnan(figures[n])}
        rows.append({"run": k, "scenario": scenario.name, "effect": effect, "sizes": sizes, **figures, "held": held})
    return rows


def run_chunk(study: MonteCarloStudy, first: int) -> list[dict[str, Any]]:
    """Return the rows of one chunk of runs."""
    return [row for k in range(first, min(first + CHUNK_SIZE, study.runs)) for row in run_draw(study, k)]


def run_study(
    study: MonteCarloStudy,
    engine: Engine,
    folder: Path,
    progress: Callable[[str, float], None] = lambda message, share: None,
) -> list[dict[str, Any]]:
    """Return the rows of all runs, in order; finished chunks in ``folder`` are not run again."""
    place = folder / study.key()[:16]
    place.mkdir(parents=True, exist_ok=True)
    first = range(0, study.runs, CHUNK_SIZE)
    paths = {k: place / f"{k:06d}_{min(CHUNK_SIZE, study.runs - k)}.json" for k in first}
    missing = deque(k for k in first if not paths[k].exists())
    before = len(first) - len(missing)
    progress(f"{before} of {len(first)} chunks", before / len(first))
    for done, outcome in enumerate(run_jobs(engine, partial(run_chunk, study), missing), before + 1):
        if outcome.error is not None:
            raise outcome.error
        write_text(paths[outcome.job], json.dumps(outcome.result))
        progress(f"{done} of {len(first)} chunks", done / len(first))
    return [row for k in first for row in json.loads(paths[k].read_text(encoding="utf-8"))]


def success_rates(rows: Sequence[Mapping[str, Any]], checks: Mapping[str, float]) -> list[SuccessRate]:
    """Return the rates per check: over all runs first, then per effect."""
    rates = []
    for check, limit in checks.items():
        shown = [r for r in rows if check in r["held"]]
        for effect in ["all", *sorted({r["effect"] for r in shown})]:
            mine = [r for r in shown if effect in ("all", r["effect"])]
            if mine:
                worst = max(mine, key=lambda r: r[check])
                held = sum(r["held"][check] for r in mine)
                rates.append(SuccessRate(check, limit, effect, held, len(mine), worst[check], worst["run"]))
    return rates


def sigma_from_intervals(intervals: Mapping[str, tuple[float, float]], model: Model) -> dict[str, float]:
    """Return 1 sigma of the parameters of the model from their 95 % intervals; unknown names are left out."""
    known = model.base_values() | dict(model.values)
    return {
        n: (high - low) / (2 * Z95) for n, (low, high) in intervals.items() if n in known and np.isfinite(high - low)
    }
