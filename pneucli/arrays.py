"""Arrays of numbers, as annotations name them and as compiled code takes them."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Indices = NDArray[np.intp]
Integers = NDArray[np.int64]


def read_only(values: Array) -> Array:
    """Return values (n,) of any unit as an array that cannot be written: a kernel is compiled anew for one that can.

    Those of a file cannot, those of a calculation can; the kernel writes to neither.
    """
    view = np.ascontiguousarray(values).view()
    view.flags.writeable = False
    return view
