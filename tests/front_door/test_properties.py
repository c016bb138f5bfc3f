"""Whatever stands in a file, the front door answers or refuses: no fault, and good data pass bit by bit."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pneucli.errors import InputError
from pneucli.io.cleaning import MARGIN_SAMPLES, MAX_SPIKE_SAMPLES, MIN_NOISE_RATIO, MIN_STEP_RATIO, find_spikes
from pneucli.io.clock import CounterClock, EvenClock, spread_stamps
from pneucli.io.signal_repairs import HeldReadingDetector, MarkDetector, RollOverCorrector
from pneucli.io.timestamp_order import Table, align_tables
from pneucli.stages import init

NUMBERS = st.one_of(st.floats(-1e6, 1e6), st.sampled_from([0.0, np.nan, -9999.0, 65535.0, 1e30]))
COLUMN = arrays(np.float64, st.integers(0, 200), elements=NUMBERS)


@given(COLUMN, st.booleans())
def test_marks_only_take_values_away(values: np.ndarray, command: bool) -> None:
    detector = MarkDetector(command=command)
    found = detector.replace(values)
    kept = np.isfinite(found)
    np.testing.assert_array_equal(found[kept], values[kept])
    assert sum(detector.counts.values()) == np.count_nonzero(np.isfinite(values) & ~kept)


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 1e-3, 1e-2, 0.1]))
def test_readings_of_a_sensor_have_no_marks(seed: int, resolution: float) -> None:
    rng = np.random.default_rng(seed)
    values = np.cumsum(rng.standard_normal(400)) * rng.choice([0.0, 0.01, 1.0]) + 0.1 * rng.standard_normal(400)
    values = np.round(values / resolution) * resolution if resolution else values
    assert MarkDetector().replace(values) is values


@given(COLUMN)
def test_roll_over_and_held_readings_answer_to_anything(values: np.ndarray) -> None:
    RollOverCorrector().correct(values)
    thinned = HeldReadingDetector().thin(values)
    kept = np.isfinite(thinned)
    np.testing.assert_array_equal(thinned[kept], values[kept])


@pytest.mark.parametrize("period", [100.0, 360.0, 2 * np.pi, 4096.0, 65536.0, 327.68])
def test_a_position_that_rolls_over_is_undone(period: float) -> None:
    count = {4096.0: 1.0, 65536.0: 1.0, 327.68: 0.005}.get(period, 1e-5 * period)
    t = np.arange(4000) * 1e-3
    true = period * (1.5 + 1.2 * np.sin(2 * np.pi * t))
    raw = np.round(np.mod(true, period) / count) * count
    corrector = RollOverCorrector()
    found = np.concatenate([corrector.correct(raw[:1500]), corrector.correct(raw[1500:])])
    error = found - true
    assert np.ptp(error) < 4 * count
    assert corrector.found is not None
    assert corrector.found.period == pytest.approx(period, rel=1e-9)


@given(st.integers(0, 200), st.sampled_from([2**16, 2**32]))
def test_a_counter_of_stamps_goes_on(first: int, counter: int) -> None:
    true = np.arange(5000) * 100.0 + counter - 1000 * first
    clock = CounterClock()
    raw = np.mod(true, counter)
    found = np.concatenate([clock.unwrap(raw[:777]), clock.unwrap(raw[777:])])
    np.testing.assert_array_equal(np.diff(found), 100.0)


@given(st.integers(2, 50))
def test_coarse_stamps_are_spread_evenly(rows: int) -> None:
    index = np.arange(40 * rows)
    found = spread_stamps(index // rows * 0.01)
    assert found is not None
    np.testing.assert_allclose(found, index * 0.01 / rows, atol=1e-9)


@given(
    st.floats(2e-4, 4e-3),
    st.sampled_from([np.floor, np.round]),
    st.integers(100, 3900),
    st.sampled_from([0.0, 0.05, 3600.0]),
)
def test_rows_of_an_even_clock_read_in_milliseconds_stand_on_its_ticks(
    period: float, read: Callable[[np.ndarray], np.ndarray], cut: int, pause: float
) -> None:
    """Batch by batch; a pause begins a new line, and no error grows along it."""
    true = period * np.arange(5000) + np.where(np.arange(5000) < cut, 0.0, pause)
    stamps = read(1e3 * true) / 1e3
    clock = EvenClock.of(stamps)
    if clock is None:  # whole milliseconds, but for what binary numbers miss
        steps = np.diff(stamps)[np.diff(true) < 1.01 * period]
        assert np.count_nonzero(np.abs(steps - period) > 0.21 * period) < 8
        return
    found = np.concatenate([clock.place(stamps[:4000]), clock.place(stamps[4000:])])
    if clock.rows == true.size:  # others stand where few steps tell
        assert np.ptp(found - true) < (1.3e-3 if pause else 0.4e-3)
        same = np.diff(true) < 1.01 * period
        assert np.abs(np.diff(found)[same] - period).max() < 0.4e-3  # where a batch begins; stamps err by 1 ms


@pytest.mark.parametrize(
    "stamps",
    [
        1e-3 * np.round(5.0 * np.arange(2000) + np.random.default_rng(3).uniform(-2.0, 2.0, 2000)),  # it really jitters
        1e-3 * np.cumsum(np.random.default_rng(3).integers(0, 3, 2000)),  # rows are lost and repeated
        1e-3 * np.arange(2000),  # nothing to mend
        1e-3 * np.insert(np.arange(2000), 700, 700),  # one row repeats its stamp
        1e-3 * np.delete(np.arange(2000), [500, 1500]),  # two rows are lost
        np.repeat(7.0, 2000),
    ],
)
def test_stamps_that_no_even_clock_explains_stay(stamps: np.ndarray) -> None:
    assert EvenClock.of(stamps) is None


def test_a_slow_reading_stays_as_sparse_as_it_was_measured() -> None:
    fast = np.arange(4000) * 1e-3
    slow = 2.37e-4 + np.arange(1000) * 4e-3 * (1 + 5e-5)
    tables = [Table(fast, {"p1": fast}, np.arange(4000)), Table(slow, {"x": np.sin(7 * slow)}, 4000 + np.arange(1000))]
    aligned = align_tables(tables, (), str)
    known = np.isfinite(aligned.table.columns["x"])
    assert known.sum() == pytest.approx(1000, abs=2)
    np.testing.assert_allclose(aligned.table.columns["x"][known], np.sin(7 * aligned.table.time[known]), atol=1e-4)
    assert aligned.table.time.size + sum(aligned.losses.values()) == 5000


def test_clocks_without_a_common_time_are_refused() -> None:
    early = Table(np.arange(200.0), {"p1": np.zeros(200)}, np.arange(200))
    late = Table(np.arange(500.0, 700.0), {"x": np.zeros(200)}, np.arange(200, 400))
    with pytest.raises(InputError, match="one channel begins at 500 s, and another one ends at 199 s"):
        align_tables([early, late], (), str)


def slow_spikes(values: np.ndarray, noise: float = 0.0) -> list[int]:
    """The definition, sample by sample."""
    steps = np.abs(np.diff(values))
    moving = steps[np.isfinite(steps) & (steps > 1e-12 * np.nanmax(np.abs(values)))]
    usual = np.median(steps[np.isfinite(steps)]) / 0.954
    limit = MIN_NOISE_RATIO * max(usual, moving.min() if moving.size else np.inf, noise)
    found = set()
    for last in np.flatnonzero(steps > limit):
        for width in range(1, MAX_SPIKE_SAMPLES + 1):
            back = last + width + 1
            if back >= values.size:
                break
            inside = values[last + 1 : back]
            height = min(np.abs(inside - values[last]).min(), np.abs(inside - values[back]).min())
            around = np.concatenate([steps[max(0, last - MARGIN_SAMPLES) : last], steps[back : back + MARGIN_SAMPLES]])
            calm = np.nanmax(around) if np.isfinite(around).any() else np.inf
            same_side = np.ptp(np.sign(inside - values[last])) == 0
            returns = abs(values[back] - values[last]) < height / MIN_STEP_RATIO
            if returns and same_side and height > max(limit, MIN_STEP_RATIO * calm):
                found |= set(range(last + 1, back))
                break
    return sorted(found)


@given(st.integers(0, 2**32 - 1))
def test_spikes_are_those_of_their_definition(seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = np.cumsum(rng.normal(size=200)) * rng.choice([0.0, 0.01, 1.0]) + rng.normal(size=200) * rng.choice(
        [0.1, 1.0]
    )
    for at in rng.integers(0, 200, rng.integers(0, 6)):
        values[at : at + rng.integers(1, 5)] += rng.choice([-1000.0, 5.0, 50.0])
    if rng.random() < 0.5:
        values = np.round(values, 1)
    assert find_spikes(values).tolist() == slow_spikes(values)


TEXT = st.text(st.sampled_from("0123456789.,;-+eE:/ \t\nabtup[]#{}\"'"), max_size=400)
COLUMNS = st.dictionaries(
    st.sampled_from(["t [s]", "time", "dt", "u", "p1 [bar]", "P2", "x [counts]", "pos", "F [N]", "date"]),
    st.lists(NUMBERS, min_size=1, max_size=60),
    min_size=1,
    max_size=5,
)


def start(content: str, folder: Path) -> None:
    raw = folder / "a.csv"
    raw.write_text(content, encoding="utf-8")
    try:
        init.create(folder / "rig", [raw])
    except InputError:
        return
    finally:
        for path in [*(folder / "rig").glob("*"), raw]:
            path.unlink()


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(TEXT)
def test_init_answers_to_any_text(tmp_path: Path, content: str) -> None:
    start(content, tmp_path)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(COLUMNS)
def test_init_answers_to_any_columns(tmp_path: Path, columns: dict[str, list[float]]) -> None:
    rows = max(map(len, columns.values()))
    lines = [",".join(columns)]
    lines += [",".join(f"{v[n % len(v)]:.6g}".replace("nan", "") for v in columns.values()) for n in range(rows)]
    start("\n".join(lines) + "\n", tmp_path)
