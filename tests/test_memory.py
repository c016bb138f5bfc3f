"""Memory goes back to the system: what was freed, and arrays that wait in a file."""

import sys
from pathlib import Path

import numpy as np
import pytest

from pneucli import memory
from pneucli.memory import MIN_FILED_BYTES, filed, release_filed, release_free_memory


def resident() -> int:
    """Return the bytes that this process holds in memory."""
    return int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1]) * 4096


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux says what a process holds")
def test_freed_memory_below_used_memory_is_returned() -> None:
    held = [np.ones(8 << 10) for _ in range(2000)]  # 64 kB each: too small to have pages of their own
    last, before = held.pop(), resident()
    held.clear()
    release_free_memory()
    assert before - resident() > 100e6
    assert last.size == 8 << 10


def derivatives(rows: int = MIN_FILED_BYTES // 32) -> np.ndarray:
    """The upper rows of four columns, as a fit has them above the rows of its priors."""
    return np.asfortranarray(np.random.default_rng(1).standard_normal((rows + 5, 4)))[:rows]


def test_a_filed_array_has_the_same_numbers_before_and_after_its_pages_are_let_go() -> None:
    array = derivatives()
    found = filed(array)
    assert not np.shares_memory(found, array)
    assert found.strides == array[:].copy(order="F").strides
    for _ in range(2):
        assert np.array_equal(found, array)
        release_filed()
    with pytest.raises(ValueError, match="read-only"):
        found[0, 0] = 1.0


def test_a_small_array_stays_in_memory() -> None:
    array = derivatives(100)
    assert filed(array) is array


def test_without_a_place_for_the_file_the_array_stays_in_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(**_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("tempfile.TemporaryFile", full)
    array = derivatives()
    assert filed(array) is array


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux says what a process holds")
def test_a_filed_array_takes_no_memory_until_it_is_read() -> None:
    array = derivatives(1 << 21)  # 64 MB
    before = resident()
    found = filed(array)
    assert resident() - before < 10e6
    assert np.isfinite(found.sum())
    assert resident() - before > 60e6
    release_filed()
    assert resident() - before < 10e6


def test_the_file_of_an_array_goes_with_it() -> None:
    found = filed(derivatives())
    assert len(memory._mappings) == 1
    del found
    assert not memory._mappings
