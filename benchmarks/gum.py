"""The uncertainty budgets of C, b and m against a Monte Carlo of their inputs: ``python -m benchmarks.gum [DRAWS]``.

JCGM 101: every input is drawn from its distribution, the result is computed anew, and the ends of its 95 % interval are
those of 2.5 and 97.5 % of the draws. Printed is how far the budget's ends are from them, of the value and of the
budget's own half width. A steady bench of 16 rows is fitted again in each draw; of a charge test, the equation of C is.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np

from benchmarks import small
from pneucli.identify.valve.flow_bench import FlowBench, identify_flow_bench
from pneucli.identify.valve.flow_path import coordinates_of
from pneucli.identify.valve.steady_budget import with_flow_budgets
from pneucli.identify.valve.steady_flow import refit
from pneucli.identify.valve.uncertainty import (
    Measurement,
    positive_interval,
    smallest_polytropic_index,
)
from pneucli.physics.iso_flow import REFERENCE_DENSITY, FlowCharacteristics, iso_mass_flow
from pneucli.recording import Calibration, Recording, Rig

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


def charge_interval(c: float) -> tuple[float, float]:
    """Return the interval of the budget for C of a charge test, in closed form."""
    relative = np.sqrt(
        RATE_ERROR**2
        + (SIGMA_VOLUME / VOLUME) ** 2
        + (0.5 * MEASUREMENT.temperature_sigma / RIG.gas_temperature) ** 2
        + MEASUREMENT.calibrations["p1"].gain ** 2
        + MEASUREMENT.calibrations["p_supply"].gain ** 2
        + (MEASUREMENT.calibrations["p_supply"].zero / SUPPLY) ** 2
    )
    return positive_interval(c, float(relative), 1.4 / smallest_index(c) - 1.0)


def smallest_index(c: float) -> float:
    """Return the smallest polytropic index of the vessel at C."""
    return smallest_polytropic_index(1.4, 287.0, c * REFERENCE_DENSITY * SUPPLY, VOLUME)


def drawn_charge_conductance(c: float, draws: int, seed: int = 3) -> Array:
    """Return C of each draw of a charge test: C = V (dp/dt) / (n sqrt(T) p_supply), shape (draws,)."""
    rng = np.random.default_rng(seed)
    n = rng.uniform(smallest_index(c), 1.4, draws)
    volume = 1.0 + SIGMA_VOLUME / VOLUME * rng.standard_normal(draws)
    rate = (1.0 + RATE_ERROR * rng.standard_normal(draws)) * (1.0 + 7e-4 * rng.standard_normal(draws))
    supply = 1.0 + 7e-4 * rng.standard_normal(draws) + 700.0 / SUPPLY * rng.standard_normal(draws)
    temperature = 1.0 + MEASUREMENT.temperature_sigma / RIG.gas_temperature * rng.standard_normal(draws)
    return c * 1.4 / n * volume * rate / supply / np.sqrt(temperature)


def end_errors(interval: tuple[float, float], drawn: Array) -> tuple[float, float]:
    """Return how far the ends are from those of the draws: of the value, and of the half width of the draws."""
    ends = np.quantile(drawn, [0.025, 0.975])
    worst = float(np.max(np.abs(np.array(interval) - ends)))
    return worst / float(np.median(drawn)), worst / (0.5 * float(np.ptp(ends)))


def main(arguments: list[str]) -> int:
    """Print a row for each result; return 1 where an end is further than 5 % of the value from that of the draws."""
    counts = [int(a) for a in arguments if a.isdigit()]
    draws = SMALL_DRAWS if small.SMALL in arguments else (counts or [DRAWS])[0]
    print(
        f"{draws} draws\n| result | value | budget | Monte Carlo | ends differ by, of the value | of the half width |"
    )
    print("| --- | --- | --- | --- | --- | --- |")
    bench = steady_bench()
    drawn = drawn_characteristics(bench, draws)
    results = [(one.name, one.value, one.interval, drawn[:, i]) for i, one in enumerate(bench.budgets[:3])]
    for c in (3.6e-9, 4e-10, 4e-11):
        results.append(
            (f"charge test, C = {c:g}", c, charge_interval(c), drawn_charge_conductance(c, max(draws, 1000)))
        )
    worst = 0.0
    for name, value, interval, sample in results:
        of_value, of_width = end_errors(interval, sample)
        worst = max(worst, of_value)
        ends = np.quantile(sample, [0.025, 0.975])
        budget, monte_carlo = (f"{low:.4g} to {high:.4g}" for low, high in (interval, ends))
        print(f"| {name} | {value:.4g} | {budget} | {monte_carlo} | {100 * of_value:.2f} % | {100 * of_width:.1f} % |")
    return int(worst > 0.05)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
