#!/bin/sh
# hampel 1.0.2: spikes near the ends and beside a missing reading stay, and what comes back has 24 bits.
#
# Four spikes in a pressure of 6 bar in Pa, windows of 7 samples. Those at the second sample and at the second last are
# not found, as half a window at each end is copied; the one beside a missing reading is not found, as a window with NaN
# in it finds nothing. Only the one in the middle is replaced. The result of float64 readings is float32: 600000.01 Pa is
# 600000.0, and a time of day in seconds would be off by 4 ms. Its help states none of this. Pad the ends, fill gaps
# first, and take only the places from it.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile hampel==1.0.2 pandas==3.1.1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
import pandas as pd
from hampel import hampel

rng = np.random.default_rng(0)
clean = pd.Series(600000.01 + 20 * rng.standard_normal(100))
spikes = [1, 40, 70, 98]
pressure = clean.copy()
pressure[spikes] = 9e5
pressure[38] = np.nan
found = hampel(pressure, window_size=7, n_sigma=3.0)
print("spikes at", spikes, "- found", [int(place) for place in found.outlier_indices if place in spikes])
print("in:", pressure.dtype, " out:", found.filtered_data.dtype)
print(f"a reading of {600000.01} Pa comes back as {float(hampel(pd.Series(np.full(20, 600000.01))).filtered_data[10])}")
END
diff - seen <<'END'
spikes at [1, 40, 70, 98] - found [70]
in: float64  out: float32
a reading of 600000.01 Pa comes back as 600000.0
END
