#!/bin/sh
# pykalman 0.11.2: noise that `em` learns from a pressure in Pa is 30000 times too large, and the first smoothed value is 3.7 bar.
#
# A pressure that wanders about 6 bar by 50 Pa a sample (variance 2500), read with 200 Pa of noise (40000), 300 readings.
# `KalmanFilter([1], [1]).em(y)` starts from a state of 0 and a variance of 1, and explains the way from 0 to 6 bar by
# noise: after its ten iterations the variances are 1.7e8 and 3.5e8, and the smoothed pressure begins at 3.7 bar, where
# 6.0 was read. With 6 bar subtracted first, or stated as `initial_state_mean`, they are 6211 and 38083. Nothing tells so,
# and 100 iterations end at the same. An error bar or a gain from it says that the model knows nothing. Subtract the first
# reading.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile pykalman==0.11.2 numpy==2.4.6 scipy==1.17.1
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from pykalman import KalmanFilter

rng = np.random.default_rng(0)
pressure = 6e5 + np.cumsum(rng.normal(0, 50, 300)) + rng.normal(0, 200, 300)


def show(what, readings, iterations=10, **start):
    found = KalmanFilter(transition_matrices=[1], observation_matrices=[1], **start).em(readings, n_iter=iterations)
    first = found.smooth(readings)[0][0, 0]
    print(f"{what:24s} variances {found.transition_covariance.item():.2g} and {found.observation_covariance.item():.2g},"
          f" first reading {readings[0]:.4g}, smoothed {first:.4g}")  # fmt: skip


show("as it is", pressure)
show("as it is, 100 iterations", pressure, 100)
show("start stated", pressure, initial_state_mean=[6e5])
show("6 bar subtracted", pressure - 6e5)
END
diff - seen <<'END'
as it is                 variances 1.7e+08 and 3.5e+08, first reading 6.002e+05, smoothed 3.709e+05
as it is, 100 iterations variances 1.8e+08 and 3.5e+08, first reading 6.002e+05, smoothed 3.709e+05
start stated             variances 6.2e+03 and 3.8e+04, first reading 6.002e+05, smoothed 6.001e+05
6 bar subtracted         variances 6.2e+03 and 3.8e+04, first reading 246.9, smoothed 106.3
END
