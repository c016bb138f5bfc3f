"""C, b, m and the cracking pressure of a steady bench, against rows that another simulation made."""

import numpy as np
import pytest

from pneucli.identify.valve.flow_bench import compare_flow, identify_flow_bench
from pneucli.identify.valve.flow_findings import bench_findings, sets_area
from pneucli.recording import Rig
from tests.identify_valve.steady_bench import AMBIENT, DENSITY, SUPPLY, as_recording, bench_rows, mass_flow

RIG = Rig(ambient_pressure=AMBIENT)
SEEDS = 20
SEVERAL = {1.0: 5e-9, 2.0: 1e-8, 4.0: 2e-8}


def bench_of(rows):
    found = identify_flow_bench([as_recording(rows)], RIG)
    assert found is not None
    return found


def codes(rows):
    return {code for code, _ in bench_findings(bench_of(rows))}


def test_intervals_hold_the_truth():
    inside = {"C": 0, "b": 0, "m": 0}
    for seed in range(SEEDS):
        b, m = ((0.15, 0.5), (0.3, 0.48), (0.5, 0.55))[seed % 3]
        for path, c in zip(bench_of(bench_rows(seed, SEVERAL, b, m)).paths, SEVERAL.values(), strict=True):
            for name, truth in (("C", c), ("b", b), ("m", m)):
                one = getattr(path, name)
                inside[name] += one.low <= truth <= one.high
            assert path.b.determined
            assert path.cracking is None
    of = SEEDS * len(SEVERAL)
    assert all(of * 0.85 <= count <= of for count in inside.values()), inside


def test_the_intervals_are_no_wider_than_the_noise_makes_them():
    path = bench_of(bench_rows(3, SEVERAL)).paths[1]
    assert (path.C.high - path.C.low) / path.C.value < 0.02
    assert path.b.high - path.b.low < 0.08
    assert path.m.high - path.m.low < 0.06


def test_one_opening_without_a_command_has_no_name():
    rows = bench_rows(1, {3.0: 1e-8})
    del rows["u"]
    (path,) = bench_of(rows).paths
    assert path.rows.u is None
    assert path.C.low <= 1e-8 <= path.C.high
    assert sets_area(bench_of(rows)) is None


def test_a_check_valve_shows_its_cracking_pressure():
    inside = shown = 0
    for seed in range(SEEDS):
        (path,) = bench_of(bench_rows(seed, {2.0: 1e-8}, opens=5e4, rows=20)).paths
        if path.cracking is not None:
            shown += 1
            inside += path.cracking.low <= 5e4 <= path.cracking.high
    assert shown == SEEDS
    assert inside >= 0.85 * SEEDS


def test_a_valve_that_opens_abruptly_cracks_between_two_rows():
    rows = bench_rows(1, {2.0: 1e-8}, rows=24, upstream_varied=True)
    rows["flow"] = np.where(rows["p_supply"] - rows["p1"] < 1e5, 0.0, rows["flow"])
    (path,) = bench_of(rows).paths
    assert path.cracking is not None
    assert path.cracking.low <= 1e5 <= path.cracking.high


def test_venting_counts_from_p1_to_ambient():
    rows = bench_rows(2, SEVERAL)
    pressures = np.linspace(1.1e5, SUPPLY, 16)
    vent = {
        "u": np.full(16, -3.0),
        "p_supply": np.full(16, SUPPLY),
        "p1": pressures,
        "flow": np.array([-mass_flow(2e-8, 0.3, 0.5, p, AMBIENT) for p in pressures]),
    }
    bench = bench_of({name: np.concatenate([rows[name], vent[name]]) for name in rows})
    first = bench.paths[0]
    assert first.rows.direction == "to ambient"
    assert first.C.low <= 2e-8 <= first.C.high
    assert bench.surface(np.array([-3.0]), SUPPLY, np.array([4e5])).flow[0, 0] == pytest.approx(
        -mass_flow(2e-8, 0.3, 0.5, 4e5, AMBIENT), rel=0.02
    )


def test_choked_rows_say_that_b_and_m_are_typical_values():
    rows = bench_rows(4, SEVERAL, b=0.5)
    choked = rows["p1"] < 0.4 * SUPPLY
    rows = {name: values[choked] for name, values in rows.items()}
    assert not any(path.b.determined for path in bench_of(rows).paths)


def test_held_out_rows_between_commands_are_predicted():
    bench = bench_of(bench_rows(5, SEVERAL))
    (one,) = compare_flow(bench, [as_recording(bench_rows(6, {3.0: 1.5e-8}), "held", "test")])
    assert np.sqrt(np.mean((one.measured - one.predicted) ** 2)) < 2.0 * one.noise


def test_the_inverse_returns_the_command():
    bench = bench_of(bench_rows(7, SEVERAL))
    flow = bench.surface(np.array([2.5]), SUPPLY, np.array([3e5])).flow[0]
    u, reachable = bench.command(np.array([flow[0], 1.0]), SUPPLY, 3e5)
    assert u[0] == pytest.approx(2.5, abs=0.01)
    assert reachable.tolist() == [True, False]


def test_a_valve_has_no_findings():
    assert codes(bench_rows(8, SEVERAL)) == set()
    assert sets_area(bench_of(bench_rows(8, SEVERAL))) is True


def up_and_down(half_width, zero=0.0, seed=4, supplies=(7e5,)):
    """A bench that goes up and down over its commands at each supply; the opening lags by the half width."""
    if len(supplies) > 1:
        parts = [up_and_down(half_width, zero, seed + n, (one,)) for n, one in enumerate(supplies)]
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    rng = np.random.default_rng(seed)
    u = np.concatenate([np.arange(0.0, 5.01, 0.25), np.arange(5.0, -0.01, -0.25)])
    lag = np.where(np.arange(u.size) < u.size // 2, -half_width, half_width)
    opening = np.clip(u + lag - 1.0, 0.0, None)
    flow = opening * 2e-3 * supplies[0] / 7e5 * (1 + 0.003 * rng.standard_normal(u.size)) + zero * rng.choice(
        [1.0, -1.0, 1e-18], u.size
    )
    constant = np.full(u.size, 1.0)
    return {"u": u, "p_supply": supplies[0] * constant, "p1": 1.013e5 * constant, "flow": flow}


@pytest.mark.parametrize("supplies", [(7e5,), (3e5, 5e5, 7e5)])
def test_a_flow_that_lags_behind_its_command_is_told_as_hysteresis(supplies):
    numbers = dict(bench_findings(bench_of(up_and_down(0.1, supplies=supplies))))["flow-hysteresis"]
    assert numbers["half_width"] == pytest.approx(0.1, rel=0.25)
    assert "flow-hysteresis" not in codes(up_and_down(0.0, supplies=supplies))


def test_the_zero_of_a_meter_is_no_scatter():
    assert "flow-scatters" not in codes(up_and_down(0.0, zero=5e-6))


def test_a_command_that_moves_nothing_is_told():
    assert "command-idle" in codes(bench_rows(9, dict.fromkeys((1.0, 2.0, 4.0), 1e-8)))


def test_a_pressure_loop_is_told_with_its_law():
    rng = np.random.default_rng(1)
    u, q = (part.ravel() for part in np.meshgrid([1.0, 2.0, 4.0, 5.0], np.linspace(0.0, 0.01, 12), indexing="ij"))
    p1 = 1e5 * (1.0 + u) - 3e5 * q + 200.0 * rng.standard_normal(u.size)
    bench = bench_of({"u": u, "p_supply": np.full(u.size, 7e5), "p1": p1, "flow": q})
    found = dict(bench_findings(bench))
    assert found["pressure-loop"]["gain"] == pytest.approx(1e5, rel=0.01)
    assert "cracking-pressure" not in found
    assert sets_area(bench) is False


def test_a_pump_is_told():
    u, p1 = (part.ravel() for part in np.meshgrid([1.0, 2.0, 4.0], np.linspace(1.02e5, 1.8e5, 12), indexing="ij"))
    flow = 1e-3 * u * (1.0 - (p1 - 1e5) / 3e5)
    assert "flow-uphill" in codes({"u": u, "p_supply": np.full(u.size, AMBIENT), "p1": p1, "flow": flow})


def test_a_relief_valve_does_not_follow_the_curve_and_opens_between_two_rows():
    p_up = np.linspace(2e5, 6e5, 20)
    flow = np.maximum(p_up - 3e5, 0.0) * 2e-8
    rows = {"p_supply": p_up, "p1": np.full(20, AMBIENT), "flow": flow * (1.0 + 0.005 * np.sin(np.arange(20.0)))}
    assert {"curve-not-followed", "cracking-pressure"} <= codes(rows)
    (path,) = bench_of(rows).paths
    assert path.cracking.low <= 3e5 - AMBIENT <= path.cracking.high


def test_a_flow_that_remains_without_a_difference_is_told():
    rows = bench_rows(10, SEVERAL)
    rows["flow"] = rows["flow"] + 0.15 * 5e-9 * SUPPLY * DENSITY
    assert "flow-at-no-difference" in codes(rows)


def test_rows_without_any_flow_give_no_bench():
    rows = bench_rows(1, {1.0: 1e-8})
    rows["flow"] = np.zeros_like(rows["flow"])
    assert identify_flow_bench([as_recording(rows)], RIG) is None
