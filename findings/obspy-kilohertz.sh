#!/bin/sh
# ObsPy 1.5.1: a recording at 3 kHz has 3003 Hz after SEG-Y, SU or SAC; the first two lose its start's fraction too.
#
# The period is written in whole microseconds in SEG-Y and SU, without a warning: 333 for a third of a millisecond, 83
# for 12 kHz, so that 2 s come back as 1.998 s. SAC keeps the period, but its reader rounds to microseconds unless
# `round_sampling_interval=False` is stated, and warns of that. A start at 0.123456 s is 0 in SEG-Y and SU, which have
# whole seconds. A WAV has 7000 Hz whatever the rate was, and cuts readings to whole numbers. MiniSEED is right. Write
# MiniSEED, or take `row / rate` with the rate of the logger.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile obspy==1.5.1 numpy==2.4.6 setuptools==80.9.0
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from obspy import Stream, Trace, UTCDateTime, read

start = UTCDateTime(2026, 1, 1, 0, 0, 0, 123456)
for rate in (1000, 3000, 12000):
    for kind in ("SEGY", "SU", "SAC", "WAV", "MSEED"):
        values = 6e5 + np.arange(2 * rate + 1) * 0.3
        readings = values.astype("f4" if kind in ("SEGY", "SU") else "f8")
        trace = Trace(readings, {"sampling_rate": rate, "starttime": start})
        Stream([trace]).write("log", format=kind)
        found = read("log", format=kind)[0]
        lost = np.abs(found.data - values).max()
        begun = f", begins at {found.stats.starttime.microsecond / 1e6} s" if kind in ("SEGY", "SU") else ""
        print(f"{rate} Hz, {kind}: {found.stats.sampling_rate:.6g} Hz, 2 s are", end=" ")
        print(f"{found.stats.endtime - found.stats.starttime:.6g} s{begun}, readings off by {lost:.1g}")
END
diff - seen <<'END'
1000 Hz, SEGY: 1000 Hz, 2 s are 2 s, begins at 0.0 s, readings off by 0.03
1000 Hz, SU: 1000 Hz, 2 s are 2 s, begins at 0.0 s, readings off by 0.03
1000 Hz, SAC: 1000 Hz, 2 s are 2 s, readings off by 0.03
1000 Hz, WAV: 7000 Hz, 2 s are 0.285714 s, readings off by 0.9
1000 Hz, MSEED: 1000 Hz, 2 s are 2 s, readings off by 0
3000 Hz, SEGY: 3003 Hz, 2 s are 1.998 s, begins at 0.0 s, readings off by 0.03
3000 Hz, SU: 3003 Hz, 2 s are 1.998 s, begins at 0.0 s, readings off by 0.03
3000 Hz, SAC: 3003 Hz, 2 s are 1.998 s, readings off by 0.03
3000 Hz, WAV: 7000 Hz, 2 s are 0.857143 s, readings off by 0.9
3000 Hz, MSEED: 3000 Hz, 2 s are 2 s, readings off by 0
12000 Hz, SEGY: 12048.2 Hz, 2 s are 1.992 s, begins at 0.0 s, readings off by 0.03
12000 Hz, SU: 12048.2 Hz, 2 s are 1.992 s, begins at 0.0 s, readings off by 0.03
12000 Hz, SAC: 12048.2 Hz, 2 s are 1.992 s, readings off by 0.03
12000 Hz, WAV: 7000 Hz, 2 s are 3.42857 s, readings off by 0.9
12000 Hz, MSEED: 12000 Hz, 2 s are 2 s, readings off by 0
END
