#!/bin/sh
# casadi 3.8.2, SciPy 1.17.1: a valve map laid out as NumPy lays it out is shuffled, without an error.
#
# A flow over command (five values) and pressure (three). `interpolant` wants the first axis to run first, while
# `ravel()` of NumPy lets the last one run first. The number of values is the same, so nothing is refused: the open
# valve has -12.5 for 35, and at 0 V, where it is shut, 17.5. `ravel(order="F")` gives what SciPy finds.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile casadi==3.8.2 scipy==1.17.1 numpy==2.3.5
v/bin/python -W ignore - <<'END' | tee seen
import casadi
import numpy as np
from scipy.interpolate import RegularGridInterpolator

u = np.array([-5.0, -2.5, 0.0, 2.5, 5.0])
p = np.array([1.0, 3.0, 7.0])
flow = u[:, None] * (8.0 - p[None, :])  # rows of u, columns of p
scipy_map = RegularGridInterpolator((u, p), flow)
for order in ("C", "F"):
    for kind in ("linear", "bspline"):
        degree = {"degree": [1, 1]} if kind == "bspline" else {}
        casadi_map = casadi.interpolant("map", kind, [u, p], flow.ravel(order=order), degree)
        at = [(5.0, 1.0), (2.5, 3.0), (0.0, 5.0), (-5.0, 7.0)]
        print(f"ravel {order}, {kind}:", *(f"{float(casadi_map(one)):g}" for one in at))
print("SciPy:", *(f"{scipy_map(one).item():g}" for one in at))
END
diff - seen <<'END'
ravel C, linear: -12.5 0 17.5 12.5
ravel C, bspline: -12.5 0 17.5 12.5
ravel F, linear: 35 12.5 0 -5
ravel F, bspline: 35 12.5 0 -5
SciPy: 35 12.5 0 -5
END
