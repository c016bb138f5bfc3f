"""Valves against the truth: ``python -m benchmarks.valve maps|missing|budgets|commands``.

``maps [SEED...]``: maps and inverses of healthy rigs of the exam, for each arrangement of valves. A row says what the
map was made of; of its points that recordings covered and where more than 1 % of the largest gradient flows, the median
and 95th percentile of the error over the true gradient and the share of points whose interval holds the truth; of the
inverse, the share of points that is reachable and the error of the gradient that the answered command truly makes.
"no vessel" leaves out the valve tests.

``missing [SEED...]``: the same of valve tests of one chamber with an effect that the model lacks; a flow that it adds
to that of the valve is not in the truth.

``budgets [DRAWS]``: the uncertainty budgets of C, b and m against a Monte Carlo of their inputs (JCGM 101). A steady
bench of 40 rows is fitted again in each draw. Of a charge or discharge test, the equation of C is computed; its
thermal state has bounds and no distribution, so the draws are made at either bound and, as JCGM 101 has it, evenly
between the bounds. Printed is how far the ends of the budget are from those of the draws, and the least share of
draws inside over all states of the wall (0 to 100 W/(m^2 K)). ``budgets recorded`` identifies charge and discharge
tests of a vessel whose gas exchanges heat with its wall, and compares C with the true one.

``commands FOLDER...``: does the map predict a command that was not fitted? A folder holds cases with
``pipeline.toml`` and ``truth.json``. The recordings that hold one command are left out, one command after another,
and the valve is fitted to the others; errors on fitted recordings and on those left out are in units of what a right
model would show.
"""

import re
import sys
import tempfile
import tomllib
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from benchmarks import rigs
from benchmarks.cases import Truth, truth_of, truths
from pneucli.config import load
from pneucli.diagnose.adequacy import held_out_lack_of_fit, lack_of_fit_by_channel
from pneucli.diagnose.subsample import MAX_SAMPLES
from pneucli.exam.cases import generate_case
from pneucli.exam.conditions import parse
from pneucli.figure import Figure
from pneucli.identify.estimation.model_fit import fit_model
from pneucli.identify.guesses.base_model import guess_base_model
from pneucli.identify.residuals import ResidualModel, residual_models
from pneucli.identify.valve.charge_budget import (
    Vessel,
    budget_of_conductance,
    conductance_factor,
    with_budgets,
    with_flow_budgets,
)
from pneucli.identify.valve.flow_bench import FlowBench, identify_flow_bench
from pneucli.identify.valve.identification import identify_valve
from pneucli.identify.valve.iso6358 import IsoConductance
from pneucli.identify.valve.steady_flow import refit
from pneucli.identify.valve.steady_rows import coordinates_of
from pneucli.identify.valve.uncertainty import Measurement
from pneucli.io.artifacts import read_table
from pneucli.messages.identify import Budget
from pneucli.noise import NoiseModel
from pneucli.physics.iso_flow import REFERENCE_DENSITY, FlowCharacteristics, iso_mass_flow
from pneucli.pipeline.graph import Context
from pneucli.quantities import Z95
from pneucli.recording import Calibration, Recording, Rig
from pneucli.simulate import layout as at
from pneucli.simulate.model import Model
from pneucli.simulate.preparation import prepare
from pneucli.simulate.valve_forms import ValveArea
from pneucli.stages import identify, ingest
from pneucli.stages.pipeline_data import PipelineData
from pneucli.units import parse_quantity

Array = NDArray[Any]
CASES = (
    ("one chamber (3/2)", "valve", "usual"),
    ("5/3, null near 5 V", "valve", "5/3-null"),
    ("two valves", "valve", "two-valves"),
    ("switching", "valve", "switching"),
    ("switching, two valves", "valve", "switching+two-valves"),
    ("vessel behind hose and tank", "valve", "tank"),
    ("one chamber, no vessel", "axis", "usual"),
    ("5/3, null near 5 V, no vessel", "axis", "5/3-null"),
    ("two valves, no vessel", "axis", "two-valves"),
    ("switching, no vessel", "axis", "switching"),
)
MISSING = (
    *("heat-transfer", "critical-ratio", "chamber-leak", "valve-leak", "valve-hysteresis", "valve-lag"),
    *("line-delay", "pressure-lag", "supply-droop"),
)
SEEDS = (14, 21)
SLIGHT = 0.01
GAS, TEMPERATURE, KAPPA = 287.0, 293.15, 1.4


class TrueGradient:
    """The gradient that the rig truly makes in a volume, from what was sealed of the case."""

    def __init__(self, base: dict[str, float], rig: dict[str, Any]) -> None:
        self.base, self.valve = base, rig.get("valve", {})
        self.supply, self.ambient = (parse_quantity(rig[f"{n}_pressure"], "Pa") for n in ("supply", "ambient"))

    def __call__(self, u: Array, p: Array, chamber: int, volume: float) -> Array:
        """Return dp/dt in Pa/s at commands u (V) and pressures p (Pa), by thesis 2.22, 2.42, 2.46."""
        opening = u - self.base["null_V"]
        if chamber == 2 and self.valve["arrangement"] == "5/3":
            opening = -opening
        fills = opening > 0
        high, low = np.where(fills, self.supply, p), np.where(fills, p, self.ambient)
        b = self.base["critical_ratio"]
        ratio = np.clip((np.minimum(low / high, 1.0) - b) / (1.0 - b), 0.0, 1.0)
        flow = self._area(np.abs(opening), chamber) * high * np.sqrt(2 / (GAS * TEMPERATURE) * (1 - ratio**2)) * 0.484
        return np.asarray(KAPPA * GAS * TEMPERATURE / volume * np.where(fills, flow, -flow))

    def _area(self, opening: Array, chamber: int) -> Array:
        names = ("effective_area{}_at_10V", "overlap{}_V", "area_exponent{}")
        area, overlap, exponent = (self.base[name.format("_2" if chamber == 2 else "")] for name in names)
        full = self.base["fully_open_V"]
        if self.valve.get("kind") == "switching":
            return area * (opening > 0.5 * full)
        return np.asarray(area * (np.maximum(opening - overlap, 0.0) / (full - overlap)) ** exponent)


def map_rows(
    folder: Path, kind: str, condition: str, seed: int, *, hidden: Sequence[str] = (), is_small: bool = False
) -> Iterator[tuple[int, str, list[float]]]:
    """Yield chamber, what the map is, and the figures, of each chamber of a case."""
    truth: dict[str, Any] = generate_case(folder, kind, tuple(hidden), "", 1.0, seed, parse(condition))
    known = truth["base"] | {k: v for one in truth["hidden"].values() for k, v in one.items() if k in truth["base"]}
    path = folder / "pipeline.toml"
    if kind == "axis":
        path.write_text(_without_vessel(path.read_text()))
    if is_small:
        rigs.shorten(path)
    seen = ingest.run(Context(path, load(path), folder / "ingest", folder))
    answer = identify.run(Context(path, load(path), folder / "identify", folder, answers={"ingest": seen}))
    true = TrueGradient(known, tomllib.loads(path.read_text())["rig"])
    for chamber, name in ((1, "valve"), (2, "valve_2")):
        if name in answer:
            volume = answer[name]["volume"]["value"]
            tables = [_of(folder / "identify" / f"valve_{table}.parquet", chamber) for table in ("map", "inverse")]
            yield chamber, answer[name]["map"], [*_map(tables[0], true, volume), *_inverse(tables[1], true, volume)]


def _without_vessel(text: str) -> str:
    """Return a pipeline file without its valve tests."""
    head, *recordings = text.split("[[recordings]]")
    kept = [one for one in recordings if 'experiment = "valve"' not in one]
    return "[[recordings]]".join([re.sub(r"\[rig\.vessel\]\nvolume.*\n", "", head), *kept])


def _of(path: Path, chamber: int) -> dict[str, Array]:
    table = {name: np.asarray(values) for name, values in read_table(path).items()}
    mine = table["chamber"] == chamber if "chamber" in table else np.ones(table["p"].size, dtype=bool)
    return {name: values[mine] for name, values in table.items()} | {"of": np.full(mine.sum(), float(chamber))}


def _map(table: dict[str, Array], true: TrueGradient, volume: float) -> list[float]:
    truth = true(table["u"], table["p"], int(table["of"][0]), volume)
    largest = np.abs(truth).max()
    told = table["covered"] & (np.abs(truth) > SLIGHT * largest)
    off = np.abs(table["p_gradient"] - truth)[told] / np.abs(truth[told])
    held = (table["p_gradient_ci_low"] <= truth) & (truth <= table["p_gradient_ci_high"])
    return [float(np.mean(table["covered"])), *np.quantile(off, (0.5, 0.95)), float(np.mean(held[told]))]


def _inverse(table: dict[str, Array], true: TrueGradient, volume: float) -> list[float]:
    made = true(table["u"], table["p"], int(table["of"][0]), volume)
    asked = table["p_gradient"]
    told = table["reachable"] & (np.abs(asked) > SLIGHT * np.abs(asked).max())
    off = np.abs(made - asked)[told] / np.abs(asked[told])
    return [float(np.mean(table["reachable"])), *(np.quantile(off, (0.5, 0.95)) if off.size else (np.nan, np.nan))]


def print_maps(arguments: Sequence[str], *, is_small: bool) -> None:
    """Print a row for each arrangement and chamber: the mean of the figures over the seeds."""
    seeds = SEEDS[:1] if is_small else [int(seed) for seed in arguments] or SEEDS
    print("| arrangement | chamber | map | covered | median | 95 % | truth inside | reachable | median | 95 % |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for name, kind, condition in CASES[:1] if is_small else CASES:
        found: dict[tuple[int, str], list[list[float]]] = {}
        for seed in seeds:
            with tempfile.TemporaryDirectory() as folder:
                for chamber, what, figures in map_rows(Path(folder) / "case", kind, condition, seed, is_small=is_small):
                    found.setdefault((chamber, what), []).append(figures)
        for (chamber, what), figures in found.items():
            means = [f"{100 * x:.3g} %" for x in np.nanmean(figures, axis=0)]
            print(f"| {name} | {chamber} | {what} | {' | '.join(means)} |", flush=True)


def print_missing(arguments: Sequence[str], *, is_small: bool) -> None:
    """Print a row for each effect that the model lacks: the mean of the figures of the map over the seeds."""
    seeds = SEEDS[:1] if is_small else [int(seed) for seed in arguments] or SEEDS
    print("| effect | covered | median | 95 % | truth inside |")
    print("| --- | --- | --- | --- | --- |")
    for effect in MISSING[:1] if is_small else MISSING:
        found = []
        for seed in seeds:
            with tempfile.TemporaryDirectory() as folder:
                of_case = map_rows(Path(folder) / "case", "valve", "usual", seed, hidden=[effect], is_small=is_small)
                found += [figures[:4] for _, _, figures in of_case]
        print(f"| {effect} | {' | '.join(f'{100 * x:.3g} %' for x in np.mean(found, axis=0))} |", flush=True)


DRAWS, SMALL_DRAWS = 10_000, 60
RIG = Rig(ambient_pressure=1.013e5, gas_temperature=293.15)
TRUTH = FlowCharacteristics(1e-8, 0.3, 0.5)
ROWS, SUPPLY, RECORDED = 40, 7.013e5, ("flow", "p1", "p_supply", "u")
MEASUREMENT = Measurement(
    {
        "p_supply": Calibration(zero=700.0, gain=7e-4),  # 0.1 % of 10 bar
        "p1": Calibration(zero=700.0, gain=7e-4),
        "flow": Calibration(gain=0.008),  # 0.8 % of reading
    }
)
VOLUME, SIGMA_VOLUME, RATE_ERROR = 160e-6, 0.8e-6, 0.003  # of a charge test; the last of its gradient


def steady_bench(seed: int = 1) -> FlowBench:
    """Return a fitted bench with its budgets: rows of one opening with 0.3 % of reading and 0.05 % of full scale."""
    rng = np.random.default_rng(seed)
    down = np.linspace(1.1e5, 6.9e5, ROWS)
    flow = iso_mass_flow(TRUTH, np.full(ROWS, SUPPLY), down, 293.15)
    read = flow * (1.0 + 0.003 * rng.standard_normal(ROWS)) + 5e-4 * flow.max() * rng.standard_normal(ROWS)
    signals = {"u": np.full(ROWS, 2.0), "p_supply": np.full(ROWS, SUPPLY), "p1": down, "flow": read}
    bench = identify_flow_bench([Recording("rows", "flow", "train", np.arange(ROWS, dtype=float), signals)], RIG)
    assert bench is not None
    return with_flow_budgets(bench, lambda path: "(+2 V)", MEASUREMENT, RECORDED)


def drawn_characteristics(bench: FlowBench, draws: int, seed: int = 2) -> Array:
    """Return C, b, m of each draw, shape (draws, 3)."""
    (path,), rng = bench.paths, np.random.default_rng(seed)
    rows, freedom = path.rows, max(ROWS - 4, 1)
    scatter = max(float(np.sum((path.residual / path.deviation) ** 2)) / freedom, 1.0) ** 0.5
    fitted = path.flow(rows.upstream, rows.downstream, rows.temperature)
    found = np.empty((draws, 3))
    for i in range(draws):
        p_up, p_down = (
            p + one.zero * rng.standard_normal() + one.gain * rng.standard_normal() * p
            for p, one in (
                (rows.upstream, MEASUREMENT.calibrations["p_supply"]),
                (rows.downstream, MEASUREMENT.calibrations["p1"]),
            )
        )
        noise = scatter * path.deviation * rng.standard_normal(ROWS)
        flow = (fitted + noise) * (1.0 + MEASUREMENT.calibrations["flow"].gain * rng.standard_normal())
        temperature = rows.temperature + MEASUREMENT.temperature_sigma * rng.standard_normal()
        drawn = replace(rows, upstream=p_up, downstream=p_down, flow=flow, temperature=temperature)
        z = coordinates_of(refit(path, drawn, bench.law))
        found[i] = np.exp(z[0]), z[1], z[2]
    return found


def charge_budget(c: float, u: float) -> Budget:
    """Return the budget of C of a charge (u > 0) or discharge test whose curves know C to ``RATE_ERROR``."""
    rig = replace(RIG, supply_pressure=SUPPLY, vessel_volume=VOLUME)
    model = Model(rig, (), {"rig.vessel_volume": VOLUME}, ValveArea((-10.0, 10.0), (1e-6, 1e-6)))
    spread = np.exp(Z95 * RATE_ERROR)
    other = Figure(0.3, 0.2, 0.4)
    one = IsoConductance(u, Figure(c, c / spread, c * spread), other, other)
    valve: Any = SimpleNamespace(label="valve", model_gradient=SimpleNamespace(model=model, supply=SUPPLY))
    return budget_of_conductance(valve, one, replace(MEASUREMENT, volume_sigma=SIGMA_VOLUME), fitted_volume=False)


def drawn_errors(u: float, draws: int, seed: int = 3) -> Array:
    """Return what C of each draw is multiplied by, shape (draws,): C = V (dp/dt) / (n R T p_u rho_0) sqrt(T / T_0)."""
    rng = np.random.default_rng(seed)
    volume = 1.0 + SIGMA_VOLUME / VOLUME * rng.standard_normal(draws)
    rate = 1.0 + RATE_ERROR * rng.standard_normal(draws)
    temperature = 1.0 + MEASUREMENT.temperature_sigma / RIG.gas_temperature * rng.standard_normal(draws)
    upstream = 1.0 + 700.0 / SUPPLY * rng.standard_normal(draws)
    if u > 0.0:  # else p1 is upstream, too, and its gain cancels
        upstream += 7e-4 * rng.standard_normal(draws)
        rate *= 1.0 + 7e-4 * rng.standard_normal(draws)
    return volume * rate / upstream / np.sqrt(temperature)


def thermal_factors(c: float, u: float) -> list[float]:
    """Return what C is multiplied by for each state of the wall, over gas that a charge has warmed or not."""
    vessel = Vessel(VOLUME, SUPPLY, RIG.ambient_pressure, RIG.gas_temperature, 1.4, 287.0)
    found = [
        conductance_factor(vessel, c, heat_transfer, RIG.gas_temperature, fills=u > 0.0)
        for heat_transfer in (0.0, 2.0, 5.0, 10.0, 25.0, 50.0, 100.0)
    ]
    warm = [] if u > 0.0 else [conductance_factor(vessel, c, 0.0, vessel.charged_temperature, fills=False)]
    return [*found, *warm]


def charge_rows(draws: int) -> Iterator[tuple[str, float, tuple[float, float], tuple[float, float], float]]:
    """Yield name, C, interval, ends of the draws and least coverage, for either law of the thermal state."""
    for u, name in ((5.0, "charge"), (-5.0, "discharge")):
        errors = drawn_errors(u, draws)
        for c in (3.6e-9, 4e-10, 4e-11):
            budget = charge_budget(c, u)
            low, high = next(one.factors for one in budget.sources if one.factors)
            states = [c * factor * errors for factor in thermal_factors(c, u)]
            at_bounds = float(np.quantile(c * low * errors, 0.025)), float(np.quantile(c * high * errors, 0.975))
            evenly = c * np.random.default_rng(4).uniform(low, high, draws) * errors
            ends = float(np.quantile(evenly, 0.025)), float(np.quantile(evenly, 0.975))
            assert budget.propagated is not None
            known = budget.figure.low, budget.figure.high
            yield f"{name}, C = {c:g}", c, known, at_bounds, coverage(known, states)
            yield f"{name}, C = {c:g}, evenly", c, budget.propagated, ends, coverage(budget.propagated, states)


def coverage(interval: tuple[float, float], states: list[Array]) -> float:
    """Return the least share of draws within an interval, over the states."""
    return min(float(np.mean((interval[0] <= one) & (one <= interval[1]))) for one in states)


def end_errors(interval: tuple[float, float], ends: tuple[float, float], value: float) -> tuple[float, float]:
    """Return how far the ends are from those of the draws: of the value, and of the half width of the draws."""
    worst = float(np.max(np.abs(np.array(interval) - np.array(ends))))
    return worst / value, worst / (0.5 * (ends[1] - ends[0]))


def steady_rows(draws: int) -> Iterator[tuple[str, float, tuple[float, float], tuple[float, float], float]]:
    """Yield name, value, interval, ends of the draws and coverage of C, b, m of a steady bench."""
    bench = steady_bench()
    drawn = drawn_characteristics(bench, draws)
    for i, (name, one) in enumerate([*bench.budgets.items()][:3]):
        low, high = np.quantile(drawn[:, i], [0.025, 0.975])
        value, known = one.figure.value, (one.figure.low, one.figure.high)
        yield name, value, known, (float(low), float(high)), coverage(known, [drawn[:, i]])


def recorded_test(c: float, heat_transfer: float, seed: int = 1) -> Recording:
    """Return rest, charge and, 0.1 s later, discharge of the vessel, with gas that exchanges heat with the wall."""
    period, settled = 1e-3, VOLUME / (c * REFERENCE_DENSITY * 287.0 * RIG.gas_temperature)
    n = int(2.6 * settled / period)
    starts, commands = (0, 100, 100 + n, 200 + n, 200 + 2 * n), (0.0, 2.0, 0.0, -2.0)
    time, p, u = period * np.arange(starts[-1]), np.empty(starts[-1]), np.empty(starts[-1])
    state = [RIG.ambient_pressure, RIG.gas_temperature]
    for k, command in enumerate(commands):
        here = slice(starts[k], starts[k + 1])
        span = period * np.arange(starts[k + 1] - starts[k] + 1)
        found = solve_ivp(_rates(c, command, heat_transfer), (0.0, span[-1]), state, t_eval=span, rtol=1e-8, atol=1e-3)
        p[here], u[here], state = found.y[0][:-1], command, found.y[:, -1].tolist()
    rng, noise = np.random.default_rng(seed), NoiseModel(white=0.0, coloured=400.0, pole=0.6)
    supply = SUPPLY + noise.draw(time, rng)
    return Recording("charge", "valve", "train", time, {"u": u, "p_supply": supply, "p1": p + noise.draw(time, rng)})


def _rates(c: float, u: float, heat_transfer: float) -> Any:
    """Return d(p, T)/dt of the vessel, written apart from the package."""

    def subsonic(ratio: float) -> float:
        return float(np.sqrt(1.0 - np.clip((ratio - 0.528) / 0.472, 0.0, 1.0) ** 2))

    def rates(_: float, state: Array) -> list[float]:
        p, T = state
        flow = {
            0.0: 0.0,
            2.0: c * SUPPLY * REFERENCE_DENSITY * subsonic(p / SUPPLY),
            -2.0: -c * p * REFERENCE_DENSITY * np.sqrt(293.15 / T) * subsonic(RIG.ambient_pressure / p),
        }[u]
        carried = RIG.gas_temperature if flow > 0.0 else T
        power = 1004.5 * carried * flow + heat_transfer * 6.0 * VOLUME ** (2 / 3) * (RIG.gas_temperature - T)
        return [0.4 * power / VOLUME, (power - 717.5 * T * flow) * 287.0 * T / (p * VOLUME * 717.5)]

    return rates


def print_recorded(conductances: tuple[float, ...], walls: tuple[float, ...]) -> None:
    """Print C of identified tests over the true one, with the interval of the budget."""
    print("| true C | wall, W/(m2 K) | path | true / identified | interval / identified | inside |")
    print("| --- | --- | --- | --- | --- | --- |")
    rig = replace(RIG, supply_pressure=SUPPLY, vessel_volume=VOLUME)
    for c in conductances:
        for wall in walls:
            tests = [prepare(recorded_test(c, wall), rig, 0.5)]
            fit = fit_model(guess_base_model(tests, rig, "map"), residual_models(tests), [])
            valve = with_budgets(identify_valve(tests, fit), fit.estimates, Measurement())
            for one in valve.iso:
                found, low, high = one.C.value, one.C.low, one.C.high
                path = "charge" if one.u > 0.0 else "discharge"
                print(
                    f"| {c:g} | {wall:g} | {path} | {c / found:.3f} | {low / found:.3f} to {high / found:.3f} | "
                    f"{'yes' if low <= c <= high else 'no'} |",
                    flush=True,
                )


def print_budgets(arguments: Sequence[str], *, is_small: bool) -> bool:
    """Print a row for each result; return whether all ends are within 5 % of the half width of those of the draws.

    With ``recorded``: identify recorded tests instead.
    """
    if "recorded" in arguments:
        print_recorded((3.6e-9,), (0.0,)) if is_small else print_recorded((3.6e-9, 4e-10), (0.0, 10.0, 25.0, 100.0))
        return True
    draws = SMALL_DRAWS if is_small else int((*arguments, DRAWS)[0])
    columns = (
        "result | value | budget | Monte Carlo | ends differ by, of the value | of the half width | least coverage"
    )
    print(f"{draws} draws\n| {columns} |\n|{' --- |' * (columns.count('|') + 1)}")
    worst = 0.0
    for rows in (steady_rows(draws), charge_rows(draws)):
        for name, value, interval, ends, covered in rows:
            of_value, of_width = end_errors(interval, ends, value)
            worst = max(worst, of_width)
            budget, drawn = (f"{low:.4g} to {high:.4g}" for low, high in (interval, ends))
            figures = f"{100 * of_value:.2f} % | {100 * of_width:.1f} % | {100 * covered:.1f} %"
            print(f"| {name} | {value:.4g} | {budget} | {drawn} | {figures} |", flush=True)
    return is_small or worst <= 0.05  # few draws have no ends to hold against


MIN_HELD_SHARE = 0.3  # of a recording that holds one command
MIN_OPENING = 0.02  # of the largest command
MIN_SHARE_OF_OPEN = 0.9  # of the samples with an open valve
COMMAND_STEP = 0.05  # V between commands that count as different
AIM = 1.3  # times the error of the fitted recordings, or noise where that is larger
MIN_COMMANDS = 3  # so that one can be left out between two others


class LeftOut(NamedTuple):
    """One command left out.

    ``command`` is its size in V, ``between`` whether fitted commands lie on both sides, the last two are errors.
    """

    case: str
    command: float
    between: bool
    fitted: float
    left_out: float


def held_command(residual_model: ResidualModel, null: float) -> float | None:
    """Return the size in V of the command that a recording holds while the valve is open; None for several sizes.

    A test that fills and vents holds one size in both directions.
    """
    opening = np.abs(residual_model.experiment.inputs[:, at.IN_U] - null)
    is_open = opening > MIN_OPENING * opening.max()
    levels, counts = np.unique(np.round(opening[is_open] / COMMAND_STEP), return_counts=True)
    if (
        not levels.size
        or counts.max() < MIN_HELD_SHARE * opening.size
        or counts.max() < MIN_SHARE_OF_OPEN * counts.sum()
    ):
        return None
    return float(COMMAND_STEP * levels[np.argmax(counts)])


def fit_errors(
    study: PipelineData, train: Sequence[ResidualModel], left_out: Sequence[ResidualModel], effects: Sequence[str]
) -> tuple[float, float]:
    """Return the errors on fitted recordings and on those left out, of the model with the named effects."""
    guess = guess_base_model([v.experiment for v in train], study.rig, study.valve)
    found = fit_model(guess, train, (*study.effects, *(study.available_effects[name] for name in effects)))
    fitted, outside = lack_of_fit_by_channel(found.model, train), held_out_lack_of_fit(found, left_out)
    return max(r.ratio for r in fitted), max(r.ratio for r in outside)


def left_out_rows(case: Path, truth: Truth) -> Iterator[LeftOut]:
    """Yield the commands of one case, each left out; none where the case has no test of a valve."""
    with tempfile.TemporaryDirectory() as out:
        study = rigs.study_of(case, Path(out), MAX_SAMPLES)
        models = [v for use in ("train", "test") for v in study.residual_models(use) if "p1" in v.channels]
        by_command: dict[float, list[ResidualModel]] = defaultdict(list)
        for one in models:
            if (command := held_command(one, study.rig.valve_null)) is not None:
                by_command[command].append(one)
        effects = [
            n for n in dict.fromkeys([*sorted(truth.hidden), *sorted(truth.mild)]) if n in study.available_effects
        ]
        for command, left_out in sorted(by_command.items()):
            if len(by_command) >= MIN_COMMANDS:
                train = [v for v in models if all(v is not one for one in left_out)]
                between = min(by_command) < command < max(by_command)
                yield LeftOut(
                    f"{case.parent.name} {case.name}", command, between, *fit_errors(study, train, left_out, effects)
                )


def print_table_of_commands(folders: Sequence[Path]) -> None:
    """Print the errors of each command left out, and how many commands between others keep within 1.3."""
    seen: list[LeftOut] = []
    print("| case | command (V) | fitted | left out | |")
    print("| --- | --- | --- | --- | --- |")
    for folder in folders:
        for case, truth in truths(folder):
            for row in left_out_rows(case, truth_of(truth)):
                seen.append(row)
                place = "between" if row.between else "outermost"
                print(
                    f"| {row.case} | {row.command:.2f} | {row.fitted:.2f} | {row.left_out:.2f} | {place} |", flush=True
                )
    for between in (True, False):
        mine = [r for r in seen if r.between == between]
        if mine:
            ratio = np.array([r.left_out / max(r.fitted, 1.0) for r in mine])
            print(
                f"{'between others' if between else 'outermost'}: {np.sum(ratio <= AIM)} of {ratio.size} at most "
                f"{AIM:g} times what is fitted, median {np.median(ratio):.2f}, largest {ratio.max():.2f}"
            )


def print_commands(arguments: Sequence[str], *, is_small: bool) -> None:
    """Leave the commands of every case out, one after another."""
    rigs.on_folders([*arguments, *([rigs.SMALL] if is_small else [])], print_table_of_commands)


TABLES: dict[str, Callable[..., object]] = {
    "maps": print_maps,
    "missing": print_missing,
    "budgets": print_budgets,
    "commands": print_commands,
}


def main(arguments: list[str]) -> int:
    """Print one of the tables, or of each a small one; return 1 where a limit of the project is exceeded."""
    return rigs.print_tables(TABLES, arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
