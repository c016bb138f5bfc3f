"""What a signal looks like, and what is missing of it."""

import numpy as np
import pytest

from pneucli.messages.formatting import format_signal
from pneucli.messages.ingest import implausibility_sentences, signal_summary_table
from pneucli.noise import NoiseModel
from pneucli.plausibility import summarize_signal
from pneucli.plausibility.rig_check import Finding
from pneucli.recording import Recording

T = np.arange(1000) * 1e-3


def recorded(**signals: np.ndarray) -> Recording:
    return Recording("one", "valve", "train", T, signals, {"p1": NoiseModel(400.0)})


def test_a_look_has_least_median_most_noise_and_rate() -> None:
    one = summarize_signal(recorded(p1=1e5 + 5e5 * T), "p1")
    assert (one.unit, one.least, one.noise, one.missing) == ("Pa", 1e5, 400.0, 0.0)
    assert (one.median, one.most) == (pytest.approx(349_750.0), pytest.approx(599_500.0))
    assert (one.rate, one.speed) == (pytest.approx(1000.0), pytest.approx(5e5))


def test_half_of_the_samples_lost_at_random_are_half_of_the_time() -> None:
    lost = np.random.default_rng(0).random(T.size) < 0.5
    assert summarize_signal(recorded(p1=np.where(lost, np.nan, T)), "p1").missing == pytest.approx(0.5, abs=0.06)


def test_what_is_cut_off_is_missing() -> None:
    assert summarize_signal(recorded(p1=np.where(T < 0.3, np.nan, T)), "p1").missing == pytest.approx(0.3, abs=0.01)


def test_a_slower_clock_of_its_own_misses_nothing() -> None:
    slow = np.where(np.arange(T.size) % 10 == 3, T, np.nan)
    one = summarize_signal(recorded(p1=slow, u=T), "p1")
    assert (one.missing, one.rate) == (0.0, pytest.approx(100.0))


def test_a_clock_with_a_gap_misses_no_sample() -> None:
    late = np.where(T < 0.5, T, T + 5.0)
    assert summarize_signal(Recording("one", "valve", "train", late, {"p1": T}), "p1").missing == 0.0


def test_a_single_sample_has_no_rate_and_no_noise_without_a_model() -> None:
    one = summarize_signal(recorded(x=np.where(T == 0.0, 0.1, np.nan)), "x")
    assert (one.rate, one.speed, one.noise) == (None, None, None)


def test_the_table_is_in_peoples_units_over_all_recordings_of_an_experiment() -> None:
    first, second = ({"p1": summarize_signal(recorded(p1=p + 0 * T), "p1")} for p in (1e5, 7e5))
    head, row = signal_summary_table({"a": first, "b": second}, {"a": "valve", "b": "valve"})
    assert head.split() == ["experiment", "signal", "least", "median", "most", "noise", "unit", "rate"]
    assert row.split() == ["valve", "p1", "1", "4", "7", "0.004", "bar", "1000", "Hz"]


@pytest.mark.parametrize(
    ("value", "signal", "text"),
    [(1000.0, "p1", "0.01 bar"), (361.2, "v", "361000 mm/s"), (0.03, "x", "30 mm"), (4800.0, "u", "4800 V")],
)
def test_values_are_shown_as_people_write_them(value: float, signal: str, text: str) -> None:
    assert format_signal(value, signal) == text


def test_in_words_there_is_one_line_for_each_check_and_signal() -> None:
    found = [Finding("reference", "p2", name, "p2 rests at 0.01 bar", "write it", 9.0) for name in ("a", "b", "c")]
    told = implausibility_sentences([*found, Finding("silent", "p1", "a", "p1 stays", "check it", 4.0)])
    assert told == ["a and 2 more, p2 rests at 0.01 bar; write it", "a, p1 stays; check it"]
