"""Uncertainty budgets by the GUM: contributions that a reader can check by hand, and a Monte Carlo of the inputs."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks import valve
from pneucli.figure import Figure
from pneucli.identify.guesses.base_model import PLACEHOLDER_VOLUME
from pneucli.identify.valve import charge_budget
from pneucli.identify.valve.charge_budget import Vessel, conductance_factor, with_flow_budgets
from pneucli.identify.valve.flow_bench import FlowBench, identify_flow_bench
from pneucli.identify.valve.iso6358 import IsoConductance
from pneucli.identify.valve.uncertainty import (
    Measurement,
    budget_from,
    contribution,
    positive_interval,
    propagated_interval,
)
from pneucli.messages.identify import Budget
from pneucli.recording import Calibration, Rig
from tests.identify_valve.steady_bench import AMBIENT, as_recording, bench_rows
from tests.simulate.synthetic_experiments import VALVE, model

C = 4e-9
B = Figure(0.3, 0.2, 0.4)


def charge_valve(u: float = 5.0, values: dict[str, float] | None = None, names: tuple[str, ...] = ()) -> Any:
    """A valve at one command with C known to 0.3 %, on a vessel of 160 cm^3."""
    what = model(names, {"rig.vessel_volume": 160e-6} | (values or {}))
    spread = 1.959964 * 0.003
    c = Figure(C, C * np.exp(-spread), C * np.exp(spread))
    law = SimpleNamespace(valve=VALVE, model=what, supply=7e5)
    return SimpleNamespace(iso=(IsoConductance(u, c, B, B),), label="valve", model_gradient=law)


NOTHING_STATED = Measurement()


def budget_of(valve: Any, measurement: Measurement = NOTHING_STATED, *, fitted_volume: bool = False) -> Budget:
    return charge_budget.budget_of_conductance(valve, valve.iso[0], measurement, fitted_volume=fitted_volume)


def interval(budget: Budget) -> tuple[float, float]:
    return budget.figure.low, budget.figure.high


def relative(budget: Budget) -> dict[str, float]:
    return {one.source: one.contribution / budget.figure.value for one in budget.sources}


def test_a_charge_test_without_any_statement_has_scatter_volume_temperature_and_thermal_state() -> None:
    """0.3 % of the curves, 0.5 % of the volume, half of 1 K in 293.15 K."""
    budget = budget_of(charge_valve())
    found = relative(budget)
    thermal = found.pop("thermal state")
    assert found == {
        "scatter of the curves": pytest.approx(0.003),
        "volume of the vessel": pytest.approx(0.005),
        "gas temperature": pytest.approx(0.5 / 293.15),
    }
    assert budget.combined / C == pytest.approx(np.sqrt(0.003**2 + 0.005**2 + (0.5 / 293.15) ** 2))
    assert budget.expanded == 2.0 * budget.combined
    (factors,) = [one.factors for one in budget.sources if one.bound]
    assert factors is not None
    assert thermal * np.sqrt(12.0) == pytest.approx(factors[1] - factors[0])
    assert interval(budget) == pytest.approx(positive_interval(C, budget.combined / C, factors))
    assert budget.calibration_not_stated == ("p1", "p_supply")


def factors_of(c: float, u: float = 5.0, **values: Any) -> tuple[float, float]:
    what = model((), values or {"rig.vessel_volume": 160e-6})
    return charge_budget._thermal_factors(what, c, 7e5, fills=u > 0.0)


def test_a_fast_valve_charges_adiabatically_and_a_slow_one_may_do_so_isothermally() -> None:
    found = [factors_of(c) for c in (1e-6, C, 1e-11)]
    assert [least for least, _ in found] == pytest.approx([1.0, 1.0, 1.0], abs=1e-4)
    assert found[0][1] < 1.001 < found[1][1] < found[2][1]
    assert found[2][1] == pytest.approx(1.4, abs=3e-3)


def test_a_vessel_without_a_volume_may_charge_isothermally_through_any_valve() -> None:
    assert factors_of(1e-6, **{"rig.vessel_volume": PLACEHOLDER_VOLUME})[1] == 1.4


VESSEL = Vessel(160e-6, 7e5, 1e5, 293.15, 1.4, 287.0)


def test_warm_gas_leaves_faster_by_the_root_of_its_temperature() -> None:
    """q goes with p / sqrt(T), dp/dt with q T: at a temperature that stays C seems larger by sqrt(T / T_0)."""
    nearly_isothermal = 1e6  # W/(m^2 K)
    warm = replace(VESSEL, temperature=1.21 * 293.15)
    slow = conductance_factor(warm, C, nearly_isothermal, warm.temperature, fills=False)
    assert slow == pytest.approx(1.4, abs=2e-3)  # the wall's temperature is the model's: only the exponent differs
    cold = conductance_factor(VESSEL, C, 0.0, 0.81 * 293.15, fills=False)
    assert cold / conductance_factor(VESSEL, C, 0.0, 293.15, fills=False) == pytest.approx(1 / 0.9, rel=2e-3)


def test_a_charge_without_heat_ends_at_the_temperature_of_the_energy_balance() -> None:
    """From vacuum the gas warms by kappa; a vessel that is full already stays as it is."""
    assert replace(VESSEL, ambient=0.0).charged_temperature == pytest.approx(1.4 * 293.15)
    assert replace(VESSEL, ambient=7e5).charged_temperature == pytest.approx(293.15)


def test_a_discharge_at_once_after_a_charge_may_have_a_smaller_c() -> None:
    least, largest = factors_of(C, -5.0)
    assert least == pytest.approx(0.93, abs=0.01)
    assert largest > factors_of(C)[1]


def test_the_even_law_of_exact_inputs_is_95_percent_of_the_rectangle() -> None:
    assert propagated_interval(2.0, 1e-6, (1.0, 1.4)) == pytest.approx((2.02, 2.78), abs=0.002)


def test_the_even_law_of_coarse_inputs_is_that_of_draws() -> None:
    rng = np.random.default_rng(1)
    drawn = rng.uniform(1.0, 1.4, 200_000) * (1.0 + 0.2 * rng.standard_normal(200_000))
    assert propagated_interval(1.0, 0.2, (1.0, 1.4)) == pytest.approx(np.quantile(drawn, [0.025, 0.975]), abs=0.005)


def test_an_area_that_the_curves_hardly_show_has_a_finite_budget() -> None:
    valve = charge_valve()
    valve.iso = (replace(valve.iso[0], C=Figure(C, 1e-205 * C, 1e200 * C)),)
    budget = budget_of(valve)
    assert np.isfinite([budget.combined, *interval(budget), *(one.share for one in budget.sources)]).all()
    assert budget.figure.high >= 0.99e200 * C


@pytest.mark.parametrize(("ends", "known"), [((0.9, 1.1), True), ((1.0, 1.0), False), ((0.9, np.inf), False)])
def test_an_area_at_its_bound_has_no_budget(ends: tuple[float, float], known: bool) -> None:
    assert charge_budget._has_interval(Figure(C, ends[0] * C, ends[1] * C)) == known


def test_a_model_with_heat_transfer_leaves_no_thermal_state_open() -> None:
    budget = budget_of(charge_valve(names=("heat-transfer",), values={"heat-transfer.conductance": 0.5}))
    assert "thermal state" not in relative(budget)
    assert budget.figure.high == pytest.approx(C * np.exp(budget.expanded / C))


def test_a_volume_that_was_identified_counts_once() -> None:
    assert "volume of the vessel" not in relative(budget_of(charge_valve(), fitted_volume=True))


def test_a_stated_sigma_of_the_volume_replaces_the_default() -> None:
    found = relative(budget_of(charge_valve(), Measurement(volume_sigma=3.2e-6)))
    assert found["volume of the vessel"] == pytest.approx(0.02)


@pytest.mark.parametrize(
    ("u", "expected"),
    [
        (5.0, {"p1, gain": 0.002, "p_supply, zero": 0.001, "p_supply, gain": 0.002}),
        (-5.0, {"p1, zero": 0.001}),  # p1 is upstream and what changes: its gain cancels
    ],
)
def test_calibrations_act_where_the_equation_has_them(u: float, expected: dict[str, float]) -> None:
    instruments = Measurement(dict.fromkeys(("p1", "p_supply"), Calibration(zero=700.0, gain=0.002)))
    found = relative(budget_of(charge_valve(u), instruments))
    shown = {k.removeprefix("calibration of "): v for k, v in found.items() if k.startswith("calibration")}
    assert shown == {name: pytest.approx(value) for name, value in expected.items()}


def test_shares_of_all_sources_are_the_whole() -> None:
    parts = tuple(contribution(name, "B", 1.0, "1", s) for name, s in (("a", 3.0), ("b", -4.0)))
    found = budget_from(Figure(1.0, 0.0, 2.0, "1"), parts)
    assert (found.combined, found.expanded) == (5.0, 10.0)
    assert [one.share for one in found.sources] == [pytest.approx(0.36), pytest.approx(0.64)]


# --- steady bench


RECORDED = ("flow", "p1", "p_supply", "u")


def steady(measurement: Measurement, **rows: Any) -> FlowBench:
    bench = identify_flow_bench([as_recording(bench_rows(3, {2.0: 1e-8}, **rows))], Rig(ambient_pressure=AMBIENT))
    assert bench is not None
    return with_flow_budgets(bench, lambda path: "(+2 V)", measurement, RECORDED)


def test_a_gain_of_the_flow_meter_is_that_of_c_and_moves_neither_b_nor_m() -> None:
    c, b, m = steady(Measurement({"flow": Calibration(gain=0.01)})).budgets.values()
    gain = "calibration of flow, gain"
    assert relative(c)[gain] == pytest.approx(0.01, rel=0.02)
    assert relative(b).get(gain, 0.0) < 1e-3
    assert relative(m).get(gain, 0.0) < 1e-3


def test_a_gain_of_both_gauges_leaves_the_pressure_ratio_and_divides_c() -> None:
    """C = q / p f(r): the sensitivities of both gauges together are -C, those of b and m together nothing."""
    gains = Measurement(dict.fromkeys(("p_supply", "p1"), Calibration(gain=0.005)))
    together = [
        sum(one.sensitivity for one in budget.sources if one.source.endswith("gain"))
        for budget in steady(gains).budgets.values()
    ]
    assert together[0] / 1e-8 == pytest.approx(-1.0, rel=0.03)
    assert together[1:] == pytest.approx([0.0, 0.0], abs=0.02)


def test_an_unrecorded_temperature_of_1_kelvin_is_half_of_its_share_in_c() -> None:
    c, b, _ = steady(Measurement()).budgets.values()
    assert relative(c)["gas temperature"] == pytest.approx(0.5 / 293.15, rel=0.02)
    assert relative(b).get("gas temperature", 0.0) < 1e-3
    assert c.calibration_not_stated == ("p_supply", "p1", "flow")


def test_the_interval_of_a_path_is_that_of_its_budget() -> None:
    bench = steady(Measurement({"flow": Calibration(gain=0.02)}))
    (path,) = bench.paths
    for figure, budget in zip((path.C, path.b, path.m), bench.budgets.values(), strict=True):
        assert (figure.low, figure.high) == interval(budget)
    c = next(iter(bench.budgets.values()))
    assert path.C.high - path.C.value == pytest.approx(c.expanded, rel=0.03)
    assert path.C.high > 1.04 * path.C.value


def test_a_monte_carlo_of_charge_and_discharge_tests_has_the_ends_of_the_budget() -> None:
    """Within 5 % of the half width; 95 % are inside whatever the wall does, which no even law achieves."""
    for name, value, interval, ends, covered in valve.charge_rows(4000):
        assert valve.end_errors(interval, ends, value)[1] <= 0.05, name
        assert (covered >= 0.95) != name.endswith("evenly"), name


def test_a_monte_carlo_of_a_steady_bench_has_the_ends_of_the_budget() -> None:
    """Of the half width; 200 draws know an end to about 10 % of it."""
    for name, value, interval, ends, _ in valve.steady_rows(200):
        assert valve.end_errors(interval, ends, value)[1] <= 0.3, name


def test_a_worked_example_of_a_data_sheet_lies_within_the_interval_of_its_own_rows() -> None:
    """SMC, solenoid valves VX2, flow characteristics: C = 2 dm3/(s bar), b = 0.3 pass 420 l/min ANR at 0.4 to 0.3 MPa.

    The sheet asks for rows at 100, 80, 60, 40 and 20 % of the choked flow, 600 l/min ANR; its graph is read to 0.01.
    """
    flow = np.array([1.0, 0.8, 0.6, 0.4, 0.2])
    ratio = 0.3 + 0.7 * np.sqrt(1.0 - flow**2)
    rows = {"u": np.ones(6), "p_supply": np.full(6, 5e5), "p1": 5e5 * np.append(ratio, 0.2)}
    rows["flow"] = np.append(flow, 1.0) * 600.0 / 6e4 * 1.185
    measurement = Measurement(dict.fromkeys(("flow", "p1", "p_supply"), Calibration(gain=0.005)))
    bench = identify_flow_bench([as_recording(rows)], Rig(ambient_pressure=1e5))
    assert bench is not None
    (path,) = with_flow_budgets(bench, lambda path: "", measurement, RECORDED).paths
    assert path.C.low <= 2e-8 <= path.C.high
    assert path.b.low <= 0.3 <= path.b.high
    passed = path.flow(np.array([5e5]), np.array([4e5]), 293.15)[0] / 1.185 * 6e4
    assert passed == pytest.approx(420.0, rel=0.015)
