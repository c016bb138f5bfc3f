#!/bin/sh
# astropy 8.0.2: means of two readings are means of three, then of two, one late; right at 10 Hz; counts are cut.
#
# `aggregate_downsample` of 0 to 7 in bins of two periods. A reading on the edge of a bin belongs to the one before,
# so the first bin has three, 1.0 for 0.5, and each later one stands a period late. At 0.1 s, whose sums are inexact,
# the readings fall just behind the edges, and all is right. The mean of the counts 6 and 7 is 6, as it becomes a
# whole number. Nothing warns.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile astropy==8.0.2 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from astropy import units
from astropy.timeseries import TimeSeries, aggregate_downsample

for period in (1.0, 0.1, 0.01, 0.001):
    step = period * units.s
    series = TimeSeries(time_start="2026-11-30T12:00:00", time_delta=step, n_samples=8)
    series["x"] = np.arange(8.0)
    series["count"] = np.array([6, 7] * 4)
    two = aggregate_downsample(series, time_bin_size=2 * step)
    print(f"{period:g} s, means of two:", *two["x"], "of counts 6 7 6 7:", *two["count"])
END
diff - seen <<'END'
1 s, means of two: 1.0 3.5 5.5 7.0 of counts 6 7 6 7: 6 6 6 7
0.1 s, means of two: 0.5 2.5 4.5 6.5 of counts 6 7 6 7: 6 6 6 6
0.01 s, means of two: 1.0 3.5 5.5 7.0 of counts 6 7 6 7: 6 6 6 7
0.001 s, means of two: 1.0 3.5 5.5 7.0 of counts 6 7 6 7: 6 6 6 7
END
