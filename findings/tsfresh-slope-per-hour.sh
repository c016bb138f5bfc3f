#!/bin/sh
# tsfresh 0.21.2: a leak is stated per hour or per row, never per second.
#
# A pressure that falls by 0.05 bar/s. `linear_trend_timewise`, which needs stamps, says -180: per hour.
# `linear_trend` says -0.005 at 10 Hz and -0.0005 at 100 Hz: per row. Neither name of the feature says so; divide the
# first by 3600.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile tsfresh==0.21.2 pandas==3.1.1 numpy==2.3.5 scipy==1.17.1
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
import pandas as pd
from tsfresh.feature_extraction import feature_calculators as features

for rate in (10, 100):
    t = np.arange(20 * rate) / rate
    clock = pd.Timestamp("2026-11-30 12:00") + pd.to_timedelta(t, unit="s")
    pressure = pd.Series(6.0 - 0.05 * t, index=clock)
    for function in (features.linear_trend_timewise, features.linear_trend):
        [(_, slope)] = function(pressure, [{"attr": "slope"}])
        print(f"{rate} Hz, -0.05 bar/s, {function.__name__}: {float(slope):.4g}")
END
diff - seen <<'END'
10 Hz, -0.05 bar/s, linear_trend_timewise: -180
10 Hz, -0.05 bar/s, linear_trend: -0.005
100 Hz, -0.05 bar/s, linear_trend_timewise: -180
100 Hz, -0.05 bar/s, linear_trend: -0.0005
END
