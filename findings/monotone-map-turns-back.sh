#!/bin/sh
# SciPy 1.17.1: a monotone interpolant of a valve map turns back beyond its last voltage, and at 10 V its flow is negative.
#
# `PchipInterpolator` keeps a map monotone between its points. Beyond them it goes on with the last cubic, without a
# word: a map to 5 V with a flow of 10 gives 9.9 at 5.5 V, 8.3 at 7 V and -3.5 at 10 V, so that a controller that asks
# for more gets less. `CubicSpline` says 118. `Akima1DInterpolator` gives NaN, and with `extrapolate=True` -15; the
# linear `interp1d` raises, `RectBivariateSpline` holds, and a `RegularGridInterpolator` raises, or goes straight on.
# State `extrapolate=False`, and hold the edge by `numpy.clip` of the voltage.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile scipy==1.17.1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from scipy import interpolate

volts = np.array([-5, -3, -1, -0.3, 0.3, 1, 3, 5])
flow = np.array([-10, -9, -4, 0, 0, 4, 9, 10.0])
pressure = np.arange(1.0, 8.0)
grid = np.repeat(flow[:, None], pressure.size, axis=1)


def on_grid(u, **options):
    return interpolate.RegularGridInterpolator((volts, pressure), grid, **options)([u, 6.0])[0]


maps = {
    "PchipInterpolator": interpolate.PchipInterpolator(volts, flow),
    "CubicSpline": interpolate.CubicSpline(volts, flow),
    "Akima1DInterpolator": interpolate.Akima1DInterpolator(volts, flow),
    "Akima1DInterpolator, extrapolate": interpolate.Akima1DInterpolator(volts, flow, extrapolate=True),
    "RectBivariateSpline": lambda u: interpolate.RectBivariateSpline(volts, pressure, grid)(u, 6.0)[0, 0],
    "interp1d": interpolate.interp1d(volts, flow),
    "RegularGridInterpolator": on_grid,
    "RegularGridInterpolator, no bounds": lambda u: on_grid(u, bounds_error=False, fill_value=None),
}
for name, valve in maps.items():
    found = []
    for u in (5, 5.5, 7, 10):
        try:
            found.append(f"{float(valve(u)):.1f}")
        except ValueError:
            found.append("raises")
    print(f"{name}, 5, 5.5, 7, 10 V:", *found)
inside = np.diff(maps["PchipInterpolator"](np.linspace(-5, 5, 1001)))
print("PchipInterpolator falls within its map:", bool((inside < 0).any()))
END
diff - seen <<'END'
PchipInterpolator, 5, 5.5, 7, 10 V: 10.0 9.9 8.3 -3.5
CubicSpline, 5, 5.5, 7, 10 V: 10.0 11.8 25.7 117.9
Akima1DInterpolator, 5, 5.5, 7, 10 V: 10.0 nan nan nan
Akima1DInterpolator, extrapolate, 5, 5.5, 7, 10 V: 10.0 9.6 6.1 -15.2
RectBivariateSpline, 5, 5.5, 7, 10 V: 10.0 10.0 10.0 10.0
interp1d, 5, 5.5, 7, 10 V: 10.0 raises raises raises
RegularGridInterpolator, 5, 5.5, 7, 10 V: 10.0 raises raises raises
RegularGridInterpolator, no bounds, 5, 5.5, 7, 10 V: 10.0 10.2 11.0 12.5
PchipInterpolator falls within its map: False
END
