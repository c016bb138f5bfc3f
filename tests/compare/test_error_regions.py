"""Regions of errors: the run of bins with the largest excess of error, over each recorded signal."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.arrays import Array
from pneucli.compare.channel_errors import ChannelResult
from pneucli.compare.error_regions import error_concentration, find_error_regions, locator_signals
from pneucli.compare.goodness_of_fit import default_horizon
from pneucli.noise import NoiseModel
from pneucli.recording import Recording
from pneucli.simulate import layout as at
from tests.simulate.synthetic_experiments import RIG, make_experiment, time_grid

N = 2000
LINE = np.linspace(0.0, 1.0, N)


@pytest.mark.parametrize(
    ("peaks", "level", "region", "shares"),
    [
        ([(0.3, 0.45, 1.0)], 0.0, (0.3, 0.45), (1.0, 0.15)),  # bins of 0.05: all lies in three of the twenty
        ([(0.2, 0.3, 1.0), (0.35, 0.45, 1.0)], 0.0, (0.2, 0.45), (1.0, 0.25)),  # two that are close are one
        ([(0.4, 0.5, 9.0)], 1.0, (0.4, 0.5), (0.5, 0.1)),  # a hump above a level: 0.9 of 1.8
        ([(0.1, 0.15, 1.0), (0.7, 0.8, 2.0)], 0.0, (0.7, 0.8), (0.8, 0.1)),  # one far from a larger one is left out
    ],
)
def test_the_region_is_where_the_error_exceeds_its_share(
    peaks: list[tuple[float, float, float]], level: float, region: tuple[float, float], shares: tuple[float, float]
) -> None:
    x, squared = LINE, np.full(LINE.size, level)
    for begin, end, height in peaks:
        squared[(x > begin) & (x < end)] = height
    low, high, error, samples = error_concentration(LINE, squared)  # type: ignore[misc]
    assert (low, high) == (pytest.approx(region[0]), pytest.approx(region[1]))
    assert (error, samples) == (pytest.approx(shares[0], abs=0.01), pytest.approx(shares[1], abs=0.005))


@pytest.mark.parametrize(("height", "found"), [(3.2, True), (2.6, False)])
def test_less_than_twice_its_share_is_no_region(height: float, found: bool) -> None:
    """Half of the samples hold ``h / (1 + h)`` of the error over 1/2; a quarter may hold twice its share from 3 on."""
    squared = np.where(LINE < 0.25, height, 1.0)
    assert (error_concentration(LINE, squared) is not None) == found


def test_missing_samples_belong_to_no_region() -> None:
    values, squared = LINE.copy(), np.zeros(N)
    values[:1000] = np.nan
    squared[:1000] = 0.02
    squared[1200:1300] = 1.0
    low, high, error, samples = error_concentration(values, squared)  # type: ignore[misc]
    assert low == pytest.approx(0.6, abs=0.03)
    assert high == pytest.approx(0.65, abs=0.03)
    assert error == pytest.approx(100 / 120, abs=0.02)
    assert samples == pytest.approx(0.05, abs=0.02)


@pytest.mark.parametrize(
    ("values", "squared"),
    [(np.ones(N), np.ones(N)), (LINE, np.zeros(N)), (np.full(N, np.nan), np.ones(N))],
    ids=["a constant signal", "no error", "an unknown signal"],
)
def test_there_is_no_region_without_a_range_or_an_error(values: np.ndarray, squared: np.ndarray) -> None:
    assert error_concentration(values, squared) is None


def test_the_largest_value_belongs_to_the_last_bin() -> None:
    squared = np.zeros(N)
    squared[-1] = 1.0
    low, high, error, _ = error_concentration(LINE, squared)  # type: ignore[misc]
    assert (low, high, error) == (pytest.approx(0.95), pytest.approx(1.0), pytest.approx(1.0))


# --- the signals


def axis(**signals: Any) -> Any:
    time = time_grid(1.0)
    return make_experiment("axis", time, {name: np.broadcast_to(value, time.shape) for name, value in signals.items()})


def test_signals_that_were_not_recorded_locate_nothing() -> None:
    e = make_experiment("valve", time_grid(1.0), {})
    e = SimpleNamespace(
        time=e.time, inputs=e.inputs, raw={"p1": e.raw["p1"]}, recording=e.recording, rig=RIG, motion_is_known=False
    )
    assert list(locator_signals(e)) == ["time", "p1"]  # type: ignore[arg-type]


def test_every_recorded_signal_is_taken_from_its_own_column() -> None:
    e = axis(u=1.0, p1=2e5, p2=3e5, x=0.12, v=0.5, a=7.0)
    found = locator_signals(e)
    assert {n: found[n][0] for n in ("u", "p1", "p2", "x", "v", "a")} == {
        "u": 1.0, "p1": 2e5, "p2": 3e5, "x": 0.12, "v": 0.5, "a": 7.0,
    }  # fmt: skip
    assert np.array_equal(found["time"], e.time)


def test_a_recorded_position_gives_the_velocity() -> None:
    e = axis(x=0.1)
    e.raw.pop("v", None)
    e.inputs[:, at.IN_V] = 0.25
    assert locator_signals(e)["v"][0] == 0.25


def test_the_direction_of_motion_is_none_below_a_thousandth_of_the_largest_speed() -> None:
    e = axis(x=0.1, v=0.0)
    e.inputs[:4, at.IN_V] = [1.0, -1e-2, 0.9e-3, -0.9e-3]
    assert locator_signals(e)["direction"][:5].tolist() == [1.0, -1.0, 0.0, 0.0, 0.0]


def test_the_pressure_ratio_is_over_the_supply_while_filling_and_of_the_ambient_while_venting() -> None:
    e = axis(u=0.0, p1=3.5e5, x=0.1)
    e.inputs[:3, at.IN_U] = [2.0, -2.0, 0.0]
    ratio = locator_signals(e)["p_ratio"]
    assert ratio[:2] == pytest.approx([0.5, RIG.ambient_pressure / 3.5e5])
    assert np.isnan(ratio[2])


def test_a_valve_that_is_shut_has_no_pressure_ratio() -> None:
    time = time_grid(1.0)
    e = make_experiment("axis", time, {"u": 1.0 + 0 * time, "p1": 3e5 + 0 * time}, valve_shut=True)
    assert "p_ratio" not in locator_signals(e)


# --- regions


def comparison(error: np.ndarray, ratio: float, recording: str = "one", **signals: np.ndarray) -> Any:
    """A comparison over the recorded signals whose single channel p1 errs by ``error``."""
    e = axis(**{"p1": 3e5, **signals})
    e.raw.clear()
    e.raw.update({name: np.broadcast_to(s, e.time.shape) for name, s in signals.items()})
    result = ChannelResult(recording, "train", "p1", "Pa", 1.0, 1.0, 1.0, 1.0, 1.0, ratio, 1.0)
    return SimpleNamespace(experiment=e, results=(result,), residual=lambda channel: error)


HUMP = np.where((time_grid(1.0) > 0.4) & (time_grid(1.0) < 0.5), 1.0, 0.0)


@pytest.mark.parametrize(("ratio", "found"), [(1.19, False), (1.2, True), (5.0, True)])
def test_an_error_at_the_noise_has_no_region(ratio: float, found: bool) -> None:
    regions = find_error_regions([comparison(HUMP, ratio)])
    assert bool(regions) == found


def test_the_recording_that_errs_more_comes_first_and_is_an_event_of_its_own() -> None:
    mild, bad = comparison(HUMP, 2.0, "mild"), comparison(HUMP, 6.0, "bad")
    assert [(r.recording, r.event) for r in find_error_regions([mild, bad])] == [("bad", 0), ("mild", 1)]


def test_the_last_sample_belongs_to_the_last_region() -> None:
    """Over time and over a signal that grows, its error is one event."""
    time = time_grid(1.0)
    regions = find_error_regions([comparison(np.where(time == time[-1], 1.0, 0.0), 3.0, u=time)])
    assert {(r.signal, r.event) for r in regions} == {("time", 0), ("u", 0)}


def test_samples_that_are_not_compared_share_no_error() -> None:
    """Two thirds of the recording rest on a stop at 0; the rest errs alike everywhere."""
    position, error = time_grid(1.0), np.ones(1001)
    position[:700], error[:700] = 0.0, np.nan
    assert find_error_regions([comparison(error, 3.0, x=position)]) == []


def test_at_most_forty_regions_are_reported() -> None:
    assert len(find_error_regions([comparison(HUMP, 2.0, str(k)) for k in range(45)])) == 40


# --- the default horizon on readings whose time scale is known


NOISE = 300.0  # Pa


def recording(period: float, seconds: float, noise: float = 0.0, **signals: Array | float) -> Recording:
    time = np.arange(0.0, seconds, period)
    read = {name: np.broadcast_to(np.asarray(s, float), time.shape).copy() for name, s in signals.items()}
    models = {name: NoiseModel(noise, noise, period, ()) for name in read} if noise else {}
    return Recording("run", "valve", "train", time, read, models)


def charge(time_constant: float, period: float = 0.1, seconds: float = 150.0) -> Recording:
    time = np.arange(0.0, seconds, period)
    return recording(period, seconds, p1=1e5 + 6e5 * (1.0 - np.exp(-time / time_constant)))


@pytest.mark.parametrize(("time_constant", "horizon"), [(0.05, 0.5), (0.9, 0.5), (3.0, 2.0), (21.0, 20.0)])
def test_the_horizon_is_the_even_time_before_a_reading_has_responded(time_constant: float, horizon: float) -> None:
    assert default_horizon([charge(time_constant)]) == horizon


@pytest.mark.parametrize("frequency", [0.5, 1.9, 2.0, 3.7, 8.0])
def test_a_fast_sine_is_fast_at_any_frequency(frequency: float) -> None:
    """Over a whole number of its periods a sine does not change at all."""
    time = np.arange(0.0, 60.0, 0.01)
    assert default_horizon([recording(0.01, 60.0, p1=np.sin(2.0 * np.pi * frequency * time))]) == 0.5


def test_the_fastest_recording_decides() -> None:
    assert default_horizon([charge(21.0), charge(0.3)]) == 0.5
    assert default_horizon([charge(21.0), charge(4.0)]) == 2.0


def test_what_does_not_respond_tells_no_time_scale() -> None:
    """A vented chamber reads noise alone, which changes by its whole range at once."""
    slow = charge(21.0)
    vented = 1e5 + NOISE * np.random.default_rng(3).standard_normal(slow.time.size)
    both = recording(0.1, 150.0, NOISE, p1=slow["p1"], p2=vented, temperature=293.15)
    assert default_horizon([both]) == 20.0


def test_slow_logs_have_samples_within_the_horizon() -> None:
    assert default_horizon([charge(2.0, period=1.0)]) == 5.0


def test_where_nothing_responds_the_usual_horizon_holds() -> None:
    assert default_horizon([]) == 0.5
    assert default_horizon([recording(0.1, 150.0, p1=1e5)]) == 0.5
