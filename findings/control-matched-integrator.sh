#!/bin/sh
# control 0.10.2: a cylinder sampled by "matched" is NaN, as is a velocity taken from its position.
#
# `c2d(..., "matched")` places poles and zeros, then makes the gains at standstill equal. A position's is infinite,
# and that of a velocity from a position is 0, so each coefficient of the numerator is NaN. A warning of a division is
# all that is said; what is computed with the plant is NaN as well. A lag is right; so are "zoh" and "tustin".
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile control==0.10.2 scipy==1.17.1 numpy==2.3.5 matplotlib==3.11.2
v/bin/python -W ignore - <<'END' | tee seen
import warnings

import control
import numpy as np

s = control.tf("s")
plants = {"lag": 2 / (s + 1), "position": 2 / (s * (s + 1)), "velocity from position": 2 * s / (s + 1)}
with warnings.catch_warnings(record=True) as seen:
    warnings.simplefilter("always")
    for what, plant in plants.items():
        for method in ("zoh", "tustin", "matched"):
            sampled = control.c2d(plant, 0.01, method)
            gain = abs(sampled(np.exp(0.01j)))
            print(f"{what}, {method}: gain at 1 rad/s {gain:.3f}, is {abs(plant(1j)):.3f}")
print("warned:", [one.category.__name__ for one in seen if "control" in one.filename] or "nothing")
END
diff - seen <<'END'
lag, zoh: gain at 1 rad/s 1.414, is 1.414
lag, tustin: gain at 1 rad/s 1.414, is 1.414
lag, matched: gain at 1 rad/s 1.414, is 1.414
position, zoh: gain at 1 rad/s 1.414, is 1.414
position, tustin: gain at 1 rad/s 1.414, is 1.414
position, matched: gain at 1 rad/s nan, is 1.414
velocity from position, zoh: gain at 1 rad/s 1.421, is 1.414
velocity from position, tustin: gain at 1 rad/s 1.414, is 1.414
velocity from position, matched: gain at 1 rad/s nan, is 1.414
warned: ['RuntimeWarning', 'RuntimeWarning', 'RuntimeWarning']
END
