"""Memory that was freed goes back to the system: the allocators keep it otherwise, beside all that comes next."""

from __future__ import annotations

import ctypes
import sys

import pyarrow as pa


def release_free_memory() -> None:
    """Return what Arrow and the C library hold of freed memory; where the C library cannot, what Arrow holds."""
    pa.default_memory_pool().release_unused()
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # glibc's
        if trim is not None:
            trim(0)
