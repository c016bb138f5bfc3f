#!/bin/sh
# numba 0.68.1: round() to digits and np.histogram with a range decide cases at the edge otherwise than Python and NumPy.
#
# round(0.35, 1) is 0.3 in Python, which rounds the exact binary value, and 0.4 compiled, which multiplies by ten first;
# round(2.675, 2) is 2.67 and 2.68. The stamps 0.1 to 0.9 fall into ten bins of 0 to 1, one each, when compiled; NumPy
# 2.4.6 compares with edges that are rounded themselves, and leaves two bins empty and fills two twice.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile numba==0.68.1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from numba import njit


def rounded(value, digits):
    return round(value, digits)


def counts(values):
    return np.histogram(values, 10, (0.0, 1.0))[0]


for value, digits in ((0.25, 1), (0.35, 1), (0.15, 1), (2.675, 2)):
    print(f"round({value}, {digits})", rounded(value, digits), njit(rounded)(value, digits))
stamps = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9])
print("numpy", counts(stamps))
print("numba", njit(counts)(stamps))
END
diff - seen <<'END'
round(0.25, 1) 0.2 0.2
round(0.35, 1) 0.3 0.4
round(0.15, 1) 0.1 0.2
round(2.675, 2) 2.67 2.68
numpy [0 1 2 0 1 2 1 0 1 1]
numba [0 1 1 1 1 1 1 1 1 1]
END
