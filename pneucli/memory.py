"""Give memory back to the system: what the allocators keep, and arrays that wait in a file."""

import ctypes
import mmap
import sys
import tempfile
from weakref import WeakSet

import numpy as np
import pyarrow as pa

from pneucli.arrays import Array

MIN_FILED_BYTES = 4 << 20  # a smaller array stays in memory: many of them still are few megabytes

_mappings: WeakSet[mmap.mmap] = WeakSet()  # of all filed arrays that are in use


def release_free_memory() -> None:
    """Return the freed memory of Arrow and, where it can, of the C library to the system."""
    pa.default_memory_pool().release_unused()
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # glibc's
        if trim is not None:
            trim(0)


def filed(array: Array) -> Array:
    """Move an array to a temporary file that is mapped into memory: what is not read takes none.

    The system brings pages back where they are read; :func:`release_filed` lets them go again. The file goes with the
    last array that uses it.

    Args:
        array: The array, shape (N, k).

    Returns:
        The same numbers, read-only and column after column; the array itself where it is small or no file can be
        written.

    >>> filed(np.zeros((1 << 18, 4))).any()
    np.False_
    """
    if array.nbytes < MIN_FILED_BYTES:
        return array
    try:
        with tempfile.TemporaryFile(prefix="pneucli-") as file:
            for column in array.T:
                file.write(np.ascontiguousarray(column).data)
            file.flush()
            mapping = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except OSError:  # a full disk: it takes memory then
        return array
    _mappings.add(mapping)
    return np.frombuffer(mapping, dtype=array.dtype).reshape(array.shape[::-1]).T


def release_filed() -> None:
    """Let go of the pages of all filed arrays, where the system can."""
    if hasattr(mmap, "MADV_DONTNEED"):
        for mapping in list(_mappings):
            mapping.madvise(mmap.MADV_DONTNEED)
