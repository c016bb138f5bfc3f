#!/bin/sh
# ObsPy 1.5.1: `resample` damps what lies far below the new limit, and bends a pressure at both ends.
#
# `resample` multiplies the spectrum by a Hann window that is named in its defaults, so that a sine of 10 Hz loses 10 % and one
# of 20 Hz a third when 100 Hz become 50 Hz, and as much when 100 Hz become 200 Hz. A ramp from 6 to 7 bar begins at 6.3 bar, as
# the transform joins its end to its beginning. Without the window the sine is right; `interpolate` gives both. `decimate`
# halves the rate with a causal filter that starts at zero: a sine of 10 Hz is 48 ms late, and the ramp begins at 0.01 bar.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile obspy==1.5.1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from obspy import Trace

COUNT, RATE = 2000, 100


def sine(frequency):
    return Trace(np.sin(2 * np.pi * frequency * np.arange(COUNT) / RATE), {"sampling_rate": RATE})


def ramp():
    return Trace(np.linspace(6, 7, COUNT), {"sampling_rate": RATE})


def seen(trace, frequency):
    inner = slice(len(trace.data) // 10, -len(trace.data) // 10)
    t = np.arange(len(trace.data))[inner] / trace.stats.sampling_rate
    vector = 2j * np.mean(trace.data[inner] * np.exp(-2j * np.pi * frequency * t))
    return f"{abs(vector):.2f} late {round(-np.angle(vector) / (2 * np.pi * frequency) * 1e3) + 0} ms"


WAYS = {
    "resample(50)": lambda trace: trace.resample(50),
    "resample(200)": lambda trace: trace.resample(200),
    "resample(50, window=None)": lambda trace: trace.resample(50, window=None),
    "interpolate(50)": lambda trace: trace.interpolate(50),
    "decimate(2)": lambda trace: trace.decimate(2),
}
for name, way in WAYS.items():
    ends = way(ramp()).data
    print(f"{name:25s}", *(f"{f} Hz {seen(way(sine(f)), f)} |" for f in (1, 10, 20)[: 2 if "dec" in name else 3]), f"6..7 bar {ends[0]:.2f}..{ends[-1]:.2f}")
END
diff - seen <<'END'
resample(50)              1 Hz 1.00 late 0 ms | 10 Hz 0.90 late 0 ms | 20 Hz 0.65 late 0 ms | 6..7 bar 6.30..6.99
resample(200)             1 Hz 1.00 late 0 ms | 10 Hz 0.90 late 0 ms | 20 Hz 0.65 late 0 ms | 6..7 bar 6.25..6.50
resample(50, window=None) 1 Hz 1.00 late 0 ms | 10 Hz 1.00 late 0 ms | 20 Hz 1.00 late 0 ms | 6..7 bar 6.25..7.07
interpolate(50)           1 Hz 1.00 late 0 ms | 10 Hz 1.00 late 0 ms | 20 Hz 1.00 late 0 ms | 6..7 bar 6.00..7.00
decimate(2)               1 Hz 1.00 late 44 ms | 10 Hz 1.00 late 48 ms | 6..7 bar 0.01..7.00
END
