"""Memory that was freed goes back to the system."""

import sys
from pathlib import Path

import numpy as np
import pytest

from pneucli.memory import release_free_memory


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
