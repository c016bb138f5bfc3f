"""The law of rows: stamps in any batches, clocks that run back, tables of several clocks; every row has its fate."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pneucli.errors import InputError
from pneucli.io.timestamp_order import LOOKAHEAD_ROWS, ROW_CLASSES, Table, TimestampCheck, count_losses, join_tables

N = 60
GOOD = 0.1 * np.arange(N)


def fates(time: np.ndarray, *cuts: int) -> list[str]:
    """Judge the stamps in batches, as the cleaner does: the last ones of a batch wait for the next."""
    order, done, edges = TimestampCheck(lambda row: f"row {row}"), [], [0, *sorted(cuts), time.size]
    start = 0
    for _, end in pairwise(edges):
        judged = max(0, end - start - (LOOKAHEAD_ROWS if end < time.size else 0))
        done.append(order.classify_rows(time[start:end], judged))
        start += judged
    return [ROW_CLASSES[fate] for fate in np.concatenate(done)]


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    same=st.sampled_from([(), (10,), (10, 11, 40)]),
    back=st.sampled_from([(), (20,), (20, 21, 22)]),
    ahead=st.sampled_from([(), (30,)]),
    blank=st.sampled_from([(), (0,), (5, 50, 59)]),
    cuts=st.lists(st.integers(0, N), max_size=4),
)
def test_the_fate_of_a_row_does_not_depend_on_the_batches(
    same: tuple[int, ...], back: tuple[int, ...], ahead: tuple[int, ...], blank: tuple[int, ...], cuts: list[int]
) -> None:
    time, expected = GOOD.copy(), ["kept"] * N
    for k in same:
        time[k], expected[k - 1] = time[k - 1], "duplicate"
    for k in back:
        time[k], expected[k] = 0.1 * k - 1.5, "backward"
    for k in ahead:
        time[k], expected[k] = 99.0, "backward"
    for k in blank:
        time[k], expected[k] = (np.nan, np.inf, 1e300)[k % 3], "no-stamp"
    assert fates(time, *cuts) == expected


@pytest.mark.parametrize("cut", [(), (3,), (4, 5), (6, 9)])
def test_of_rows_of_one_stamp_the_state_after_the_event_counts(cut: tuple[int, ...]) -> None:
    """A log of changes has a command before and after each step: the first would be late (findings/asof-ties.sh)."""
    time = np.array([0.0, 1, 1, 2, 2, 2, 2, 3, 2.5, 3, 4, 3.6, 3.5, 4])
    kept = np.flatnonzero(np.array(fates(time, *cut)) == "kept")
    assert kept.tolist() == [0, 2, 6, 9, 10]


@pytest.mark.parametrize("cut", [(), (32,), (31, 33)])
def test_a_clock_that_runs_back_is_refused_with_its_place(cut: tuple[int, ...]) -> None:
    time = GOOD.copy()
    time[30:] -= 2.0
    with pytest.raises(InputError, match=r"row 30: the time goes back from 2\.9 s to 1 s"):
        fates(time, *cut)


def test_stamps_that_are_too_coarse_are_refused() -> None:
    with pytest.raises(InputError, match="row 1: more than half of the time stamps repeat"):
        fates(np.floor(GOOD / 0.5))


def place(row: int) -> str:
    return f"row {row}"


def table(time: list[float], name: str, first: int = 0) -> Table:
    return Table(np.array(time), {name: np.arange(len(time), dtype=float)}, first + np.arange(len(time)))


def test_tables_of_one_clock_are_one_table_stamps_as_they_are() -> None:
    stamps = [0.0, 1.0, 1.0, float("nan"), 0.5]
    joined, losses = join_tables([table(stamps, "p"), table(stamps, "x", first=5)], place)
    np.testing.assert_array_equal(joined.time, stamps)
    assert list(joined.columns) == ["p", "x"]
    assert losses == {"joined": 5}


def test_tables_of_several_clocks_are_joined_and_every_row_is_accounted_for() -> None:
    joined, losses = join_tables([table([0, 1, 1, 3], "p"), table([0, 2, np.nan, 3], "x", first=4)], place)
    np.testing.assert_array_equal(joined.time, [0, 1, 2, 3])
    np.testing.assert_array_equal(joined.columns["p"], [0, 2, np.nan, 3])
    np.testing.assert_array_equal(joined.columns["x"], [0, np.nan, 1, 3])
    assert losses == {"duplicate": 1, "no-stamp": 1, "joined": 2}
    assert joined.time.size + sum(losses.values()) == 8


def test_a_row_of_two_tables_is_lost_only_where_both_leave_it_out() -> None:
    shared = Table(np.array([1.0, 3.0]), {"x": np.zeros(2)}, np.array([2, 3]))  # rows that the other table has too
    joined, losses = join_tables([table([0, 1, 1, 3], "p"), shared], place)
    assert joined.time.size + sum(losses.values()) == 4
    assert losses == {"duplicate": 1}


def test_a_clock_that_runs_back_is_refused_in_each_table() -> None:
    with pytest.raises(InputError, match="row 16: the time goes back"):
        join_tables([table([0, 1], "p"), table([*range(14), *range(14)], "x", first=2)], place)


def test_counts_are_by_kind() -> None:
    assert count_losses(np.array([0, 1, 2, 2, 0], dtype=np.int8)) == {"no-stamp": 1, "duplicate": 2}
