#!/bin/sh
# numba 0.68.1: np.clip with a bound that is NaN does not clip at that side; NumPy 2.4.6 gives NaN everywhere.
#
# A limit that is unknown, as a saturation that a fit did not determine, poisons the result in NumPy, and so is seen.
# The same function compiled leaves the value as it is. Bounds as arrays, with NaN in one place, behave so as well.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile numba==0.68.1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from numba import njit


def clip(values, low, high):
    return np.clip(values, low, high)


values = np.array([-1.0, 0.5, 2.0])
unknown = float("nan")
mixed = np.array([0.0, unknown, 1.0])
for name, low, high in (("low is NaN", unknown, 1.0), ("high is NaN", 0.0, unknown), ("array", mixed, 2.0)):
    print(f"{name:11s} numpy", clip(values, low, high), "| numba", njit(clip)(values, low, high))
END
diff - seen <<'END'
low is NaN  numpy [nan nan nan] | numba [-1.   0.5  1. ]
high is NaN numpy [nan nan nan] | numba [0.  0.5 2. ]
array       numpy [ 0. nan  2.] | numba [0.  0.5 2. ]
END
