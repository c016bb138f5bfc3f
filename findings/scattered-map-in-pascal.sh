#!/bin/sh
# SciPy 1.17.1: a valve map from scattered points in volts and Pa is off by its range and more; in volts and bar by 2 %.
#
# Flow over voltage and supply pressure, 300 exact points without noise, read at 1000 others.
# `CloughTocher2DInterpolator`, `RBFInterpolator` and `NearestNDInterpolator` measure distances in the two inputs as
# they stand: 1 Pa counts as 1 V, so that neighbours are those of nearly the same pressure, whatever their voltage. In
# Pa the smooth one is off by 20 where the flow is within 2.5, the radial one and the nearest by 5; in bar by 0.07, 0.04
# and 0.3. Nothing warns. Scale both inputs to about 1, or state `rescale=True` where there is one.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile scipy==1.17.1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from scipy.interpolate import CloughTocher2DInterpolator, LinearNDInterpolator, NearestNDInterpolator, RBFInterpolator

rng = np.random.default_rng(0)


def points(count):
    return np.c_[rng.uniform(-5, 5, count), rng.uniform(1e5, 7e5, count)]


def flow(at):
    return np.tanh(at[:, 0] / 3) * np.sqrt(at[:, 1] / 1e5)


def off(found):
    return float(f"{np.nanmax(np.abs(found - flow(asked))):.1g}")


measured, asked = points(300), points(1000)
print(f"flow from {flow(asked).min():.1f} to {flow(asked).max():.1f}")
for unit, scale in (("Pa", 1), ("bar", 1e-5)):
    for make in (CloughTocher2DInterpolator, RBFInterpolator, NearestNDInterpolator, LinearNDInterpolator):
        found = make(measured * [1, scale], flow(measured))(asked * [1, scale])
        print(f"volts and {unit}, {make.__name__}: off by {off(found):g}")
found = CloughTocher2DInterpolator(measured, flow(measured), rescale=True)(asked)
print(f"volts and Pa, rescale=True: off by {off(found):g}")
END
diff - seen <<'END'
flow from -2.5 to 2.4
volts and Pa, CloughTocher2DInterpolator: off by 20
volts and Pa, RBFInterpolator: off by 5
volts and Pa, NearestNDInterpolator: off by 5
volts and Pa, LinearNDInterpolator: off by 0.6
volts and bar, CloughTocher2DInterpolator: off by 0.07
volts and bar, RBFInterpolator: off by 0.04
volts and bar, NearestNDInterpolator: off by 0.3
volts and bar, LinearNDInterpolator: off by 0.3
volts and Pa, rescale=True: off by 0.07
END
