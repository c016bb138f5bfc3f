#!/bin/sh
# numdifftools 0.11.2, derivkit 1.4.0: the slope of a friction that turns within 0.1 mm/s is 0 at rest, or near it.
#
# A friction in SI units, tanh(v / 1e-4): at rest its slope is 1e4. `Derivative` of numdifftools gives exactly 0, and
# an error estimate of 17, as its steps begin at 0.5, beyond the bend; from 1 mm/s on it is right. derivkit is right or
# far below by method, and warns of none. The slope of a logarithm at the C of a valve, 5e-9, is NaN in both, though an
# exact one exists. SciPy is wrong below 1 mm/s too, but says `success=False`; fdm finds the step itself. Scale the
# variable to about 1, or state the step.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile numdifftools==0.11.2 derivkit==1.4.0 fdm==0.5.0 scipy==1.17.1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import fdm
import numdifftools
import numpy as np
from derivkit import DerivativeKit
from scipy.differentiate import derivative

for width in (1e-1, 1e-2, 1e-3, 1e-4):

    def friction(v):
        return np.tanh(np.asarray(v) / width)

    slope, error, *_ = numdifftools.Derivative(friction, full_output=True)(0.0)
    found = derivative(friction, 0.0)
    print(f"width {width:g} m/s, slope as a share of the right one:")
    print(f"  numdifftools {slope * width:.3g}, its error {error * width:.1g};", end=" ")
    print(f"SciPy {found.df * width:.3g}, success {bool(found.success)};", end=" ")
    print(f"fdm {fdm.central_fdm(order=5, deriv=1)(friction, 0.0) * width:.3g}")
    kit = DerivativeKit(friction, 0.0)
    shares = (f"{name} {float(kit.differentiate(method=name, order=1)) * width:.2g}" for name in ("adaptive", "finite"))
    print("  derivkit:", ", ".join(shares))
conductance = 5e-9
print("log at 5e-9:", "numdifftools", numdifftools.Derivative(np.log)(conductance), end=", ")
print("derivkit", DerivativeKit(np.log, conductance).differentiate(method="adaptive", order=1))
END
diff - seen <<'END'
width 0.1 m/s, slope as a share of the right one:
  numdifftools 1, its error 5e-14; SciPy 1, success True; fdm 1
  derivkit: adaptive 1, finite 1
width 0.01 m/s, slope as a share of the right one:
  numdifftools 1, its error 5e-08; SciPy 1, success True; fdm 1
  derivkit: adaptive 1, finite 0.85
width 0.001 m/s, slope as a share of the right one:
  numdifftools 1, its error 0.01; SciPy 1, success False; fdm 1
  derivkit: adaptive 0.97, finite 0.12
width 0.0001 m/s, slope as a share of the right one:
  numdifftools 0, its error 0.002; SciPy 0.809, success False; fdm 1
  derivkit: adaptive 0.25, finite 0.012
log at 5e-9: numdifftools nan, derivkit nan
END
