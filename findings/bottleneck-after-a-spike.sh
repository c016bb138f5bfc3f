#!/bin/sh
# Bottleneck 1.6.0 and SciPy 1.17.1: after one fill value in a recording its moving mean is 0 to the end.
#
# A pressure of 6 bar, and one missing reading that stands as 9.97e36, netCDF's fill value. `bottleneck.move_mean` and
# `scipy.ndimage.uniform_filter1d` keep a running sum: the big number eats the digits of the sum, and takes with it,
# when it leaves the window, all that was there. A thousand readings later the mean of ten is 0 Pa. After an infinity,
# or in SciPy after one NaN, all that follows is NaN. Nothing warns. pandas and polars are right again ten readings
# later. Name the fill value before any smoothing.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile bottleneck==1.6.0 numpy==2.4.6 scipy==1.17.1 pandas==3.1.1 polars==2.1.0
v/bin/python -W ignore - <<'END' | tee seen
import bottleneck
import numpy as np
import pandas as pd
import polars as pl
from scipy.ndimage import uniform_filter1d

ways = {
    "bottleneck": lambda p: bottleneck.move_mean(p, 10),
    "SciPy": lambda p: uniform_filter1d(p, 10),
    "pandas": lambda p: pd.Series(p).rolling(10).mean().to_numpy(),
    "polars": lambda p: pl.Series(p).rolling_mean(10).to_numpy(),
}
for what, bad in (("fill value", 9.96921e36), ("infinity", np.inf), ("NaN", np.nan), ("1e16", 1e16)):
    pressure = np.full(2100, 6e5)
    pressure[1000] = bad
    for name, mean in ways.items():
        found = mean(pressure)
        print(f"{what:10s} at 1000, {name:10s}: mean at 900 {found[900]:.0f}, at 1020 {found[1020]:.0f}, at 2000 {found[2000]:.0f}")
END
diff - seen <<'END'
fill value at 1000, bottleneck: mean at 900 600000, at 1020 0, at 2000 0
fill value at 1000, SciPy     : mean at 900 600000, at 1020 0, at 2000 0
fill value at 1000, pandas    : mean at 900 600000, at 1020 600000, at 2000 600000
fill value at 1000, polars    : mean at 900 600000, at 1020 600000, at 2000 600000
infinity   at 1000, bottleneck: mean at 900 600000, at 1020 nan, at 2000 nan
infinity   at 1000, SciPy     : mean at 900 600000, at 1020 nan, at 2000 nan
infinity   at 1000, pandas    : mean at 900 600000, at 1020 600000, at 2000 600000
infinity   at 1000, polars    : mean at 900 600000, at 1020 600000, at 2000 600000
NaN        at 1000, bottleneck: mean at 900 600000, at 1020 600000, at 2000 600000
NaN        at 1000, SciPy     : mean at 900 600000, at 1020 nan, at 2000 nan
NaN        at 1000, pandas    : mean at 900 600000, at 1020 600000, at 2000 600000
NaN        at 1000, polars    : mean at 900 600000, at 1020 600000, at 2000 600000
1e16       at 1000, bottleneck: mean at 900 600000, at 1020 600000, at 2000 600000
1e16       at 1000, SciPy     : mean at 900 600000, at 1020 600000, at 2000 600000
1e16       at 1000, pandas    : mean at 900 600000, at 1020 600000, at 2000 600000
1e16       at 1000, polars    : mean at 900 600000, at 1020 600000, at 2000 600000
END
