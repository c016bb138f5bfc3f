#!/bin/sh
# mcup 1.1.0: a line through readings at times good to 1 us is the guess that the fit began with, with the error bar of the right one.
#
# A pressure rises by 2 bar/s from 1 bar, readings good to 1 bar. `DemingRegressor` looks for the true times beside slope and level; where
# the stated error of the clock is small the search stops where it began, or on its way. Its standard errors come from another
# formula and are those of the best line, so that a slope of 1 is 1.00 +- 0.05. XYWeightedRegressor of the same package is right
# in each. Nothing warns, and no attribute tells. Begin it twice, from two guesses.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile mcup==1.1.0 numdifftools==0.11.2 numpy==2.4.6 scipy==1.17.1
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from mcup import DemingRegressor, XYWeightedRegressor

time = np.linspace(0, 10, 40)
noise = np.random.default_rng(0).standard_normal(40)
pressure = 1 + 2 * time + noise
for clock in (1e-2, 1e-6):
    for start in ([0.0, 1.0], [5.0, 3.0]):
        found = []
        for kind in (XYWeightedRegressor, DemingRegressor):
            fit = kind(lambda x, p: p[0] + p[1] * x, method="analytical")
            fit.fit(time, pressure, y_err=np.full(40, 1.0), x_err=np.full(40, clock), p0=start)
            found.append(f"{fit.params_[1]:.2f} +- {fit.params_std_[1]:.2f}")
        print(f"pressure +- 1 bar, clock +- {clock:g} s, begun at {start[1]:g} bar/s: XYWeighted {found[0]}, Deming {found[1]}")
END
diff - seen <<'END'
pressure +- 1 bar, clock +- 0.01 s, begun at 1 bar/s: XYWeighted 2.03 +- 0.05, Deming 2.03 +- 0.05
pressure +- 1 bar, clock +- 0.01 s, begun at 3 bar/s: XYWeighted 2.03 +- 0.05, Deming 2.03 +- 0.05
pressure +- 1 bar, clock +- 1e-06 s, begun at 1 bar/s: XYWeighted 2.03 +- 0.05, Deming 1.00 +- 0.05
pressure +- 1 bar, clock +- 1e-06 s, begun at 3 bar/s: XYWeighted 2.03 +- 0.05, Deming 3.00 +- 0.05
END
