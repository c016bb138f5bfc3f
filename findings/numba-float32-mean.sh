#!/bin/sh
# numba 0.68.1: np.mean and np.std of float32 go wrong with length; np.nanmean and np.nanstd of the same array do not.
#
# A million samples of a pressure near 600 kPa with a standard deviation of 707 Pa, stored as float32. Compiled,
# np.mean is 4.4 kPa low and np.std six times too large: both add in float32 from the first sample to the last.
# np.nanmean and np.nanstd add in float64, and NumPy 2.4.6 adds float32 in pairs: both are right.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile numba==0.68.1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from numba import njit

exact = 6e5 + 1e3 * np.sin(np.arange(1_000_000) * 0.01)
stored = exact.astype(np.float32)
functions = {
    "mean": lambda values: np.mean(values),
    "nanmean": lambda values: np.nanmean(values),
    "std": lambda values: np.std(values),
    "nanstd": lambda values: np.nanstd(values),
}
for name, function in functions.items():
    print(f"{name:7s} exact {function(exact):.0f} numpy {function(stored):.0f} numba {njit(function)(stored):.0f}")
END
diff - seen <<'END'
mean    exact 600000 numpy 600000 numba 595642
nanmean exact 600000 numpy 600000 numba 600000
std     exact 707 numpy 707 numba 4416
nanstd  exact 707 numpy 707 numba 707
END
