"""Cleaning: faults are found and counted, good data pass bit by bit, batches make no difference."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pneucli.errors import InputError
from pneucli.io.cleaning import Cleaner

N = 2000


def signal(seed: int = 0, noise: float = 400.0) -> dict[str, np.ndarray]:
    """Charge and rest of a chamber, sensor noise of 400 Pa (one of the levels of the measurement cases)."""
    rng = np.random.default_rng(seed)
    time = np.arange(N) * 1e-3
    charge = 1e5 + 5e5 * (1 - np.exp(-np.maximum(time - 0.3, 0) / 0.2))
    return {"time": time, "p1": charge + noise * rng.standard_normal(N), "u": np.where(time > 0.3, 10.0, 0.0)}


def clean(batch: dict[str, np.ndarray], *cuts: int) -> tuple[dict[str, np.ndarray], dict[tuple[str, str], int]]:
    cleaner = Cleaner(lambda row: f"row {row}")
    edges = [0, *sorted(cuts), len(batch["time"])]
    parts = [
        cleaner.push({name: values[start:end] for name, values in batch.items()}) for start, end in pairwise(edges)
    ]
    parts.append(cleaner.finish())
    joined = {name: np.concatenate([part[name] for part in parts]) for name in batch}
    return joined, {(one.signal, one.kind): one.count for one in cleaner.repairs()}


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    noise=st.sampled_from([0.0, 5.0, 400.0, 5000.0]),
    step=st.sampled_from([0.0, 100.0, 2000.0]),
    cuts=st.lists(st.integers(0, N), max_size=4),
)
def test_good_data_pass_bit_by_bit_in_any_batches(seed: int, noise: float, step: float, cuts: list[int]) -> None:
    good = signal(seed, noise)
    if step:
        good["p1"] = np.round(good["p1"] / step) * step
    cleaned, repairs = clean(good, *cuts)
    for name, values in good.items():
        np.testing.assert_array_equal(cleaned[name], values)
    assert repairs == {}


@settings(max_examples=40, deadline=None)
@given(
    at=st.integers(20, N - 21),
    width=st.integers(1, 3),
    height=st.sampled_from([-2e6, 2e5, 1e9]),
    cuts=st.lists(st.integers(0, N), max_size=3),
)
def test_spikes_become_nan_and_nothing_else_does(at: int, width: int, height: float, cuts: list[int]) -> None:
    cuts = [
        cut
        for cut in cuts
        if 32 < cut < N - 32 and min((abs(cut - other) for other in cuts if other != cut), default=99) > 32
    ]
    bad = signal()
    bad["p1"][at : at + width] += height
    cleaned, repairs = clean(bad, *cuts)
    assert np.flatnonzero(np.isnan(cleaned["p1"])).tolist() == list(range(at, at + width))
    assert repairs == {("p1", "spike"): width}


@pytest.mark.parametrize(
    ("stale", "repaired"),
    [([-0.045], [0]), ([0.3, 0.3, 0.3], [0, 1, 2]), ([0.3] * 4, []), ([0.02], []), ([0.3, np.nan, 0.3], [0, 2])],
    ids=["one", "three", "a place", "a fast piston", "across a gap"],
)
def test_what_a_recorder_held_before_the_first_position_becomes_nan(stale: list[float], repaired: list[int]) -> None:
    """A piston does 30 mm in a millisecond at most; where more samples agree, either side may be right."""
    x = 1e-5 * np.random.default_rng(0).standard_normal(N)
    x[: len(stale)] = stale
    cleaned, repairs = clean(signal() | {"x": x})
    assert np.flatnonzero(np.isnan(cleaned["x"]) & ~np.isnan(x)).tolist() == repaired
    assert repairs.get(("x", "stale"), 0) == len(repaired)


def test_a_command_may_pulse() -> None:
    pulsed = signal()
    pulsed["u"][500] = -10.0
    assert clean(pulsed)[1] == {}


def test_an_impact_that_rings_is_no_spike() -> None:
    rung = signal(noise=1.0)
    rung["p1"] = 1e5 + np.random.default_rng(1).standard_normal(N)
    rung["p1"][900:930] += 300 * np.exp(-np.arange(30) / 6) * np.cos(2 * np.arange(30))
    assert clean(rung)[1] == {}


def test_time_stamps_are_put_right_and_counted() -> None:
    bad = signal()
    bad["time"][100] = bad["time"][99]  # repeated
    bad["time"][200] = bad["time"][190]  # fell back
    bad["time"][300] += 5.0  # ran ahead
    bad["time"][400] = np.nan
    cleaned, repairs = clean(bad)
    assert np.all(np.diff(cleaned["time"]) > 0)
    np.testing.assert_array_equal(cleaned["p1"], np.delete(bad["p1"], [99, 200, 300, 400]))
    assert repairs == {("time", "duplicate"): 1, ("time", "backward"): 2, ("time", "no-stamp"): 1}


def test_what_no_gas_and_no_clock_shows_is_counted_and_kept() -> None:
    odd = signal()
    odd["p1"][700:708], odd["time"][0] = 0.0, 4e-320
    cleaned, repairs = clean(odd)
    assert repairs == {("p1", "vacuum"): 8, ("time", "tiny"): 1}
    np.testing.assert_array_equal(cleaned["p1"], odd["p1"])


def test_missing_and_infinite_values_are_counted() -> None:
    bad = signal()
    bad["p1"][[5, 6]], bad["p1"][50] = np.nan, np.inf
    cleaned, repairs = clean(bad)
    assert np.flatnonzero(np.isnan(cleaned["p1"])).tolist() == [5, 6, 50]
    assert repairs == {("p1", "nan"): 2, ("p1", "infinite"): 1}


def test_gaps_and_jitter_are_noticed_and_kept() -> None:
    rough = signal()
    rough["time"][1000:] += 0.7
    assert clean(rough)[1] == {("time", "gap"): 1}
    rough["time"] += np.random.default_rng(0).uniform(0, 0.45e-3, N)
    cleaned, repairs = clean(rough)
    np.testing.assert_array_equal(cleaned["time"], rough["time"])
    assert repairs["time", "jitter"] > N / 100


def test_a_noisy_channel_that_stands_still_is_noticed_and_kept() -> None:
    bad = signal()
    bad["p1"][1500:1600] = bad["p1"][1500]
    cleaned, repairs = clean(bad)
    np.testing.assert_array_equal(cleaned["p1"], bad["p1"])
    assert repairs == {("p1", "frozen"): 100}


def test_a_noisy_channel_at_the_end_of_its_range_is_missing() -> None:
    bad = signal()
    end = 6e5 - 1e3  # below the charged chamber
    bad["p1"] = np.minimum(bad["p1"], end)
    cleaned, repairs = clean(bad)
    np.testing.assert_array_equal(np.isnan(cleaned["p1"]), bad["p1"] == end)
    assert repairs == {("p1", "saturated"): int(np.sum(bad["p1"] == end))}


def test_a_value_that_is_jumped_to_is_set_and_not_the_end_of_a_range() -> None:
    """A driving force that is commanded: noise of the loop, then a limit that is held, on a motion back at once."""
    time = np.arange(N) * 1e-3
    force = 50.0 * np.sin(3 * time) + np.random.default_rng(0).standard_normal(N)
    force[400:900], force[1200:1700] = 80.0, -80.0
    cleaned, repairs = clean({"time": time, "force": force})
    np.testing.assert_array_equal(cleaned["force"], force)
    assert repairs.keys() <= {("force", "frozen")}


def test_a_piston_at_rest_is_neither_saturated_nor_frozen() -> None:
    """Its encoder counts on, unevenly in time, and stands still exactly: on a stop, in the middle, and so does v."""
    time = np.arange(4 * N) * 1e-3
    jitter = 2e-4 * np.random.default_rng(0).standard_normal(4 * N)
    moved = np.interp(time + jitter, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 8.0], [0.0, 0.05, 0.05, 0.1, 0.1, 0.05, 0.05])
    x = np.round(moved / 1e-6) * 1e-6
    v = np.abs(np.gradient(x, 1e-3))
    cleaned, repairs = clean({"time": time, "x": x, "v": v})
    np.testing.assert_array_equal(cleaned["x"], x)
    np.testing.assert_array_equal(cleaned["v"], v)
    assert repairs == {}


@pytest.mark.parametrize(("resolution", "is_saturated"), [(1.0, True), (4000.0, False)])
def test_a_sensor_that_slews_shows_its_noise_all_the_same(resolution: float, is_saturated: bool) -> None:
    """Steps turn rarely on a slope. Noise below the resolution does not show, and a valve may stop a pressure."""
    time = np.arange(N) * 1e-3
    slewing = 1e5 + 2e6 * np.abs((2 * time) % 1.0 - 0.5) + 300.0 * np.random.default_rng(0).standard_normal(N)
    cut = np.minimum(np.round(slewing / resolution) * resolution, 9e5)
    cleaned, repairs = clean({"time": time, "p1": cut})
    assert (("p1", "saturated") in repairs) == is_saturated
    assert np.isnan(cleaned["p1"][cut == 9e5]).all() == is_saturated


def test_a_channel_without_noise_that_stops_at_full_speed_is_noticed_and_kept() -> None:
    smooth = signal(noise=0.0)
    cut = {**smooth, "p1": np.minimum(smooth["p1"], 4e5)}
    cleaned, repairs = clean(cut)
    np.testing.assert_array_equal(cleaned["p1"], cut["p1"])
    assert repairs.keys() == {("p1", "plateau")}


def test_rest_of_a_quiet_channel_is_no_fault() -> None:
    quiet = signal(noise=0.0)  # at ambient for 0.3 s, exactly
    assert clean(quiet)[1] == {}
    piston = {"time": quiet["time"], "x": np.round(np.maximum(quiet["time"] - 1, 0) ** 2, 6)}
    assert clean(piston)[1] == {}


def test_a_position_that_rests_and_then_jumps_was_frozen() -> None:
    moving = {"time": np.arange(N) * 1e-3, "x": 0.1 * np.arange(N) * 1e-3}
    moving["x"][500:600] = moving["x"][500]
    assert clean(moving)[1] == {("x", "frozen"): 100}


def test_a_clock_that_starts_anew_is_refused_with_its_row() -> None:
    bad = signal()
    bad["time"][1000:] -= 1.0
    with pytest.raises(InputError, match=r"row 1000: the time goes back from 0\.999 s to 0 s"):
        clean(bad)


def test_a_clock_too_coarse_is_refused() -> None:
    coarse = signal()
    coarse["time"] = np.round(coarse["time"], 2)
    with pytest.raises(InputError, match="more than half of the time stamps repeat"):
        clean(coarse)
