"""Return freed memory to the system, which the allocators would keep."""

from __future__ import annotations

import ctypes
import sys

import pyarrow as pa


def release_free_memory() -> None:
    """Return the freed memory of Arrow and, where it can, of the C library to the system."""
    pa.default_memory_pool().release_unused()
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # glibc's
        if trim is not None:
            trim(0)
