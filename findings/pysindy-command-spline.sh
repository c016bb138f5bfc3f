#!/bin/sh
# pysindy 2.1.0: a logged command is a spline in `simulate`, so the axis moves, and moves back, before it is told to.
#
# A lag of 1 s, found exactly, and a command at 10 Hz that steps by 5 V at 1.0 s. `simulate` draws a cubic through its
# samples: it swings about 0 before the step, and rises over the sample before it, so the answer goes to -0.03, then
# leads by half a sample. `interpolator_kws` with kind "previous" changes nothing, as it counts only where
# `interpolator` is stated too; with both the answer is right. The last sample is left out.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile pysindy==2.1.0 scipy==1.17.1 numpy==2.4.6 scikit-learn==1.9.1
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
import pysindy
from scipy.interpolate import interp1d

fine = np.arange(0, 4, 0.01)
u = np.where(fine < 1, 0.0, 5.0)
x = np.where(fine < 1, 0.0, 5.0 * (1 - np.exp(-(fine - 1))))
model = pysindy.SINDy(feature_library=pysindy.PolynomialLibrary(1))
model.fit(x[:, None], t=fine, x_dot=(u - x)[:, None], u=u[:, None])
model.print()
t = np.arange(0, 4, 0.1)
u = np.where(t < 0.95, 0.0, 5.0)
exact = np.where(t < 0.95, 0.0, 5.0 * (1 - np.exp(-(t - 1))))
kind = {"interpolator_kws": {"kind": "previous", "axis": 0, "fill_value": "extrapolate"}}
solver = {"max_step": 0.01, "method": "LSODA", "rtol": 1e-8, "atol": 1e-8}
print("s:                ", *(f"{one:6.1f}" for one in t[7:13]))
print("exact:            ", *(f"{one:6.2f}" for one in exact[7:13]))
for what, keys in (("default", {}), ("keywords alone", kind), ("with interpolator", {**kind, "interpolator": interp1d})):
    found = model.simulate(np.array([0.0]), t, u=u[:, None], integrator_kws=solver, **keys)
    print(f"{what:18s}", *(f"{round(one, 2) + 0.0:6.2f}" for one in found[7:13, 0]), f" samples: {len(found)} of {len(t)}")
END
diff - seen <<'END'
(x0)' = -1.000 x0 +  1.000 u0
s:                    0.7    0.8    0.9    1.0    1.1    1.2
exact:               0.00   0.00   0.00   0.00   0.48   0.91
default              0.00   0.01  -0.03   0.22   0.71   1.11  samples: 39 of 40
keywords alone       0.00   0.01  -0.03   0.22   0.71   1.11  samples: 39 of 40
with interpolator    0.00   0.00   0.00   0.00   0.48   0.91  samples: 39 of 40
END
