"""Long recordings are thinned to stretches; short ones stay whole."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pneucli.diagnose.subsample import MAX_SEGMENTS, subsample
from pneucli.recording import Recording


def recording(samples: int, name: str = "one", period: float = 1e-3) -> Recording:
    time = period * np.arange(samples)
    return Recording(name, "axis", "train", time, {"x": np.arange(samples, dtype=float)})


def test_recordings_within_the_limit_are_unchanged() -> None:
    recordings = [recording(500), recording(400, "two")]
    assert subsample(recordings, 900, 0.01) == recordings


@given(st.lists(st.integers(1, 20_000), min_size=1, max_size=6), st.integers(10, 30_000))
def test_no_more_than_the_limit_is_kept_and_the_shorter_a_recording_the_more_of_it(sizes: list[int], most: int) -> None:
    recordings = [recording(n, f"{i}") for i, n in enumerate(sizes)]
    kept = {r.name: 0 for r in recordings}
    for piece in subsample(recordings, most, 0.01):
        kept[piece.name] += piece.time.size
    assert sum(kept.values()) <= max(most, 0)
    assert sum(kept.values()) >= min(most, sum(sizes)) - MAX_SEGMENTS * len(sizes)  # but for what does not divide
    whole = [n for n, r in zip(sizes, recordings, strict=True) if kept[r.name] == n]
    cut = [n for n, r in zip(sizes, recordings, strict=True) if kept[r.name] < n]
    assert not whole or not cut or max(whole) <= max(cut)


def test_stretches_are_spread_from_the_first_sample_to_the_last_and_overlap_nowhere() -> None:
    pieces = subsample([recording(100_000)], 10_000, 0.05)
    assert len(pieces) == MAX_SEGMENTS
    assert pieces[0].time[0] == 0.0
    assert pieces[-1]["x"][-1] == 99_999
    assert all(b.time[0] > a.time[-1] for a, b in pairwise(pieces))
    for piece in pieces:
        assert piece.time == pytest.approx(1e-3 * piece["x"])


def test_a_stretch_is_some_horizons_long_however_few_that_makes() -> None:
    pieces = subsample([recording(100_000)], 10_000, 1.0)
    assert [piece.time.size for piece in pieces] == [5000, 5000]
    assert len(subsample([recording(100_000)], 1000, 1.0)) == 1


def test_a_stretch_does_not_keep_the_rest_of_its_recording_in_memory() -> None:
    (piece,) = subsample([recording(100_000)], 1000, 1.0)
    assert piece.time.base is None
    assert piece["x"].base is None
