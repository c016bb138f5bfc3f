"""Columns as laboratories leave them: units below the header, dates, times of day, signals computed from columns."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from pneucli.errors import InputError
from pneucli.io.clock import Clock, is_date_or_time
from pneucli.io.expression import Expression
from pneucli.io.raw_file import Channel, RawFile
from pneucli.io.signal_reader import open_signals


def signals(tmp_path: Path, text: str, **channels: Channel):
    path = tmp_path / "a.csv"
    path.write_text(text, encoding="utf-8")
    opened = open_signals(RawFile(path, channels, ambient=1e5))
    (batch,) = opened.batches()
    return batch, {(one.signal, one.kind) for one in opened.repairs}


def test_units_below_the_header_count_where_none_is_stated(tmp_path: Path) -> None:
    """``ms`` that pass for seconds are a factor of 1000 in silence."""
    text = "Zeit;Druck;Weg\nms;barg;mm\n0;2,5;10\n1;2,6;11\n"
    batch, told = signals(
        tmp_path,
        text,
        time=Channel("Zeit", si="s"),
        p1=Channel("Druck", si="Pa"),
        x=Channel("Weg", factor=1.0, unit="m"),
    )
    np.testing.assert_allclose(batch["time"], [0, 1e-3])
    np.testing.assert_allclose(batch["p1"], [3.5e5, 3.6e5])
    np.testing.assert_allclose(batch["x"], [10, 11])  # stated: m
    assert told == {("", "units-line"), ("time", "unit-said"), ("p1", "unit-said"), ("x", "unit")}


@pytest.mark.parametrize("name", ["t [ms]", "t (ms)", "t<ms>", "t (in ms)"])
def test_a_unit_in_a_columns_name_counts_too(tmp_path: Path, name: str) -> None:
    batch, _ = signals(tmp_path, f"{name},x\n0,1\n5,1\n", time=Channel(1, si="s"))
    np.testing.assert_allclose(batch["time"], [0, 5e-3])


def test_a_unit_that_its_signal_cannot_have_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"the file says \"V\" of column \"p\""):
        signals(tmp_path, "t,p\ns,V\n0,1\n1,2\n", time=Channel("t", si="s"), p1=Channel("p", si="Pa"))


STAMPS = {
    "day first": (["21.03.2024 14:05:07.5", "21.03.2024 14:05:08"], [0, 0.5]),
    "month first, told by midnight": (["03/04/2024 23:59:59.5", "03/05/2024 00:00:00.5"], [0, 1]),
    "day first, told by midnight": (["03/04/2024 23:59:59.5", "04/04/2024 00:00:00.5"], [0, 1]),
    "year first": (["2024-03-21T14:05:07.123+01:00", "2024-03-21T14:05:07.200+01:00"], [0, 0.077]),
    "a decimal comma, and nothing": (["14:05:07,123", None, "14:05:08"], [0, np.nan, 0.877]),
    "over midnight without a date": (["23:59:59", "00:00:01", "00:00:02"], [0, 2, 3]),
    "halves of a day": (["11:59:59 AM", "12:00:01 PM", "1:00:00 p.m."], [0, 2, 3601]),
    "names of months": (["21-Mar-2024 14:05", "21-Mar-2024 14:06"], [0, 60]),
}


@pytest.mark.parametrize("way", STAMPS)
def test_dates_and_times_of_day_become_seconds(way: str) -> None:
    texts, expected = STAMPS[way]
    assert all(is_date_or_time(text) for text in texts if text)
    np.testing.assert_allclose(Clock().seconds(pa.array(texts)), expected)


def test_stamps_of_later_batches_go_on(tmp_path: Path) -> None:
    dated, bare = Clock(), Clock()
    assert dated.seconds(pa.array(["03/04/2024 23:59:59"]))[0] == 0
    assert dated.seconds(pa.array(["03/05/2024 00:00:01"]))[0] == 2  # only now it shows that the month is first
    assert bare.seconds(pa.array(["23:59:59"]))[0] == 0
    assert bare.seconds(pa.array(["00:00:01"]))[0] == 2
    assert f"{dated.start:%Y-%m-%d %H:%M:%S}" == "2024-03-04 23:59:59"
    assert bare.start is None


def test_a_column_of_stamps_is_read_as_time(tmp_path: Path) -> None:
    text = "Zeit;p\n21.03.2024 10:00:00,000;1,5\n21.03.2024 10:00:00,250;1,6\n"
    batch, _ = signals(tmp_path, text, time=Channel("Zeit"), p1=Channel("p"))
    np.testing.assert_allclose(batch["time"], [0, 0.25])
    np.testing.assert_allclose(batch["p1"], [1.5, 1.6])


def test_a_text_among_stamps_is_refused_with_its_place(tmp_path: Path) -> None:
    rows = "".join(f"10:00:{n:02d},1\n" for n in range(30))
    with pytest.raises(InputError, match=r'line 32, column "t".*\n  wanted: a date or time'):
        signals(tmp_path, f"t,p\n{rows}10 o'clock,1\n", time=Channel("t"))


def test_labviews_column_of_comments_is_no_column_of_numbers(tmp_path: Path) -> None:
    batch, _ = signals(tmp_path, "X_Value\tp\tComment\n0\t1\n1\t2\n", time=Channel("X_Value"), p1=Channel("p"))
    np.testing.assert_array_equal(batch["p1"], [1, 2])


EXPRESSIONS = {
    "(`P 1` - p2) / 2": [4.5, 9.0],
    "sqrt(`3`)": [3.0, 4.0],
    "abs(-p2)^2 + 0*pi": [1.0, 4.0],
    "row * 0.5": [0.0, 0.5],
}


@pytest.mark.parametrize("expression", EXPRESSIONS)
def test_a_signal_is_computed_from_columns(tmp_path: Path, expression: str) -> None:
    text = "P 1,p2,q\n10,1,9\n20,2,16\n"
    clock = Channel(0, expression="row / 1000")
    batch, _ = signals(tmp_path, text, time=clock, p1=Channel(0, factor=10.0, offset=1.0, expression=expression))
    np.testing.assert_allclose(batch["time"], [0, 1e-3])
    np.testing.assert_allclose(batch["p1"], 10 * np.array(EXPRESSIONS[expression]) + 1)


def test_a_column_may_serve_a_signal_and_an_expression(tmp_path: Path) -> None:
    batch, _ = signals(
        tmp_path, "t,p\n0,1\n1,2\n", time=Channel("t"), p1=Channel("p"), p2=Channel(0, expression="p + 1")
    )
    np.testing.assert_array_equal(batch["p2"], batch["p1"] + 1)


@pytest.mark.parametrize(
    "text", ["__import__('os')", "p.sum", "p[0]", "f(p)", "p if p else 1", "'a'", "p,", "(", "", "2"]
)
def test_an_expression_is_arithmetic_and_runs_nothing_else(text: str) -> None:
    with pytest.raises(ValueError, match="wanted"):
        Expression(text).check()


def test_an_expression_that_waits_for_a_number_says_so() -> None:
    with pytest.raises(ValueError, match="to be filled in"):
        Expression("row / ?").check()


def test_an_expression_over_a_column_that_is_not_there_lists_those_that_are(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t,p\n0,1\n1,2\n")
    channels = {"time": Channel("t"), "p1": Channel(0, expression="2 * pp")}
    with pytest.raises(InputError, match='no column "pp"'):
        open_signals(RawFile(path, channels, frozenset({"time", "p1"})))
    assert list(open_signals(RawFile(path, channels)).positions) == ["time"]  # as a column that is not there
