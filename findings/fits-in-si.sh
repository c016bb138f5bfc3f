#!/bin/sh
# SciPy 1.17.1, lmfit 1.3.4: a valve's flows in SI units, and a minimiser that reports success with no conductance at all.
#
# Thirty flows of a valve (kg/s) after ISO 6358: conductance C of 1e-8 m3/(s Pa), critical ratio b = 0.35, noise of 0.02 g/s; each
# fit begins at 3 C and b = 0.5. `least_squares` and lmfit's default are right. The same sum of squares given to `minimize` with
# bounds has "converged" at C = 0 after one iteration: the first step is as long as the slope says, which is
# huge in C, and at C = 0 every slope is below an absolute limit. lmfit's "nelder" has success with b at its start,
# and C 3 % off. In litres, bar and seconds all are right.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile scipy==1.17.1 lmfit==1.3.4 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import lmfit
import numpy as np
from scipy.optimize import least_squares, minimize

ratio = np.tile([0.9, 0.7, 0.5, 0.3, 0.1], 6)
supply = np.linspace(2e5, 8e5, 30)
noise = 2e-5 * np.sin(np.arange(30) * 2.3) * np.sqrt(2)


def flow(c, b):
    return c * 1.185 * supply * np.where(ratio < b, 1, np.sqrt(np.clip(1 - ((ratio - b) / (1 - b)) ** 2, 0, None)))


def show(what, c, b, success, unit):
    print(f"  {what:24s} C {c * unit * 1e8:.2f}e-8, b {b:.2f}, success {bool(success)}")


for title, unit, factor in (("SI: m3/(s Pa), kg/s", 1, 1), ("litres: dm3/(s bar), g/s", 1e-8, 1e3)):
    print(title)
    measured = factor * (flow(1e-8, 0.35) + noise)

    def misfit(point, unit=unit, factor=factor, measured=measured):
        return factor * flow(point[0] * unit, point[1]) - measured

    start, bounds = [3e-8 / unit, 0.5], [(0, 1e-6 / unit), (0, 0.99)]
    found = least_squares(misfit, start)
    show("SciPy, least_squares", *found.x, found.success, unit)
    for name, keys in (("L-BFGS-B", {"bounds": bounds}), ("Nelder-Mead", {"method": "Nelder-Mead"})):
        found = minimize(lambda point: np.sum(misfit(point) ** 2), start, **keys)
        show(f"SciPy, {name}", *found.x, found.success, unit)
    for method in ("leastsq", "nelder"):
        parameters = lmfit.create_params(c={"value": start[0], "min": 0, "max": 1e-6 / unit}, b={"value": 0.5, "min": 0, "max": 0.99})
        found = lmfit.minimize(lambda p: misfit([p["c"].value, p["b"].value]), parameters, method=method)
        show(f"lmfit, {method}", found.params["c"].value, found.params["b"].value, found.success, unit)
END
diff - seen <<'END'
SI: m3/(s Pa), kg/s
  SciPy, least_squares     C 1.00e-8, b 0.35, success True
  SciPy, L-BFGS-B          C 0.00e-8, b 0.50, success True
  SciPy, Nelder-Mead       C 1.00e-8, b 0.35, success True
  lmfit, leastsq           C 1.00e-8, b 0.35, success True
  lmfit, nelder            C 0.97e-8, b 0.50, success True
litres: dm3/(s bar), g/s
  SciPy, least_squares     C 1.00e-8, b 0.35, success True
  SciPy, L-BFGS-B          C 1.00e-8, b 0.35, success True
  SciPy, Nelder-Mead       C 1.00e-8, b 0.35, success True
  lmfit, leastsq           C 1.00e-8, b 0.35, success True
  lmfit, nelder            C 1.00e-8, b 0.35, success True
END
