#!/bin/sh
# nitime 0.12.1: a valve that answers 20 ms late leads by 36 degrees at 5 Hz; for SciPy and matplotlib it lags by 36.
#
# Noise as command, and the same noise 20 ms later as answer. `scipy.signal.csd(command, answer)` and matplotlib's `csd` conjugate
# the first, so that a delay has a falling phase, as a frequency response has. nitime's cross spectra, by Welch or by tapers, and
# the phase of its CoherenceAnalyzer conjugate the second. A response made of one's phase and the other's gain is that of
# a valve that foresees its command. Nothing says which is meant. Ask each for a known delay first.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile nitime==0.12.1 scipy==1.17.1 matplotlib==3.11.2 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import nitime.algorithms as algorithms
import numpy as np
from matplotlib import mlab
from nitime.analysis import CoherenceAnalyzer
from nitime.timeseries import TimeSeries
from scipy import signal

RATE, LATE, LENGTH = 1000, 20, 1000
noise = np.random.default_rng(0).standard_normal(200 * LENGTH + LATE)
command, answer = noise[LATE:], noise[:-LATE]
both = np.vstack([command, answer])
welch = {"this_method": "welch", "NFFT": LENGTH, "Fs": RATE}
frequencies, density = signal.csd(command, answer, RATE, nperseg=LENGTH)
by_mlab, _ = mlab.csd(command, answer, NFFT=LENGTH, Fs=RATE)
_, by_nitime = algorithms.get_spectra(both, method=welch)
coherence = CoherenceAnalyzer(TimeSeries(both, sampling_rate=RATE), method=dict(welch))
at = np.argmin(np.abs(frequencies - 5))
phases = {"SciPy": density[at], "matplotlib": by_mlab[at], "nitime": by_nitime[0, 1, at], "CoherenceAnalyzer": np.exp(1j * coherence.phase[0, 1, at])}
for name, value in phases.items():
    print(f"{name}: phase at {frequencies[at]:g} Hz {np.degrees(np.angle(value)):+.0f} degrees")
END
diff - seen <<'END'
SciPy: phase at 5 Hz -36 degrees
matplotlib: phase at 5 Hz -36 degrees
nitime: phase at 5 Hz +36 degrees
CoherenceAnalyzer: phase at 5 Hz +36 degrees
END
