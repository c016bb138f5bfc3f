"""The uncertainty budgets of C, b and m against a Monte Carlo of their inputs: ``python -m benchmarks.gum [DRAWS]``.

JCGM 101: every input is drawn from its distribution, the result is computed anew, and the ends of its 95 % interval are
those of 2.5 and 97.5 % of the draws. A steady bench of 40 rows is fitted again in each draw. Of a charge or discharge
test, the equation of C is computed; its thermal state has bounds and no distribution, so the draws are made at either
bound (lower end from the one, upper end from the other), and, as JCGM 101 has it, evenly between the bounds. Printed is
how far the ends of the budget are from those of the draws, and the least share of draws inside over all states of the
wall (0 to 100 W/(m^2 K)).

``python -m benchmarks.gum recorded`` identifies charge and discharge tests of a vessel whose gas exchanges heat with
its wall, and compares C with the true one.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks import small
from pneucli.identify.estimation.model_fit import fit_model
from pneucli.identify.guesses.base_model import guess_base_model
from pneucli.identify.residuals import residual_models
from pneucli.identify.valve import identify_valve
from pneucli.identify.valve.charge_budget import budget_of_conductance, with_budgets
from pneucli.identify.valve.flow_bench import FlowBench, identify_flow_bench
from pneucli.identify.valve.flow_path import coordinates_of
from pneucli.identify.valve.iso6358 import Characteristic, IsoConductance
from pneucli.identify.valve.steady_budget import with_flow_budgets
from pneucli.identify.valve.steady_flow import refit
from pneucli.identify.valve.thermal_state import Vessel, conductance_factor
from pneucli.identify.valve.uncertainty import Budget, Measurement
from pneucli.noise import NoiseModel
from pneucli.physics.iso_flow import REFERENCE_DENSITY, FlowCharacteristics, iso_mass_flow
from pneucli.quantities import Z95
from pneucli.recording import Calibration, Recording, Rig
from pneucli.simulate.model import Model
from pneucli.simulate.preparation import prepare
from pneucli.simulate.valve_forms.area import ValveArea

Array = np.ndarray
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
    other = Characteristic(0.3, 0.2, 0.4)
    one = IsoConductance(u, Characteristic(c, c / spread, c * spread), other, other)
    valve: Any = SimpleNamespace(
        label="valve", area_model=SimpleNamespace(model_gradient=SimpleNamespace(model=model), supply=SUPPLY)
    )
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
            low, high = next(one.factors for one in budget.contributions if one.factors)
            states = [c * factor * errors for factor in thermal_factors(c, u)]
            at_bounds = float(np.quantile(c * low * errors, 0.025)), float(np.quantile(c * high * errors, 0.975))
            evenly = c * np.random.default_rng(4).uniform(low, high, draws) * errors
            ends = float(np.quantile(evenly, 0.025)), float(np.quantile(evenly, 0.975))
            assert budget.propagated is not None
            yield f"{name}, C = {c:g}", c, budget.interval, at_bounds, coverage(budget.interval, states)
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
    for i, one in enumerate(bench.budgets[:3]):
        low, high = np.quantile(drawn[:, i], [0.025, 0.975])
        yield one.name, one.value, one.interval, (float(low), float(high)), coverage(one.interval, [drawn[:, i]])


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


def main(arguments: list[str]) -> int:
    """Print a row for each result; return 1 where an end is further than 5 % of the half width from that of the draws.

    With ``recorded``: identify recorded tests instead.
    """
    is_small = small.SMALL in arguments
    if "recorded" in arguments:
        print_recorded((3.6e-9,), (0.0,)) if is_small else print_recorded((3.6e-9, 4e-10), (0.0, 10.0, 25.0, 100.0))
        return 0
    counts = [int(a) for a in arguments if a.isdigit()]
    draws = SMALL_DRAWS if is_small else (counts or [DRAWS])[0]
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
    return int(worst > 0.05 and not is_small)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
